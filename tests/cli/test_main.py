"""Exit codes and messages: 0 solved, 1 not solved, 2 wrong usage or file, 130 interrupted; never a traceback."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from tools.page_scripts import charts
from tools.repeats import few
from tools.waiting import FOREVER

import symphys
from symphys import problems
from symphys.cli.app import app
from symphys.report import write_batch_report
from symphys.results.config import case_name
from symphys.runs import read_result

LONG = ("--set", "simulation.dt=1e-4", "--set", "objective.stop=converged")
"""Makes of a throw a solve of several seconds."""
LONG_FOLDER = case_name("throw", {"simulation.dt": 1e-4, "objective.stop": "converged"})

QUICK = ("--backend", "casadi", "--unexamined")
"""Where neither a kernel nor an examination matters."""

FINER = "throw@simulation.dt=0.01,solver.least_squares.iterations=30"

Run = Callable[..., tuple[int, str, str]]


@pytest.mark.usefixtures("whole_report")
def test_a_solved_problem_exits_0_with_table_and_report(run: Run, throw: Path) -> None:
    code, out, err = run("solve", throw, "--solver", "gradient,least_squares")
    assert code == 0
    assert "least_squares" in out and "1/1" in out
    assert out.partition("report: ")[2].strip() == (Path("reports") / "index.html").resolve().as_uri()
    assert Path("reports/index.html").is_file()
    assert err.splitlines()[0] == "throw gradient seed 0: begins"
    assert err.splitlines()[1].startswith("throw gradient seed 0: solved, objective")
    assert Path("reports/throw/gradient-seed0/report.html").is_file()


def test_the_same_command_again_does_nothing_and_says_so(run: Run, throw: Path) -> None:
    run("solve", throw, "--solver", "gradient", *QUICK)
    before = Path("reports/throw/gradient-seed0/result.json").read_bytes()
    code, _, err = run("solve", throw, "--solver", "gradient", *QUICK)
    assert code == 0
    assert err.splitlines() == ["throw gradient seed 0: done before (solved)"]
    assert Path("reports/throw/gradient-seed0/result.json").read_bytes() == before


@pytest.mark.slow
def test_one_unsolved_run_exits_1_and_the_others_are_done(run: Run, throw: Path, unreachable: Path) -> None:
    code, out, _ = run("solve", unreachable, throw, "--solver", "least_squares", "--out", "o", *QUICK)
    assert code == 1
    assert "0/1" in out and "1/1" in out
    assert read_result(Path("o/throw/least_squares-seed0/result.json")).solved
    assert not read_result(Path("o/unreachable/least_squares-seed0/result.json")).solved


@pytest.mark.slow
def test_what_an_unsolved_run_misses_has_a_unit_and_the_bound_that_holds_it_back_is_named(
    run: Run, unreachable: Path
) -> None:
    _, out, _ = run("solve", unreachable, "--solver", "least_squares", "--seeds", 2, "--backend", "casadi")
    assert 'missed: "is at half a metre" by 0.2 m (tolerance 0.01 m)' in out
    bound = "the upper bound 1.5 of throw[0]"
    assert f"unreachable least_squares: {bound} is active: the objective would improve beyond it. A stat" in out
    assert f"unreachable least_squares: 2 of 2 seeds end at {bound}" in out


@pytest.mark.slow
def test_what_is_met_by_a_motion_that_cannot_be_exits_1_with_its_reasons(run: Run, throw: Path) -> None:
    """The ball may begin anywhere, and begins in the ground; with and without an examination."""
    text = throw.read_text(encoding="utf-8").replace("ball.velocity[0:2]", "ball.position[2]")
    text = text.replace("guess = [1, 0]", "guess = 1").replace("ball.position[0:2] - [0.5, 0]", "ball.position[2]")
    throw.write_text(text.replace("tolerance = 0.01", "tolerance = 0.01\nat = 0"), encoding="utf-8")
    for more in ((), ("--unexamined",)):
        out = f"o{len(more)}"
        code, table, err = run("solve", throw, "--solver", "least_squares", "--out", out, "--backend", "casadi", *more)
        result = read_result(Path(out, "throw/least_squares-seed0/result.json"))
        assert (code, result.verdict, result.solved) == (1, "doubted", False)
        assert "0/1" in table and "met, but not to be trusted" in table
        assert "throw least_squares: not to be trusted: " in table and "ball-ground" in table
        assert "met, but not to be trusted" in err.splitlines()[1]
        assert "Met, but not to be trusted" in Path(out, "index.html").read_text(encoding="utf-8")


def test_the_best_of_a_budget_is_not_called_solved_and_exits_0(run: Run, throw: Path) -> None:
    text = throw.read_text(encoding="utf-8")
    cost = '[[cost]]\nname = "far"\nsquares = "ball.position[0] - 1"\n'
    throw.write_text(text.partition("[[target]]")[0] + cost, encoding="utf-8")
    settings = ("--set", "solver.gradient.iterations=1")
    code, table, err = run("solve", throw, "--solver", "gradient", *settings, *QUICK)
    assert code == 0
    assert "best found, budget ended" in table and "1/1" not in table
    assert "solved" not in err
    assert "Best found" in Path("reports/index.html").read_text(encoding="utf-8")
    code, table, _ = run("solve", throw, "--solver", "least_squares", "--out", "o", *QUICK)
    assert code == 0 and "1/1" in table and "converged" in table


@pytest.mark.slow
def test_seeds_and_settings_reach_the_runs(run: Run, throw: Path) -> None:
    options = ("--seeds", "2", "--set", "simulation.dt=0.01", "--set", "solver.least_squares.iterations=30")
    code, out, _ = run("solve", throw, "--solver", "least_squares", *options, *QUICK)
    assert code == 0 and "2/2" in out
    config = json.loads(Path(f"reports/{FINER}/least_squares-seed1/config.json").read_text(encoding="utf-8"))
    assert config["seed"] == 1
    assert config["settings"] == {"simulation.dt": 0.01, "solver.least_squares.iterations": 30}
    assert config["options"]["iterations"] == 30


@pytest.mark.slow
def test_other_settings_overwrite_nothing_in_either_order(
    run: Run, throw: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file as it is, two settings, and all again: every run is kept, and the page and the table name them."""
    draw = write_batch_report
    monkeypatch.setattr("symphys.report.making.batch.write_batch_report", lambda out, unmade: out / "index.html")
    asked = [(), ("--set", "ground.friction=0.3"), ("--set", "ground.friction=0.6")]
    for settings in asked:
        code, out, _ = run("solve", throw, "--solver", "least_squares", *settings, *QUICK)
        assert code == 0
    assert "throw@ground.friction=0.6" in out
    folders = sorted(path.name for path in Path("reports").iterdir() if path.is_dir() and path.name != "figures")
    assert folders == ["throw", "throw@ground.friction=0.3", "throw@ground.friction=0.6"]
    page = draw(Path("reports")).read_text(encoding="utf-8")
    assert "With ground.friction=0.3." in page and "With ground.friction=0.6." in page
    for settings in reversed(asked):
        err = run("solve", throw, "--solver", "least_squares", *settings, *QUICK)[2]
        case = "@".join(["throw", *settings[1:]])
        assert err.splitlines() == [f"{case} least_squares seed 0: done before (solved)"]


