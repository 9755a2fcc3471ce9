"""An option that cannot be is refused before the solve, by a message that names it and what would be valid."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from pydantic import TypeAdapter, ValidationError
from tools.repeats import few
from worlds.toys import quadratic, rosenbrock, solve

from symphys.errors import ProblemError, SymphysError
from symphys.problem import json_schema, validate_options
from symphys.solvers import SOLVERS, Status, StochasticOptions, recorded_options, solver

every_solver = pytest.mark.parametrize("name", list(SOLVERS))


def test_names() -> None:
    assert list(SOLVERS) == [
        "gradient",
        "least_squares",
        "ipopt",
        "ilqr",
        "multiple_shooting",
        "cma",
        "stochastic",
        "evolution",
        "race",
    ]
    for name in SOLVERS:
        assert solver(name).name == name
    with pytest.raises(SymphysError, match=r"'gradient'.*cma, stochastic, evolution, race"):
        solver("gradent")
    with pytest.raises(SymphysError, match="gradient"):
        solver("xyz")


@every_solver
def test_options_are_documented_and_have_defaults(name: str) -> None:
    kind = solver(name).Options
    text = "".join(str(each.__doc__) for each in kind.__mro__)
    assert all(field.name in text for field in fields(kind()))


@every_solver
def test_a_table_of_a_problem_file_is_validated(name: str) -> None:
    adapter = TypeAdapter(solver(name).Options)
    budget = {"cma": "evaluations", "race": "rounds"}.get(name, "iterations")
    assert getattr(adapter.validate_python({budget: 7}), budget) == 7
    for bad in ({"smoothng": 1}, {budget: "x"}, {"iterations": -1}, {"evaluations": -1}):
        with pytest.raises(ValidationError):
            adapter.validate_python(bad)


@pytest.mark.parametrize(
    ("name", "bad", "message"),
    [
        ("gradient", {"method": "newton"}, "method must be one of spectral"),
        ("gradient", {"rates": (1.0, 0.0), "method": "adam"}, "rates must be positive"),
        ("gradient", {"rates": (1.0, 0.5)}, "rates must be one number"),
        ("gradient", {"betas": (0.5, 1.0)}, "betas"),
        ("gradient", {"clip": 0.0}, "clip"),
        ("gradient", {"tolerance": float("nan")}, "tolerance must be at least 0"),
        ("least_squares", {"damping": 0.0}, "damping"),
        ("ipopt", {"hessian": "none"}, "hessian must be limited-memory or exact"),
        ("cma", {"sigma": -1.0}, "sigma"),
        ("cma", {"population": 2}, "population"),
    ],
)
def test_values_that_cannot_be(name: str, bad: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        solver(name).Options(**bad)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"nonsense": 1}, "options.nonsense: .*no such option"),
        ({"mu_strategy": "foo"}, "options.mu_strategy: .*adaptive"),
        ({"acceptable_tol": -1.0}, "options.acceptable_tol"),
        ({"mu_strategy": "adaptive", "acceptable_iter": "many"}, "options.acceptable_iter: .*wrong type"),
        ({"linear_solver": "ma27"}, "options.linear_solver: .*not available"),
        ({"max_iter": 3}, "options.max_iter: .*use iterations"),
        ({"output_file": "x.txt"}, "options.output_file"),
        ({"hsllib": "/x.so"}, "options.hsllib: .*no library"),
    ],
)
def test_ipopt_options_that_cannot_be(options: dict[str, Any], message: str, capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SymphysError, match=f"solver.ipopt.{message}"):
        solve("ipopt", quadratic(), options={"options": options})
    assert capfd.readouterr() == ("", "")


def test_ipopt_options_reach_it() -> None:
    lines: list[str] = []
    options = {"options": {"mu_strategy": "adaptive", "print_user_options": "yes"}}
    solve("ipopt", quadratic(), options=options, log=lines.append)
    assert any("mu_strategy = adaptive" in line for line in lines)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"tolfum": 1}, "options.tolfum: pycma has no such option; did you mean 'tolfun'"),
        ({"tolfun": "__import__('os').getpid()"}, "options.tolfun: valid are numbers"),
        ({"CMA_stds": [1, "2"]}, "options.CMA_stds: valid are numbers"),
        ({"CMA_sampler": {"a": 1}}, "options.CMA_sampler: valid are numbers"),
        ({"BoundaryHandler": "os.getpid"}, "options.BoundaryHandler: valid are BoundTransform or BoundPenalty"),
        ({"seed": 3}, "options.seed: .*seed of the solve"),
        ({"verb_log": 1}, "options.verb_log"),
        ({"popsize": 9}, "options.popsize: .*use population"),
    ],
)
def test_cma_options_that_cannot_be(options: dict[str, Any], message: str) -> None:
    with pytest.raises(SymphysError, match=f"solver.cma.{message}"):
        solve("cma", quadratic(), options={"options": options})


def test_cma_options_reach_it() -> None:
    found = solve("cma", rosenbrock(), options={"options": {"maxiter": 4}})
    assert (found.status, len(found.trace)) == (Status.BUDGET, 5)
    bounded = quadratic(bounds=(-1.0, 1.5))
    found = solve("cma", bounded, options={"options": {"BoundaryHandler": "BoundPenalty"}})
    assert found.z == pytest.approx([1, 1.5, 1.5], abs=1e-3)


def test_what_pycma_cannot_use_is_a_failure() -> None:
    found = solve("cma", quadratic(), options={"options": {"CMA_stds": [1, 2, 3, 4, 5]}})
    assert found.status is Status.FAILED
    assert "pycma" in found.advice


def test_options_of_descent_act() -> None:
    free, clipped = (
        solve("gradient", quadratic(), options={"clip": clip, "method": "gradient", "rates": (0.05,), "iterations": 1})
        for clip in (1e9, 1.0)
    )
    assert free.trace[1].step > clipped.trace[1].step == pytest.approx(0.05)
    first = solve("gradient", quadratic(), options={"rates": (0.5,), "iterations": 1})
    assert first.trace[1].step == pytest.approx(0.5)
    greedy = solve("gradient", rosenbrock(), options={"backtracking": 0, "method": "gradient", "rates": (1e-4,)})
    assert greedy.counts.rollouts == 0


def test_rates_share_the_iterations() -> None:
    options = {"method": "adam", "rates": (0.5, 0.05), "iterations": 4, "backtracking": 0, "betas": (0.0, 0.0)}
    found = solve("gradient", quadratic(guess=0.1), options=options)
    assert [row.step for row in found.trace[1:]] == pytest.approx([0.5 * 3**0.5] * 2 + [0.05 * 3**0.5] * 2, rel=1e-6)


@pytest.mark.slow
def test_pycma_is_loaded_by_prepare_and_not_before() -> None:
    tell = "'cma' in sys.modules"
    code = f"import sys; from symphys.solvers import solver; print({tell}); solver('cma').prepare(); print({tell})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True"]


LOADING = """
import sys, symphys
from symphys.solvers import solver
from symphys.transcription import transcribe
shooting, chosen = transcribe(symphys.load("ball_throw"), backend="casadi").shooting, solver(sys.argv[1])
chosen.prepare()
before = set(sys.modules)
chosen.solve(shooting, shooting.start(0), chosen.Options(), 0)
print(*(name for name in set(sys.modules) - before if name.partition(".")[0] in ("cma", "scipy")))
"""


@few("name", ["least_squares", "cma"], 1)
def test_libraries_are_loaded_before_the_clock_of_a_solve_starts(name: str) -> None:
    done = subprocess.run([sys.executable, "-c", LOADING, name], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []


@every_solver
def test_prepared_twice_is_no_different(name: str) -> None:
    solver(name).prepare()
    solver(name).prepare()


def test_imported_by_another_name_says_so(tmp_path: Path) -> None:
    folder = Path(sys.modules["symphys.solvers"].__file__ or "").resolve().parent
    done = subprocess.run(
        [sys.executable, "-c", f"import {folder.name}"], capture_output=True, text=True, cwd=folder.parent, check=False
    )
    assert done.returncode == 1
    assert "installs as symphys.solvers" in done.stderr


def test_an_old_name_of_an_option_is_still_read() -> None:
    """And marked as deprecated in the schema; what is recorded keeps the first name, and so does the key of a run."""
    read = partial(validate_options, SOLVERS["stochastic"].Options, file="file.toml", where="solver.stochastic")
    assert (
        read(table={"forget": 5.0}) == read(table={"adjoint_discount": 5.0}) == StochasticOptions(adjoint_discount=5.0)
    )
    assert recorded_options(StochasticOptions(adjoint_discount=5.0))["forget"] == 5.0
    with pytest.raises(ProblemError, match=r"forget: .*adjoint_discount"):
        read(table={"forget": 5.0, "adjoint_discount": 5.0})
    with pytest.raises(ProblemError, match="adjoint_discount"):
        read(table={"forget": -1.0})
    schema = json.dumps(json_schema({"stochastic": StochasticOptions}))
    assert re.search(r'"forget": \{[^{}]*"deprecated": true', schema)
    assert not re.search(r'"adjoint_discount": \{[^{}]*"deprecated"', schema)
