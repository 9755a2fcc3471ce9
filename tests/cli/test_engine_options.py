"""``symphys solve --on``: what it says, and which options go together."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from fakes.thread_engine import Threads

from symphys.batches import following


@pytest.mark.slow
def test_a_batch_on_an_engine_ends_like_any_other(run: Any, throw: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The engine is given the number of drivers and the absolute folder; the second command has nothing to start."""
    opened: list[Any] = []

    def open_engine(*given: Any) -> Threads:
        opened.append(given)
        return Threads()

    monkeypatch.setattr(following, "open_engine", open_engine)
    command = ("solve", throw, "--solver", "least_squares", "--seeds", 3, "--unexamined", "--jobs", 2, "--on", "dask")
    for _ in range(2):
        code, out, err = run(*command, "--out", "results")
        assert code == 0 and "3/3" in out and "report: file:" in out
    assert opened == [("dask", "", 2, (Path.cwd() / "results"))]
    assert err.count("done before") == 3
    assert [path.name for path in Path("results").iterdir() if path.name.startswith(".")] == [".runs.jsonl"]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--scheduler", "tcp://host:1"), "needs --on dask or --on slurm"),
        (("--on", "dask", "--multi-start"), "leave it or --on dask out"),
        (("--on", "moon"), "'dask', 'slurm'"),
    ],
)
def test_options_that_do_not_go_together_are_named(run: Any, throw: Path, options: tuple[str, ...], said: str) -> None:
    code, _, err = run("solve", throw, *options)
    assert code == 2 and said in err and not Path("reports").exists()


def test_drivers_that_do_not_start_are_a_failure_with_what_to_do(
    run: Any, throw: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(following, "MIN_POLL_INTERVAL", 0.01)
    monkeypatch.setattr(following, "open_engine", lambda *_: Threads(stillborn=1000))
    code, _, err = run("solve", throw, "--solver", "least_squares", "--on", "slurm")
    assert code == 1 and "1 of 1 runs are not done; run the same command again" in err