@pytest.mark.slow
def test_workers_solve_too(run: Run, throw: Path) -> None:
    code, out, err = run("solve", throw, "--solver", "gradient,least_squares", "--jobs", "2", *QUICK)
    assert code == 0 and out.count("1/1") == 2
    assert sorted(line.rpartition(": ")[2] for line in err.splitlines() if line.endswith("begins")) == ["begins"] * 2


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["sovle"], "solve"),
        (["solve"], "FILE"),
        (["solve", "ball_throw", "--sovler", "cma"], "--solver"),
        (["solve", "ball_throw", "--solver", "cmaes"], "cma"),
        (["solve", "ball_throw", "--solver", ""], "gradient"),
        (["solve", "ball_thorw"], "ball_throw"),
        (["solve", "nowhere/ball_throw.toml"], "nowhere"),
        (["solve", "."], "folder"),
        (["solve", "ball_throw", "--seeds", "0"], "seeds"),
        (["solve", "ball_throw", "--jobs", "none"], "jobs"),
        (["solve", "ball_throw", "--set", "simulation.dt"], "KEY=VALUE"),
        (["solve", "ball_throw", "--set", "simulation.td=1"], "dt"),
        (["solve", "ball_throw", "--set", "simulation.dt=fast"], "dt"),
        (["solve", "ball_throw", "--set", "solver.cma.evaluatoins=3", "--solver", "gradient"], "evaluations"),
        (["solve", "ball_throw", "--set", "solver.cmaes.evaluations=3"], "cma"),
        (["solve", "x" * 5000], "no file"),
        (["report", "nowhere"], "nowhere"),
        (["show", "ball_thorw"], "ball_throw"),
        (["check", "ball_throw", "--set", "simulation.duration=[[[["], "duration"),
        (["schema", "--out", "/dev/null/below/schema.json"], "/dev/null"),
    ],
)
def test_wrong_usage_exits_2_with_a_hint(run: Run, arguments: list[str], words: str) -> None:
    code, out, err = run(*arguments)
    assert code == 2
    assert words in err
    assert out == ""
    assert not Path("reports").exists()


