"""Kernels do not depend on how far a compiler optimises: all that may be rounded otherwise is written out in C."""

from __future__ import annotations

from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from tools.repeats import thorough
from worlds import programs
from worlds.toys import require

import symphys
from symphys.codegen import Cache, Program, compile_program
from symphys.codegen.emit.form import Form
from symphys.codegen.emit.writer import write
from symphys.codegen.graph.instructions import graph_of
from symphys.codegen.toolchain import compiler
from symphys.transcription import rollout_program
from symphys.transcription.rollout import symbolic_rollout

PLAIN, ADJOINT = Form(primal=3, adds=True), Form(primal=3, adds=True, backward=True)


def robot() -> Program:
    return rollout_program(symbolic_rollout(symphys.load("cart_pole")), exact=True)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "rows"), [("chain", 9), ("chain", 1), thorough("robot", 1), thorough("robot", 9)])
def test_values_and_gradients_do_not_depend_on_the_level(
    name: str, rows: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    require("simd")
    program = robot() if name == "robot" else programs.chain()
    Z = np.random.default_rng(1).normal(size=(rows, program.z.size))
    seed, given = np.ones(sum(place.size for place in program.outputs.values())), np.zeros(program.parameters.size)
    found = []
    for level in ("-O0", "-O1", "-Og", "-O2"):
        monkeypatch.setenv("SYMPHYS_CFLAGS", level)
        monkeypatch.setattr(compiler, "STRAIGHT", () if level == "-O1" else compiler.STRAIGHT)
        kernel = compile_program(program, cache=Cache(tmp_path / level), threads=1, rows=rows)
        assert kernel.report.flags[-1] == level
        found.append(kernel.gradient(Z, seed, given))
        monkeypatch.undo()
    for outputs, gradient in found[:-1]:
        np.testing.assert_array_equal(gradient, found[-1][1])
        for output, values in outputs.items():
            np.testing.assert_array_equal(values, found[-1][0][output])


def test_products_that_are_only_added_are_fused_in_adjoints() -> None:
    x, y, z = ca.SX.sym("x"), ca.SX.sym("y"), ca.SX.sym("z")
    results = [x * y + z, z - x * z, ca.sin(y * y) - y * y, y * z]
    graph = graph_of(ca.Function("f", [x, y, z], results))
    adjoint = write("f", graph, ADJOINT)
    assert "FMA" not in write("f", graph, PLAIN)  # values are casadi's
    assert adjoint.count("FMA(") == 3  # not of the square, which its sine reads
    assert "o3[0] = FMA(" in adjoint
    kinds = [node.op for node in graph.fused(adds=True).nodes]
    assert (kinds.count("fma"), kinds.count("fnma"), kinds.count("fms")) == (1, 1, 0)
    assert "o3[0] = v" in write("f", graph, Form(primal=3, adds=False, backward=True))
