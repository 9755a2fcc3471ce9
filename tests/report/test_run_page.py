"""The page of one run is complete, self-contained, harmless, and the same when it is made again."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from tools.page_scripts import charts, held
from tools.repeats import few

from symphys.report import write_run_figures, write_run_report
from symphys.report.pages.markup import packed_viewer
from symphys.report.pages.sections import NOT_EXAMINED
from symphys.results.text_files import ReportError

LARGEST = 100_000
OPTIONAL = ("trajectory.npz", "guess.npz", "scene.json", "trace.csv", "config.json", "problem.toml", "log.txt")
ONE_ARRAY = (
    b"\x93NUMPY\x01\x00v\x00" + b"{'descr': '<f8', 'fortran_order': False, 'shape': (1,)}".ljust(117) + b"\n" + bytes(8)
)


class Page(HTMLParser):
    """What a page refers to and shows."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.references: list[str] = []
        self.tags: list[str] = []
        self.words: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.references += [value or "" for key, value in attributes if key in ("src", "href", "srcset", "data")]

    def handle_data(self, data: str) -> None:
        self.words.append(data)

    @property
    def text(self) -> str:
        return re.sub(r"\s+", " ", " ".join(self.words))


def without_motion(run_dir: Path) -> Path:
    """The same folder, quicker to read, for tests of words."""
    for name in ("trajectory.npz", "guess.npz", "trace.csv"):
        (run_dir / name).unlink()
    return run_dir


def read(run_dir: Path) -> str:
    return write_run_report(run_dir).read_text(encoding="utf-8")


@dataclass(frozen=True)
class Shown:
    """A page, to be looked at only."""

    folder: Path
    text: str


@pytest.fixture(scope="module")
def shown(made: Path, tmp_path_factory: pytest.TempPathFactory) -> Shown:
    """Of the thrown ball, solved."""
    folder = Path(shutil.copytree(made / "ball_throw" / "gradient-seed0", tmp_path_factory.mktemp("shown") / "run"))
    return Shown(folder, read(folder))


@pytest.mark.slow
def test_page_tells_names_status_and_numbers(shown: Shown) -> None:
    page, run_dir = Page(shown.text), shown.folder
    found = json.loads((run_dir / "result.json").read_text())
    for word in ("Throw a giant soccer ball", "gradient", "seed 0", "comes to rest at 10 m", "Solved", "45 rollouts"):
        assert word in page.text
    for word in (
        "throw",
        "spin",
        "Thrown so that it stops dead.",
        "simd, 8 lanes, 2 threads, double precision, gcc 12.2, taken from the cache",
        "symphys solve",
        "3.11.7",
    ):
        assert word in page.text
    assert f"{found['objective']:.2e}"[:4] in page.text
    assert "Agrees with finite differences." in page.text


@pytest.mark.slow
def test_page_needs_nothing_else(shown: Shown) -> None:
    text = shown.text
    page = Page(text)
    assert page.references
    assert all(link.startswith("#") for link in page.references)
    assert not (shown.folder / "figures").exists()
    assert not {"link", "iframe", "object", "embed", "base"} & set(page.tags)
    assert "http://" not in text
    assert "https://" not in text
    assert "@import" not in text
    assert "url(" not in text


@pytest.mark.slow
def test_figures_are_files_on_request(shown: Shown, tmp_path: Path) -> None:
    figures = write_run_figures(shown.folder, tmp_path)
    drawn = [path for path in figures if path.suffix == ".svg"]
    assert (
        {path.stem for path in drawn}
        == {path.stem for path in figures}
        == {*["motion", "states", "contacts", "convergence"]}
    )
    assert all(path.read_text(encoding="utf-8").lstrip().startswith("<?xml") for path in drawn)


@pytest.mark.slow
def test_knots_and_controls_are_drawn(batch: Path) -> None:
    text = read(batch / "two_balls" / "gradient-seed0")
    assert "push: 2 components at 480 instants" in Page(text).text
    assert {"controls", "variables"} <= set(charts(text))