@pytest.mark.parametrize("content", [b"", b"\x00\xff\x80 binary", b"[" * 1_000_000, b"a = nan\n", b"[simulation]\n"])
def test_a_bad_file_exits_2_and_nothing_is_run(run: Run, throw: Path, tmp_path: Path, content: bytes) -> None:
    bad = tmp_path / "bad.toml"
    bad.write_bytes(content)
    code, out, err = run("solve", throw, bad)
    assert code == 2 and out == ""
    assert "bad.toml" in err
    assert not Path("reports").exists()


def test_two_files_of_one_name_are_refused(run: Run, throw: Path, tmp_path: Path) -> None:
    other = tmp_path / "other" / "throw.toml"
    other.parent.mkdir()
    other.write_text(throw.read_text(encoding="utf-8"), encoding="utf-8")
    code, _, err = run("solve", throw, other)
    assert code == 2 and "one name" in err
    assert run("solve", throw, throw, "--solver", "gradient", *QUICK)[0] == 0


def test_an_out_that_cannot_be_written_exits_2(run: Run, throw: Path) -> None:
    Path("file").write_text("in the way", encoding="utf-8")
    code, _, err = run("solve", throw, "--solver", "gradient", "--out", "file/below")
    assert code == 2 and "file" in err


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="permissions do not bind this user")
def test_a_read_only_out_exits_2(run: Run, throw: Path) -> None:
    Path("locked").mkdir(mode=0o500)
    code, _, err = run("solve", throw, "--solver", "gradient", "--out", "locked")
    assert code == 2 and "permission denied" in err


@pytest.mark.slow
def test_a_failing_run_stops_no_other(run: Run, throw: Path, tmp_path: Path) -> None:
    """A root of a negative number is no fault of the file, but of its motion."""
    wild = tmp_path / "wild.toml"
    text = throw.read_text(encoding="utf-8").replace('"ball.position[0:2]', '"sqrt(ball.position[0:2] - 3)')
    wild.write_text(text, encoding="utf-8")
    code, out, _ = run("solve", wild, throw, "--solver", "gradient", *QUICK)
    assert code == 1
    assert "0/1" in out and "1/1" in out


@pytest.mark.slow
@pytest.mark.usefixtures("whole_report")
def test_report_is_made_again(run: Run, throw: Path) -> None:
    run("solve", throw, "--solver", "gradient", *QUICK)
    pages = [Path("reports/throw/gradient-seed0/report.html"), Path("reports/index.html")]
    for page in pages:
        page.unlink()
    code, out, _ = run("report", "reports")
    assert code == 0
    assert out.split() == [str(page) for page in pages]
    assert all(page.is_file() for page in pages)
    assert run("report", pages[0].parent)[1].split() == [str(pages[0])]


def test_show_draws_the_guess(run: Run, throw: Path) -> None:
    code, out, _ = run("show", throw, "--out", "pictures")
    assert code == 0
    page = Path(out.strip())
    assert page.is_file() and page.parts[0] == "pictures"
    panels = charts(page.read_text(encoding="utf-8"))["contacts"]["panels"]
    assert [panel["title"] for panel in panels][1:] == ["ball-ground: gap [m]"]


def test_help_has_every_command_in_a_group_with_a_whole_sentence(run: Run) -> None:
    code, out, _ = run("-h")
    assert code == 0 and out.count("...") == 1  # of the arguments, in the first line
    assert [name for name in app.commands if f"\n  {name} " not in out] == []
    assert "Begin with `symphys solve ball_throw`" in out


def test_the_list_wraps_between_words(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "72")
    _, out, _ = run("list")
    assert max(map(len, out.splitlines())) <= 72
    flat = " ".join(out.split())
    assert re.search(r"acrobot An acrobot swings up from rest \[ilqr, [\d.]+ s\]", flat) and "[automatic" in flat


