"""The page of a motion alone is complete, and its animation carries the recorded states."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tools.page_scripts import NODE, charts, plays_to_the_end

from symphys.report import write_motion
from symphys.report.scene.animation import NUMBERS, motion_data
from symphys.results.scene import read_scene
from symphys.results.text_files import ReportError
from symphys.results.trajectories import read_trajectory


@pytest.mark.slow
def test_page_plays_and_draws(made: Path, tmp_path: Path) -> None:
    run = made / "two_balls" / "gradient-seed0"
    out = write_motion(run / "guess.npz", run / "scene.json", tmp_path / "new" / "motion.html", title="Two <balls>")
    text = out.read_text(encoding="utf-8")
    assert "Two &lt;balls&gt;" in text
    assert "1 s in 480 steps; 2 bodies." in text
    assert "<canvas" in text
    assert {"states", "contacts"} <= set(charts(text))
    assert "src=" not in text and list(out.parent.iterdir()) == [out]
    assert "http" not in re.sub(r"http-equiv", "", text)


@pytest.mark.parametrize(("name", "words"), [("trajectory.npz", "no such file"), ("scene.json", "no such file")])
def test_missing_file_is_named(run_dir: Path, name: str, words: str) -> None:
    (run_dir / name).unlink()
    with pytest.raises(ReportError, match=f"{name}: there is {words}"):
        write_motion(run_dir / "trajectory.npz", run_dir / "scene.json", run_dir / "motion.html")


def data_of(run: Path) -> dict[str, Any]:
    return dict(motion_data(read_trajectory(run / "trajectory.npz"), read_scene(run / "scene.json"), None, NUMBERS))


def test_animation_holds_the_motion(run_dir: Path) -> None:
    data = data_of(run_dir)
    motion = read_trajectory(run_dir / "trajectory.npz")
    frames = np.searchsorted(motion.time, np.array(data["time"]) - 1e-9)
    assert np.allclose(np.reshape(data["position"], (-1, 3)), motion.position[frames, 0], atol=2e-4)
    assert np.allclose(np.reshape(data["orientation"], (-1, 4)), motion.orientation[frames, 0], atol=2e-4)
    assert data["time"][-1] == pytest.approx(motion.time[-1])
    assert len(json.dumps(data)) < 8 * NUMBERS


def test_views_follow_the_motion(made: Path) -> None:
    assert data_of(made / "two_balls" / "gradient-seed0")["flat"] is True
    thrown = data_of(made / "ball_throw" / "gradient-seed0")
    assert (thrown["flat"], thrown["along"]) == (False, "x")


@NODE
@pytest.mark.parametrize("run", ["two_balls/gradient-seed0", "ball_throw/gradient-seed0"])
def test_script_plays_to_the_end(made: Path, run: str) -> None:
    plays_to_the_end(data_of(made / run))


SHAPES = {
    "bodies": [
        {
            "name": "ball",
            "shapes": [
                {"kind": "box", "size": [1, 1, 0.5]},
                {"kind": "capsule", "radius": 0.2, "length": 1},
                {"kind": "sphere", "radius": 0.1},
            ],
        }
    ],
    "planes": [{"name": "ground", "normal": [0, 0, 1], "offset": 0.0}],
    "fixtures": [
        {
            "name": "ramp",
            "shape": {"kind": "box", "size": [4, 2, 1], "centre": [1, 0, 0], "orientation": [1, 0.2, 0, 0]},
        },
        {"name": "post", "shape": {"kind": "capsule", "radius": 0.1, "length": 2, "centre": [5, 0, 1]}},
        {"name": "knob", "shape": {"kind": "sphere", "radius": 0.5, "centre": [9, 0, 0]}},
    ],
    "terrain": [{"name": "hills", "x": [-1, 3, 9], "y": [-2, 2], "z": [[0, 1, "nan"], [0.2, 0, 0]]}],
}


@NODE
def test_script_plays_every_shape_to_the_end(run_dir: Path) -> None:
    (run_dir / "scene.json").write_text(json.dumps(SHAPES))
    plays_to_the_end(data_of(run_dir))