@pytest.mark.slow
def test_what_is_told_is_shown_and_drawn(run_dir: Path, edit: Callable[..., None]) -> None:
    """The number with that of the guess, and its way."""
    guess = json.loads((run_dir / "result.json").read_text()).get("guess") or {}
    edit(run_dir / "result.json", outputs={"speed [m/s]": 1.25}, guess={**guess, "told: speed [m/s]": 0.125})
    plain = read(run_dir)
    assert "1.25 (at the guess 0.125)" in Page(plain).text
    header, *rows = (run_dir / "trace.csv").read_text(encoding="utf-8").splitlines()
    told = [f"{header},told: speed [m/s]", *(f"{row},{0.1 * k}" for k, row in enumerate(rows))]
    (run_dir / "trace.csv").write_text("\n".join(told) + "\n", encoding="utf-8")
    before, after = ([each["title"] for each in charts(t)["convergence"]["panels"]] for t in (plain, read(run_dir)))
    assert "Speed [m/s]" in after and "Speed [m/s]" not in before


@pytest.mark.slow
def test_remade_page_is_the_same(shown: Shown, tmp_path: Path) -> None:
    first, run_dir = shown.text, shown.folder
    figures = {path.name: path.read_bytes() for path in write_run_figures(run_dir, tmp_path / "a")}
    assert read(run_dir) == first
    assert {path.name: path.read_bytes() for path in write_run_figures(run_dir, tmp_path / "b")} == figures
    assert [path for path in run_dir.rglob("*") if path.name.startswith(".")] == []


def test_page_is_small(shown: Shown) -> None:
    assert len(shown.text) - len(packed_viewer()) < LARGEST


@pytest.mark.slow
def test_text_from_files_is_escaped(run_dir: Path, edit: Callable[..., None]) -> None:
    evil = "<script>alert(1)</script><img src=x onerror=alert(2)> & \"'"
    found = json.loads((run_dir / "result.json").read_text())
    checks = [{**check, "name": evil, "kind": evil} for check in found["checks"]]
    z = {evil: {**found["z"]["throw"], "sets": [evil]}}
    edit(
        run_dir / "result.json",
        title=evil,
        advice=evil,
        checks=checks,
        z=z,
        command=evil,
        backend={"name": evil, "note": evil},
    )
    (run_dir / "log.txt").write_text("</pre>" + evil)
    (run_dir / "problem.toml").write_text(f'description = """{evil}"""')
    with np.load(run_dir / "trajectory.npz") as archive:
        arrays = dict(archive) | {"body_names": np.array([evil]), "contact_names": np.array([evil])}
    np.savez(run_dir / "trajectory.npz", **arrays)
    text = read(run_dir)
    assert evil not in text
    assert "<script>alert" not in text
    assert Page(text).tags.count("script") == text.count('class="packed"') + 1
    assert "onerror" not in re.sub(r"&lt;.*?&gt;", "", text)
    drawn = [path for path in write_run_figures(run_dir, run_dir / "figures") if path.suffix == ".svg"]
    assert drawn and all("<script" not in path.read_text(encoding="utf-8") for path in drawn)


@pytest.mark.slow
@few("text", ["$\\frac{$", "球 \N{ROCKET}", "\x00\x1b\ud800", "a" * 5000, ""], 1)
def test_any_name_can_be_drawn(run_dir: Path, edit: Callable[..., None], text: str) -> None:
    found = json.loads((run_dir / "result.json").read_text())
    edit(run_dir / "result.json", title=text, solver=text, checks=[{**c, "name": text} for c in found["checks"]])
    assert "Targets and constraints" in read(run_dir)
    assert write_run_figures(run_dir, run_dir / "figures")


@pytest.mark.slow
@pytest.mark.parametrize("name", OPTIONAL)
def test_any_file_but_the_result_may_be_missing(run_dir: Path, name: str) -> None:
    (run_dir / name).unlink()
    text = read(run_dir)
    assert "All 3 checks are met" in text
    assert ("<canvas" in text) == (name != "trajectory.npz")