def test_the_list_has_times_of_shipped_problems_alone() -> None:
    known = problems.typical_seconds()
    assert set(known) <= set(problems.catalogue()) and len(known) > 20 and min(known.values()) > 0


def test_list_names_problems_and_solvers(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    few = {"ball_throw": problems.find("ball_throw")}
    monkeypatch.setattr(problems, "catalogue", lambda: few)
    code, out, _ = run("list")
    assert code == 0
    for name in ("ball_throw", "gradient", "least_squares", "ipopt", "cma"):
        assert name in out


def test_schema_is_json_and_knows_the_solvers(run: Run) -> None:
    code, out, _ = run("schema")
    assert code == 0
    assert {"gradient", "cma"} <= set(json.loads(out)["properties"]["solver"]["properties"])
    code, named, _ = run("schema", "--out", "s.json")
    assert code == 0 and named == "s.json\n"
    assert json.loads(Path("s.json").read_text(encoding="utf-8")) == json.loads(out)


def test_schema_as_a_page(run: Run) -> None:
    code, out, _ = run("schema", "--markdown")
    assert code == 0 and out.startswith("# Reference of problem files\n") and "## `[solver.gradient]`" in out


def test_version_and_help(run: Run) -> None:
    assert run("--version")[:2] == (0, f"symphys {symphys.__version__}\n")
    code, out, _ = run("solve", "--help")
    assert code == 0 and "--seeds" in out


@pytest.mark.slow
def test_check_draws_nothing(throw: Path) -> None:
    code = f"import sys; from symphys.cli import main; main(['check', {str(throw)!r}]); print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = {name.partition(".")[0] for name in done.stdout.split()}
    assert "casadi" in loaded and "matplotlib" not in loaded


def test_help_loads_nothing_heavy() -> None:
    """The command line answers at once: casadi, numpy and the like are loaded when they are needed."""
    code = "import sys; from symphys.cli import main; main(['--help']); print(*sys.modules, file=sys.stderr)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = {name.partition(".")[0] for name in done.stderr.split()}
    assert not loaded & {"casadi", "numpy", "scipy", "cma", "matplotlib", "pydantic", "rich"}


@few("jobs", [1, 2], 1)
def test_ctrl_c_saves_and_the_same_command_goes_on(throw: Path, tmp_path: Path, jobs: int) -> None:
    command = [sys.executable, "-m", "symphys", "solve", str(throw), "--solver", "cma", "--seeds", "2", *LONG]
    command += ["--jobs", str(jobs)]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        for _ in range(jobs):
            while not (line := process.stderr.readline()).endswith("begins\n"):
                assert line, "it ended by itself"
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=FOREVER)
    assert process.returncode == 130
    assert "Traceback" not in err
    assert "the same command goes on from there" in err
    folders = [tmp_path / "reports" / LONG_FOLDER / f"cma-seed{seed}" for seed in range(jobs)]
    assert all(read_result(folder / "result.json").interrupted for folder in folders)
    assert all((folder / "checkpoint.json").exists() for folder in folders)


@pytest.mark.slow
def test_a_backend_is_chosen_and_told(run: Run, throw: Path) -> None:
    assert run("solve", throw, "--solver", "least_squares", *QUICK)[0] == 0
    found = read_result(Path("reports/throw/least_squares-seed0/result.json"))
    assert found.backend.name == "casadi" and found.backend.compiled == "" and found.backend.note == ""
    assert found.seconds["compile"] == 0
    config = json.loads(Path("reports/throw/least_squares-seed0/config.json").read_text(encoding="utf-8"))
    assert config["backend"] == "casadi"
    code, _, err = run("solve", throw, "--solver", "least_squares", "--unexamined")
    assert code == 0 and "done before" not in err
    code, _, err = run("solve", throw, "--backend", "smid")
    assert code == 2 and "simd" in err


