"""cache, doctor and export say what they do, write what they say, and exit with 0, 1 or 2."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from fakes.compilers import fake
from tools.repeats import few

from symphys import machine
from symphys.codegen import KernelUnavailable
from symphys.codegen.graph.graph import library
from symphys.codegen.toolchain.compiler import find_compiler

Run = Callable[..., tuple[int, str, str]]
Patch = pytest.MonkeyPatch


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: Patch) -> Path:
    monkeypatch.setenv("SYMPHYS_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def lines(out: str) -> dict[str, tuple[str, str]]:
    """Name -> (state, text) of doctor's lines."""
    return {line[9:27].strip(): (line[:8].strip(), line[28:]) for line in out.splitlines()}


def test_cache_info_and_clear(run: Run, cache: Path) -> None:
    code, out, _ = run("cache", "info")
    assert code == 0
    assert out.splitlines()[:3] == [f"folder   {cache} (not made yet)", "kernels  0", "size     0 bytes"]
    cache.mkdir()
    for i, size in enumerate((1_500_000, 3_000)):
        (cache / f"{i}-{i}.so").write_bytes(bytes(size))
    _, out, _ = run("cache", "info")
    assert out.splitlines()[:3] == [f"folder   {cache}", "kernels  2", "size     1.5 MB"]
    assert "limit    536.9 MB" in out
    code, out, _ = run("cache", "clear")
    assert code == 0
    assert out == f"removed 2 of 2 kernels, 1.5 MB, from {cache}\n"
    assert list(cache.iterdir()) == []


@pytest.mark.skipif(sys.platform == "win32", reason="folders have no group there")
def test_cache_info_says_why_a_cache_is_not_used(run: Run, cache: Path) -> None:
    cache.mkdir()
    cache.chmod(0o770)
    assert "unused   others may write to the folder" in run("cache", "info")[1]


def test_a_kernel_that_cannot_be_removed(run: Run, cache: Path) -> None:
    (cache / "in-use.so").mkdir(parents=True)
    code, out, err = run("cache", "clear")
    assert code == 1
    assert "removed 0 of 1 kernels" in out
    assert "1 cannot be removed" in err


@pytest.fixture(scope="module")
def own_library() -> None:
    """The library that makes graphs, in the user's cache, before a test has another."""
    with suppress(KernelUnavailable):
        library()


@pytest.mark.usefixtures("own_library")
def test_doctor_tries_everything(run: Run, cache: Path) -> None:
    try:
        find_compiler()
    except KernelUnavailable as error:
        pytest.skip(str(error))
    code, out, _ = run("doctor")
    assert code == 0
    found = lines(out)
    assert found.pop("gpu")[0] in ("ok", "missing")
    assert [state for state, _ in found.values()] == ["ok"] * 12
    assert found["kernel, values"][1] == "those of casadi, to the bit"
    assert found["cache"][1] == f"{cache}, writable"
    assert f"casadi {ca.CasadiMeta.version()}" in found["packages"][1]
    assert list(cache.iterdir()) == []  # the tiny kernel went into a cache of its own


def test_without_a_compiler_all_that_is_needed_works(run: Run, cache: Path, monkeypatch: Patch) -> None:
    monkeypatch.setenv("PATH", str(cache))
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    code, out, _ = run("doctor")
    assert code == 0
    state, text = lines(out)["compiler"]
    assert state == "missing"
    assert "install gcc" in text and "pip install ziglang" in text and "works without it" in text
    assert lines(out)["kernels"][0] == "missing"


def test_a_compiler_that_fails_is_named(run: Run, cache: Path, tmp_path: Path, monkeypatch: Patch) -> None:
    monkeypatch.setenv("CC", fake(tmp_path, "echo 'error: no header' >&2; exit 1"))
    code, out, _ = run("doctor")
    assert code == 0
    state, text = lines(out)["kernel, compiled"]
    assert state == "failed"
    assert "fakecc failed with code 1: error: no header; symphys works without it" in text


def test_a_cache_that_cannot_be_written_is_named(run: Run, tmp_path: Path, monkeypatch: Patch) -> None:
    (tmp_path / "file").write_text("in the way", "utf-8")
    monkeypatch.setenv("SYMPHYS_CACHE", str(tmp_path / "file" / "cache"))
    code, out, _ = run("doctor")
    state, text = lines(out)["cache"]
    assert (code, state) == (0, "failed")
    assert "set SYMPHYS_CACHE to another folder" in text