@pytest.mark.parametrize("content", [b"", b"\x00\xffjunk", b"[1, 2", b"PK\x03\x04 half an archive", ONE_ARRAY])
def test_every_file_but_the_result_may_be_broken(run_dir: Path, content: bytes) -> None:
    for name in OPTIONAL:
        (run_dir / name).write_bytes(content)
    text = read(run_dir)
    assert "All 3 checks are met" in text
    assert "trajectory.npz: not an archive of plain arrays" in text


def test_run_without_motion_says_so(batch: Path) -> None:
    text = Page(read(batch / "ball_throw" / "ipopt-seed0")).text
    assert "Not solved" in text
    assert "not a finite number" in text
    assert "start from a slower throw" in text
    assert "This run recorded no motion." in text
    assert "trajectory.npz: there is no such file" in text
    assert NOT_EXAMINED in text


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"status": "budget", "solved": False}, "The run did not end as solved"),
        ({"status": "interrupted", "solved": False}, "goes on from where it stopped"),
        ({"status": "not_applicable", "solved": False}, "does not apply"),
        ({"checks": []}, "has no targets or constraints"),
        ({"checks": None, "objective": None, "status": "failed", "solved": False}, "There is nothing to judge."),
        ({"objective": None, "counts": None, "seconds": None, "trust": None, "z": None, "price": None}, "Solved"),
        ({"objective": "inf", "equivalents": "nan", "z": [], "checks": "none"}, "∞"),
        ({"trust": {"refined": [{"what": "dt / 2", "objective": 1.0, "worst": 7.0}]}}, "A tolerance is missed by far"),
        ({"trust": {"gradient": [{"variable": "throw", "error": 0.3, "scale": 1.0}]}}, "Does not agree"),
        ({"trust": {"gradient": [{"variable": "throw", "error": 0.3, "scale": 1e-9}]}}, "says little"),
        ({"trust": {"deepest": 0.2, "size": 0.1}}, "Met, but not to be trusted"),
        ({"trust": {"passed": 1.6, "passed_at": {"contact": "a-b", "time": 1}}}, "a body goes through another: a-b"),
        ({"verdict": "doubted", "doubts": ["it flies"], "solved": False}, "But it is not to be relied on: it flies."),
        ({"checks": [], "status": "budget"}, "Best found, budget ended"),
        ({"checks": [], "status": "stalled"}, "Best found, no more progress"),
        ({"checks": [], "status": "converged"}, "Solved"),
        ({"trust": {"deepest": 0.0, "size": 0.1}}, "Only the motion was examined."),
        ({"format": 2}, "this report reads 1"),
    ],
)
def test_every_result_has_its_words(
    run_dir: Path, edit: Callable[..., None], fields: dict[str, object], words: str
) -> None:
    edit(run_dir / "result.json", **fields)
    assert words in Page(read(without_motion(run_dir))).text


@pytest.mark.parametrize("content", ["", "{", "[]", "{}", "null", '{"solver": 1}', "[" * 100_000, "1" * 5000])
def test_broken_result_is_named(run_dir: Path, content: str) -> None:
    (run_dir / "result.json").write_text(content)
    text = Page(read(without_motion(run_dir))).text
    assert "No result could be read" in text
    assert "result.json" in text


def test_motion_is_drawn_up_to_the_first_bad_state(run_dir: Path) -> None:
    with np.load(run_dir / "trajectory.npz") as archive:
        arrays = dict(archive)
    arrays["position"][100:] = np.nan
    np.savez(run_dir / "trajectory.npz", **arrays)
    (played,) = held(read(run_dir), 'class="animation">')
    assert played["time"][-1] == pytest.approx(0.99)


def test_components_are_named_as_in_the_problem_file(run_dir: Path, edit: Callable[..., None]) -> None:
    found = json.loads((run_dir / "result.json").read_text())
    throw = {**found["z"]["throw"], "shape": [2, 1], "value": [4, 3], "guess": [0, 0], "lower": [], "upper": []}
    edit(run_dir / "result.json", z={"throw": throw})
    (run_dir / "problem.toml").write_text('[[variable]]\nname = "throw"\nsets = "ball.velocity[0:3:2]"\n')
    assert "throw 0 ball.velocity[0:3:2]" in Page(read(without_motion(run_dir))).text
    (run_dir / "problem.toml").write_text('[[variable]]\nname = "throw"\nsets = ["ball.velocity[1:]"]\n')
    text = re.sub(r"\s+", " ", Page(write_run_report(run_dir).read_text(encoding="utf-8")).text)
    assert "throw y ball.velocity[1:]" in text
    (run_dir / "problem.toml").write_text('[[variable]]\nname = "throw"\nsets = ["a.velocity[1:]", "b.velocity[1:]"]\n')
    text = re.sub(r"\s+", " ", Page(write_run_report(run_dir).read_text(encoding="utf-8")).text)
    assert "throw y a.velocity[1:] and b.velocity[1:], to the same values" in text