@pytest.mark.usefixtures("whole_report")
def test_without_a_compiler_one_line_says_so(
    run: Run, throw: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("CC", "/nonexistent")
    monkeypatch.setenv("SYMPHYS_CACHE", str(tmp_path / "cache"))
    code, _, err = run("solve", throw, "--solver", "gradient,least_squares", "--unexamined")
    assert code == 0
    said = [line for line in err.splitlines() if "ziglang" in line]
    assert len(said) == 1 and said[0].startswith("symphys: casadi's virtual machine evaluates")
    folder = Path("reports/throw/gradient-seed0")
    assert read_result(folder / "result.json").backend.note in said[0]
    assert "ziglang" in (folder / "log.txt").read_text(encoding="utf-8")
    assert "ziglang" in (folder / "report.html").read_text(encoding="utf-8")


def test_the_help_names_every_backend(run: Run) -> None:
    from symphys.codegen.backends import NAMES

    _, out, _ = run("solve", "--help")
    assert "|".join(sorted(NAMES, key=["auto", "casadi", "c", "simd", "simd32", "cuda", "cuda32"].index)) in out


@pytest.mark.slow
@pytest.mark.usefixtures("whole_report")
def test_no_report_leaves_pages_out_and_report_makes_them_later(run: Run, throw: Path) -> None:
    code, out, _ = run("solve", throw, "--solver", "least_squares", "--no-report", *QUICK)
    assert code == 0 and "no report; `symphys report reports` makes one" in out
    page = Path("reports/throw/least_squares-seed0/report.html")
    assert not page.exists() and not Path("reports/index.html").exists()
    both = [str(page), "reports/index.html"]
    assert run("report", "reports", "--jobs", "1")[1].split() == both
    _, out, err = run("report", "reports", "--new", "--jobs", "1")
    assert out.split() == ["reports/index.html"] and "1 page of runs up to date" in err
    assert run("report", "reports", "--all", "--jobs", "1")[1].split() == both
    assert run("report", "reports", "--all", "--new")[0] == 2


@pytest.mark.slow
@pytest.mark.usefixtures("whole_report")
def test_a_page_that_cannot_be_made_is_named_and_exits_3(run: Run, throw: Path) -> None:
    """Of two runs that are solved one has no place for its page; the other page and that of the batch are made."""
    places = [Path(f"reports/throw/least_squares-seed{seed}/report.html") for seed in range(2)]
    (places[0] / "full").mkdir(parents=True)
    solve = ("solve", throw, "--solver", "least_squares", "--seeds", "2", *QUICK)
    code, out, err = run(*solve)
    assert code == 3 and "2/2" in out and out.strip().endswith("/reports/index.html")
    assert f"symphys: {places[0]} could not be made: " in err
    assert places[1].read_text(encoding="utf-8").endswith("</html>\n") and Path("reports/index.html").is_file()
    code, out, err = run("report", "reports", "--jobs", "1", "--all")
    assert code == 3 and out.split() == [str(places[1]), "reports/index.html"] and str(places[0]) in err
    assert run("report", "reports", "--pages", "small")[0] == 2
    Path("reports/index.html").unlink()
    Path("reports/index.html/full").mkdir(parents=True)
    code, out, err = run(*solve)
    assert code == 3 and "no report; `symphys report reports` makes one" in out and "report:" not in out
    assert "reports/index.html could not be made: " in err


@pytest.mark.usefixtures("whole_report")
def test_solving_and_reporting_import_no_matplotlib(throw: Path, tmp_path: Path) -> None:
    """Figures as files alone need it, and pandas and statistics are for those who ask; all can be imported after."""
    code = f"""
import sys
from symphys.cli.app import main
code = main(["solve", {str(throw)!r}, "--solver", "gradient,cma", "--backend", "casadi", "--out", "out"])
assert code == 0 and not {{"matplotlib", "pandas", "scipy.stats"}} & set(sys.modules)
import scipy.stats
assert main(["report", "out", "--jobs", "1", "--figures"]) == 0 and "matplotlib" in sys.modules
"""
    done = subprocess.run([sys.executable, "-c", code], check=False, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "out" / "throw" / "gradient-seed0" / "report.html").read_text(encoding="utf-8")
    assert 'class="chart"' in page and "<canvas" in page
    assert (tmp_path / "out" / "throw" / "gradient-seed0" / "figures" / "states.csv").is_file()


@pytest.mark.usefixtures("whole_report")
def test_kinds_of_pages_are_accepted_with_a_warning(run: Run, throw: Path) -> None:
    code, _, err = run("solve", throw, "--solver", "least_squares", "--pages", "light", *QUICK)
    assert code == 0 and err.count("--pages is deprecated") == 1
    assert not list(Path("reports").rglob("figures"))
    code, _, err = run("report", "reports", "--pages", "full", "--jobs", "1")
    assert code == 0 and err.count("--pages is deprecated") == 1
    assert list(Path("reports").rglob("figures/convergence.svg"))
    assert "--pages" not in run("report", "--help")[1]
