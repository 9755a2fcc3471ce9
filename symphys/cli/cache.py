"""``symphys cache``: the compiled kernels on disk."""

from __future__ import annotations

import click


@click.group()
def cache() -> None:
    """Look at the kept kernels, or remove them."""


@cache.command()
def info() -> None:
    """Say where compiled kernels are kept, how many, and how much room they take."""
    from symphys.codegen import default_cache

    kept = default_cache()
    found = kept.info()
    click.echo(f"folder   {found.folder}{'' if found.folder.is_dir() else ' (not made yet)'}")
    click.echo(f"kernels  {found.kernels}")
    click.echo(f"size     {size(found.bytes)}")
    click.echo(f"limit    {size(found.limit)}; those not used for longest go first")
    if why := kept.distrust():
        click.echo(f"unused   {why}")


@cache.command()
def clear() -> int:
    """Remove all kernels; those that are needed again are compiled again."""
    from symphys.codegen import default_cache

    kept = default_cache()
    before = kept.info()
    gone = kept.clear()
    after = kept.info()
    click.echo(f"removed {gone} of {before.kernels} kernels, {size(before.bytes - after.bytes)}, from {kept.folder}")
    if after.kernels:
        click.echo(f"{after.kernels} cannot be removed: may you write to the folder?", err=True)
    return 1 if after.kernels else 0


def size(count: int) -> str:
    """Write a number of bytes in a readable unit."""
    if count < 1000:
        return f"{count} bytes"
    return f"{count / 1e3:.0f} kB" if count < 1e6 else f"{count / 1e6:.1f} MB"