@pytest.mark.slow
def test_energy_is_drawn_where_it_was_recorded(run_dir: Path, edit: Callable[..., None]) -> None:
    times = [0.0, 1.0, 2.0]
    energy = dict.fromkeys(("time", "kinetic", "potential", "applied", "contact"), times)
    edit(run_dir / "result.json", trust={"energy": energy, "gained": 0.0, "growth": {"time": times, "factor": times}})
    text = read(run_dir)
    assert {"energy", "growth"} <= set(charts(text))
    assert "Angular momentum is not checked" in Page(text).text


@few("entry", [[1, 2], {"time": [0, 1]}, {"time": [0], "factor": ["nan"]}, "text", None], 3)
def test_what_cannot_be_drawn_is_left_out(run_dir: Path, edit: Callable[..., None], entry: object) -> None:
    edit(run_dir / "result.json", trust={"energy": entry, "growth": entry, "gains": entry, "slides": entry})
    for name in ("trajectory.npz", "guess.npz"):
        (run_dir / name).unlink()
    assert not {"energy", "growth"} & set(charts(read(run_dir)))


def test_pickled_arrays_are_refused(run_dir: Path) -> None:
    np.savez(run_dir / "trajectory.npz", time=np.array([{"a": 1}], dtype=object), position=np.zeros((1, 1, 3)))
    assert "not an archive of plain arrays" in read(run_dir)


def test_script_that_runs_is_the_one_that_the_page_allows(shown: Shown) -> None:
    text = shown.text
    assert text.count("sha256-") == 3
    assert "script-src &#x27;sha256-" in text
    assert "unsafe-eval" not in text


def test_folder_that_is_no_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ReportError, match="no run folder"):
        write_run_report(tmp_path)
    with pytest.raises(ReportError, match="no such folder"):
        write_run_report(tmp_path / "nowhere")


def test_a_page_leads_to_that_of_all_runs_where_there_is_one(batch: Path) -> None:
    folder = batch / "ball_throw" / "gradient-seed0"
    assert "all runs" not in write_run_report(folder).read_text("utf-8")
    (batch / ".runs.jsonl").touch()
    assert '<a href="../../index.html">all runs</a>' in write_run_report(folder).read_text("utf-8")


def test_a_solver_that_never_moved_is_not_said_to_have_converged(run_dir: Path, edit: Callable[..., None]) -> None:
    check = {"kind": "target", "name": "there", "error": 1.0, "tolerance": 0.01, "met": False}
    none = [{"variable": "push", "error": 0.0, "scale": 0.0, "felt": 0.0}]
    edit(run_dir / "result.json", solved=False, status="converged", iterations=0, checks=[check])
    text = write_run_report(run_dir).read_text("utf-8")
    assert "The solver converged." in text
    edit(run_dir / "result.json", trust={"gradient": none})
    text = write_run_report(run_dir).read_text("utf-8")
    assert "The gradient is zero at the guess, so the solver had nowhere to go." in text


def test_descriptions_may_be_markdown_and_stay_harmless(run_dir: Path) -> None:
    text = 'title = "x"\ndescription = """\nA *fast* `throw`:\n\n- one\n\n<script>alert(1)</script> ![x](http://a/b.png)"""\n'
    (run_dir / "problem.toml").write_text(text, "utf-8")
    page = write_run_report(run_dir).read_text("utf-8")
    assert "<em>fast</em> <code>throw</code>" in page and "<li>one</li>" in page
    assert "<script>alert" not in page and "<img" not in page