@few(("what", "line"), [("interpret", "kernel, values"), ("ca.has_nlpsol", "ipopt")], 1)
def test_what_is_needed_and_does_not_work_exits_1(
    run: Run, cache: Path, monkeypatch: Patch, what: str, line: str
) -> None:
    wrong = {"interpret": lambda *_: {"cost": np.array([3.0])}, "ca.has_nlpsol": lambda _: False}
    monkeypatch.setattr(f"symphys.machine.{what}", wrong[what])
    code, out, _ = run("doctor")
    if line in lines(out):  # there may be no compiler
        assert code == 1
        assert lines(out)[line][0] != "ok"


def test_a_package_that_is_not_there(monkeypatch: Patch) -> None:
    monkeypatch.setattr(machine, "PACKAGES", ("numpy", "no-such-package"))
    found = next(finding for finding in machine.examine() if finding.name == "packages")
    assert (found.state, found.required) == ("missing", True)
    assert "pip install no-such-package" in found.text


@pytest.mark.slow
def test_export_writes_both(run: Run, throw: Path) -> None:
    code, out, _ = run("export", throw, "--c", "c", "--casadi", "functions", "--set", "simulation.duration=0.4")
    assert code == 0
    assert [Path(line) for line in out.splitlines()[:2]] == [Path("c/throw.h"), Path("c/throw.c")]
    assert "#define THROW_STEPS 20\n" in Path("c/throw.h").read_text("utf-8")
    assert ca.Function.load("functions/gradient.casadi").name_in() == ["z", "smoothing"]
    for folder in ("c", Path("c").resolve()):  # one folder for both, under two names
        assert run("export", throw, "--c", "c", "--casadi", folder, "--set", "simulation.dt=0.01")[0] == 0
        assert run("export", throw, "--c", "c", "--casadi", folder)[0] == 0
    assert Path("c/README.txt").is_file()


@few(
    ("arguments", "words"),
    [
        (["ball_throw"], "--c DIR, --casadi DIR or --mjcf DIR"),
        (["ball_thorw", "--c", "there"], "ball_throw"),
        (["ball_throw", "--c", "there", "--set", "simulation.td=1"], "dt"),
        (["ball_throw", "--c", "/dev/null/there"], "/dev/null"),
        (["ball_throw", "--c", "here"], "here/ball_throw.c was not written by symphys"),
        (["ball_throw", "--casadi", "there", "--c", "here"], "here/ball_throw.c was not written by symphys"),
    ],
    3,
)
def test_what_cannot_be_exported(run: Run, arguments: list[str], words: str) -> None:
    Path("here").mkdir()
    Path("here/ball_throw.c").write_text("mine", "utf-8")
    code, out, err = run("export", *arguments)
    assert (code, out) == (2, "")
    assert words in err
    assert not Path("there").exists()
    assert [path.name for path in Path("here").iterdir()] == ["ball_throw.c"]


def test_export_writes_a_model_of_a_problem_without_variables(run: Run, throw: Path) -> None:
    text = throw.read_text("utf-8")
    throw.write_text(text[: text.index("[[variable]]")], "utf-8")
    code, out, _ = run("export", throw, "--mjcf", "models")
    assert (code, out) == (0, "models/throw.xml\n")
    assert '<mujoco model="throw">' in Path("models/throw.xml").read_text("utf-8")
    code, out, err = run("export", throw, "--mjcf", "there", "--set", "ground.restitution=0.5")
    assert (code, out) == (2, "")
    assert "throw: MJCF cannot say this: ball-ground: restitution" in err
    assert not Path("there").exists()
    code, out, err = run("export", throw, "--mjcf", "there", "--set", "ground.restitution=0.5", "--approximate")
    assert (code, out) == (0, "there/throw.xml\n")
    assert "left out: ball-ground: restitution" in err
    assert "<!-- left out: ball-ground: restitution" in Path("there/throw.xml").read_text("utf-8")


def test_a_problem_without_variables_cannot_be_exported(run: Run, throw: Path) -> None:
    text = throw.read_text("utf-8")
    throw.write_text(text[: text.index("[[variable]]")] + text[text.index("[[target]]") :], "utf-8")
    code, _, err = run("export", throw, "--c", "there")
    assert code == 2
    assert "variable" in err
