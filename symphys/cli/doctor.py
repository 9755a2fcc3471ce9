"""``symphys doctor``: check compilers, GPUs and packages of this machine."""

from __future__ import annotations

import click

from symphys import threads


@click.command()
def doctor() -> int:
    """Say what symphys finds on this machine, try each thing, and say what to do about what does not work."""
    threads.limit()
    from symphys.machine import examine, healthy

    findings = []
    for finding in examine():
        findings.append(finding)
        click.echo(f"{finding.state:<8} {finding.name:<18} {finding.text}")
    return 0 if healthy(findings) else 1
