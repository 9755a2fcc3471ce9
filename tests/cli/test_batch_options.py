"""How a batch is done, and what is shown of it: dry runs, repeats, limits, events for other programs, silence."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path

import click
import pytest

from symphys.cli.arguments import UsageFault
from symphys.cli.solve import read_time

QUICK = ("--backend", "casadi", "--unexamined", "--solver", "least_squares", "--no-report")
RUN = Path("reports/throw/least_squares-seed0")
Run = Callable[..., tuple[int, str, str]]


def test_times_have_units() -> None:
    texts = ("90", "90s", "1.5 min", "2h", "1d")
    assert [read_time(None, click.Option(["--budget"]), text) for text in texts] == [90, 90, 90, 7200, 86400]
    for text in ("0", "-1", "ten", "5 m", "1..2", ""):
        with pytest.raises(UsageFault, match=r"--budget .*10min"):
            read_time(None, click.Option(["--budget"]), text)


def test_a_dry_run_says_what_would_be_done_and_why_and_does_nothing(run: Run, throw: Path) -> None:
    def said(*more: str) -> list[str]:
        code, out, _ = run("solve", throw, "--dry-run", *more, *QUICK)
        assert code == 0
        return out.splitlines()

    name = "throw least_squares seed 0"
    assert said() == [f"{name}: to do: not begun yet", "1 of 1 runs are to do"]
    assert not Path("reports").exists()
    run("solve", throw, *QUICK)
    written = {path: path.read_bytes() for path in RUN.iterdir()}
    assert said() == [f"{name}: done: done before", "0 of 1 runs are to do"]
    assert said("--rerun", "all") == [f"{name}: to do: done before", "1 of 1 runs are to do"]
    assert {path: path.read_bytes() for path in RUN.iterdir()} == written
    whole = (RUN / "result.json").read_text("utf-8")
    (RUN / "result.json").write_text(whole.replace('"solved": true', '"solved": tr'), "utf-8")
    assert "to do" in said()[0] and "result.json is not valid JSON" in said()[0]
    (RUN / "result.json").write_text(whole, "utf-8")
    (RUN / "config.json").unlink()
    assert said()[0] == f"{name}: to do: cannot read {RUN / 'config.json'}: no such file or directory"
    code, out, _ = run("solve", throw, *QUICK, "--backend", "auto", "--dry-run")
    assert code == 0 and "1 of 1 runs are to do" in out


def test_a_changed_problem_is_solved_again_and_the_dry_run_says_so(run: Run, throw: Path) -> None:
    run("solve", throw, *QUICK)
    throw.write_text(throw.read_text("utf-8").replace("mass = 1.0", "mass = 1.5"), "utf-8")
    out = run("solve", throw, "--dry-run", *QUICK)[1]
    assert "to do: the problem file has changed since least_squares-seed0 was solved" in out
    assert "begins" in run("solve", throw, *QUICK)[2]


def test_results_of_another_version_are_kept_until_asked_for(run: Run, throw: Path) -> None:
    run("solve", throw, *QUICK)
    text = (RUN / "result.json").read_text("utf-8")
    result = json.loads(text)
    result["versions"]["symphys"] = "0.0.1"
    (RUN / "result.json").write_text(json.dumps(result), "utf-8")
    assert "older: done by symphys 0.0.1, this is " in run("solve", throw, "--dry-run", *QUICK)[1]
    assert "done before" in run("solve", throw, *QUICK)[2]
    assert "begins" in run("solve", throw, "--rerun", "changed", *QUICK)[2]
    assert "done: done before" in run("solve", throw, "--dry-run", *QUICK)[1]


def test_events_are_json_lines_and_nothing_else(run: Run, throw: Path) -> None:
    code, out, err = run("solve", throw, "--json", "--seeds", "2", *QUICK)
    events = [json.loads(line) for line in out.splitlines()]
    assert (code, err) == (0, "")
    assert [each["event"] for each in events if each["event"] not in ("advanced", "judging")] == [
        *("began", "ended") * 2,
        "finished",
    ]
    first = next(each for each in events if each["event"] == "ended")
    assert (first["solved"], first["status"], first["folder"]) == (True, "met", str(RUN))
    assert events[-1] == {
        "event": "finished",
        "runs": 2,
        "accepted": 2,
        "failed": 0,
        "interrupted": False,
        "spent": False,
        "exit_code": 0,
    }


def test_quiet_says_what_fails_with_the_end_of_its_log(run: Run, throw: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert run("solve", throw, "--quiet", *QUICK) == (0, "", "")

    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("something nobody thought of")

    monkeypatch.setattr(sys.modules["symphys.runs.execute"], "judge", broken)
    code, out, err = run("solve", throw, "--quiet", "--rerun", "all", *QUICK)
    assert (code, out) == (1, "")
    assert err.startswith(
        "throw least_squares seed 0: failed: unexpected ZeroDivisionError: something nobody thought of"
    )
    assert err.splitlines()[-1] == "    ZeroDivisionError: something nobody thought of"


def test_a_batch_whose_time_is_up_says_how_to_go_on(run: Run, throw: Path) -> None:
    code, _, err = run("solve", throw, "--budget", "0.000001", *QUICK)
    assert code == 1 and "the time of the batch is used up; 0 of 1 runs are done" in err
    assert run("solve", throw, *QUICK)[0] == 0
