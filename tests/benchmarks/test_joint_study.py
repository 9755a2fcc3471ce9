"""The study of joints on a tiny size: its measures tell the switches apart."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from joint_figure import joint_figure
from joint_study import Run, Study, curves, drift, parted, report
from joint_worlds import falling_chain, lowest, parallelograms, swinging

from symphys.codegen import KernelUnavailable
from symphys.codegen.toolchain.compiler import find_compiler
from symphys.model.world import Scheme


@pytest.fixture(autouse=True)
def _compiled() -> None:
    try:
        find_compiler()
    except KernelUnavailable as error:
        pytest.skip(str(error))


@pytest.mark.slow
def test_trees_need_no_sweeps_and_rows_do(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    measures = {"energy drift [J]": drift, "separation [mm]": parted}
    study = Study("Two rods", swinging([1.0, 1.0]), 0.6, measures, {"whole": {}}, {"whole": {}})
    tree, rows = curves(study, (1, 10))
    assert tree.errors[0] == pytest.approx(tree.errors[1], rel=1e-12)
    assert tree.instructions[0] == tree.instructions[1]
    assert (rows.errors[0] > 3 * rows.errors[1]).all()
    assert rows.instructions[1] > 1.2 * rows.instructions[0]
    report(study, [tree, rows])
    assert capsys.readouterr().out.count("| Two rods: separation [mm] |") == 2
    joint_figure({study.title: ("energy drift [J]", [tree, rows])}, tmp_path / "joints.svg")
    assert "Two rods" in (tmp_path / "joints.svg").read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_position_pass_holds_a_loop_together() -> None:
    study = Study("One loop", parallelograms(1.2), 0.5, {}, {}, {})
    apart = [parted(Run(study, study.scene, Scheme(position_sweeps=n))) for n in (0, 2)]
    assert apart[1] < 0.3 * apart[0]


def test_a_chain_begins_above_the_ground() -> None:
    scene = falling_chain(4)
    low = [lowest(scene.robot, [start]) for start in scene.start]
    assert low == pytest.approx(0.05 + 0.005 * np.arange(4))
