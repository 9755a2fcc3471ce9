"""Exported C compiles as plain C without a warning, and gives the numbers of Python."""

from __future__ import annotations

import ctypes
import subprocess
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tools.repeats import few

from symphys.codegen import KernelUnavailable
from symphys.codegen.toolchain.compiler import find_compiler
from symphys.export import c_files, write_folders
from symphys.export.sources import identifier, slopes_function, string
from symphys.problem import load_problem
from symphys.problems import find
from symphys.transcription import Transcription, transcribe
from symphys.transcription.staged.linearization import Linearization
from symphys.transcription.staged.step_program import StepArguments
from symphys.transcription.staged.tangent import Tangent

NAME = "problem_1st_kick_u"
STRICT = ("-O2", "-Wall", "-pedantic", "-Werror")
CLOSE: dict[str, Any] = {"rel": 1e-12, "abs": 1e-12}


def compile_c(*arguments: str | Path) -> None:
    try:
        compiler = find_compiler()
    except KernelUnavailable as error:
        pytest.skip(str(error))
    command = [*compiler.command, *map(str, arguments), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.fixture(scope="module")
def folder(kick: Transcription, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = Path(tmp_path_factory.mktemp("c"))
    write_folders({path: c_files(kick, "1.2")})
    return path


@pytest.fixture(scope="module")
def library(folder: Path) -> Any:
    sources = [folder / f"{NAME}.c", folder / f"{NAME}_linearize.c"]
    compile_c("-std=c11", *STRICT, "-fPIC", "-shared", *sources, "-o", folder / "library.so")
    return ctypes.CDLL(str(folder / "library.so"))


def example(folder: Path, name: str, *z: float) -> dict[str, float]:
    """What the example prints, by the words before the number."""
    done = subprocess.run([folder / "example", *map(repr, z)], capture_output=True, text=True, check=True)
    return {line.rpartition(" ")[0].rstrip(":"): float(line.rpartition(" ")[2]) for line in done.stdout.splitlines()}


@pytest.mark.slow
@few("problem", ["kick", "ball_throw"], 1)
def test_the_example_prints_the_numbers_of_python(problem: str, kick: Transcription, tmp_path: Path) -> None:
    one = kick if problem == "kick" else transcribe(load_problem(find(problem)), backend="casadi")
    name = identifier(one.problem.name)
    write_folders({tmp_path: c_files(one, "1.2")})
    sources = [tmp_path / f"{name}.c", tmp_path / f"{name}_main.c"]
    compile_c("-std=c99", *STRICT, *sources, "-o", tmp_path / "example")
    for z in ([], one.shooting.start(1).tolist()):
        printed = example(tmp_path, name, *z)
        merit, objective, errors, slope, _ = (
            np.array(part).ravel() for part in one.functions.gradient(z or one.shooting.start(0), 0.0)
        )
        assert printed["merit"] == pytest.approx(merit[0], **CLOSE)
        assert printed["objective"] == pytest.approx(objective[0], **CLOSE)
        found = [printed[f"target {target.name}"] for target in one.problem.targets]
        assert found == pytest.approx(errors[: len(found)].tolist(), **CLOSE)
        gradient = np.array([printed[f"gradient[{i}]"] for i in range(len(slope))])
        np.testing.assert_allclose(gradient, slope, rtol=0, atol=1e-12 * np.abs(slope).max())


@pytest.mark.slow
def test_the_example_refuses_what_is_no_z(folder: Path) -> None:
    compile_c("-std=c99", folder / f"{NAME}.c", folder / f"{NAME}_main.c", "-o", folder / "example")
    for words in (["1"], ["1", "2", "3", "4", "5", "6", "x"], [""] * 7):
        done = subprocess.run([folder / "example", *words], capture_output=True, text=True, check=False)
        assert done.returncode == 2
        assert "7 numbers" in done.stderr


@pytest.mark.slow
def test_steps_from_the_start_are_the_rollout(kick: Transcription, folder: Path, library: Any) -> None:
    define = defined(folder)
    z, (nx, nu, steps) = kick.shooting.start(1), (define[key] for key in ("X", "U", "STEPS"))
    states, inputs = np.empty((steps + 1, nx)), np.empty((steps, nu))
    x, p, work, result = np.empty(nx), np.empty(define["P"]), np.empty(define["WORK"]), np.empty(1000)
    function(library, "start")(*pointers(z, x, inputs, p, work))
    function(library, "rollout")(*pointers(z), ctypes.c_double(0), *pointers(result, states, work))
    np.testing.assert_array_equal(states[0], x)
    for u, after in zip(inputs, states[1:], strict=True):
        function(library, "step")(*pointers(x, u, p), ctypes.c_double(0), *pointers(x, work))
        np.testing.assert_allclose(x, after, rtol=1e-13, atol=1e-13)
    motion = kick.simulate(z)
    np.testing.assert_allclose(states[:, :3], motion.position[:, 0], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(inputs[:, :3], motion.force[:, 0], rtol=1e-12, atol=1e-12)
    assert p[0] == z[-1]


@pytest.mark.slow
def test_slopes_of_a_step_are_those_of_casadi(kick: Transcription, folder: Path, library: Any) -> None:
    define = defined(folder)
    nt, nu, np_ = (define[key] for key in ("T", "U", "P"))
    z = kick.shooting.start(1)
    motion, p = Linearization(kick.rollout, backend="casadi").motion(z, 0.0), np.array([z[-1]])
    one = slopes_function(StepArguments(kick.rollout, Tangent(kick.rollout)))
    after, work = np.empty(define["X"]), np.full(define["WORK"], np.nan)
    a, b, c = np.empty((nt, nt)), np.empty((nt, nu)), np.empty((nt, np_))
    x, u = np.ascontiguousarray(motion.x[5]), np.ascontiguousarray(motion.u[5])
    function(library, "linearize")(*pointers(x, u, p), ctypes.c_double(0.01), *pointers(after, a, b, c, work))
    for ours, theirs in zip((after[:, None], a, b, c), one(x, u, p, 0.01), strict=True):
        np.testing.assert_allclose(ours, np.array(theirs), rtol=1e-11, atol=1e-11)
    assert np.abs(c).max() > 1e-3


@pytest.mark.slow
def test_two_threads_do_not_disturb_each_other(kick: Transcription, folder: Path, library: Any) -> None:
    define = defined(folder)

    def gradient(seed: int) -> Any:
        result, slope, work = np.empty(1000), np.empty(define["Z"]), np.empty(define["WORK"])
        for _ in range(50):
            arguments = (*pointers(kick.shooting.start(seed)), ctypes.c_double(0), *pointers(result, slope, work))
            function(library, "gradient")(*arguments)
        return slope

    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(gradient, (1, 2)))
    np.testing.assert_array_equal(together, [gradient(1), gradient(2)])


@pytest.mark.slow
def test_no_other_name_is_exported(library: Any, folder: Path) -> None:
    assert library.problem_1st_kick_u_step
    for name in ("step", "evaluate", "run", "f0", "PROGRAM"):
        assert not hasattr(library, name)


def test_the_header_says_what_the_numbers_are(folder: Path) -> None:
    header = (folder / f"{NAME}.h").read_text("utf-8")
    for line in (
        "z[0..5]            push: ball.force[0,1] [N]; 3 knots, constant, one after the other",
        "z[6]               mass: ball.mass [kg]",
        "x[0..2]            ball.position [m]",
        "p[0]               ball.mass [kg]",
        "errors[1]          constraint speed",
        "constraints[0..19] speed",
    ):
        assert line in header


@pytest.mark.parametrize(
    ("name", "begins"),
    [
        ("throw", "throw"),
        ("2 balls", "problem_2_balls"),
        ("a-b", "a_b"),
        ("été", "ete"),
        ("___", "problem"),
        ("球", "problem"),
    ],
)
def test_names_are_those_of_c(name: str, begins: str) -> None:
    assert identifier(name) == begins


def test_text_is_that_of_c() -> None:
    assert string('a "b" \\ ??/ ü\n') == r'"a \042b\042 \134 \077\077/ \303\274\012"'


def defined(folder: Path) -> dict[str, int]:
    """The sizes that the header defines."""
    lines = (folder / f"{NAME}.h").read_text("utf-8").splitlines()
    words = [line.split() for line in lines if line.startswith(f"#define {NAME.upper()}_")]
    return {word[1].removeprefix(f"{NAME.upper()}_"): int(word[2]) for word in words if len(word) > 2}


def function(library: Any, name: str) -> Any:
    return getattr(library, f"{NAME}_{name}")


def pointers(*arrays: Any) -> list[Any]:
    return [array.ctypes.data_as(ctypes.c_void_p) for array in arrays]
