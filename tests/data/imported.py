"""Models of MuJoCo as texts, read into tables, and what MuJoCo itself makes of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import symphys
from symphys.importing.records import CompiledModel, Finding, ImportOptions
from symphys.importing.robot import tables_of
from symphys.types import Array

Tables = dict[str, Any]
HEAD = '<mujoco><compiler angle="radian"/>'
FINE = 1e-4
"""[s], at which MuJoCo's Runge-Kutta steps are exact enough."""


def model_of(xml: str) -> Any:
    """The compiled model of a text; what stands within <mujoco>, if that is left out."""
    import mujoco

    whole = xml if xml.lstrip().startswith("<mujoco") else f"{HEAD}{xml}</mujoco>"
    return mujoco.MjModel.from_xml_string(whole)


def read(xml: str, **options: Any) -> tuple[Tables, tuple[Finding, ...]]:
    """Tables and findings of a text."""
    return tables_of(CompiledModel(Path("robot.xml"), "mjcf", model_of(xml)), ImportOptions(**options))


def problem_of(tables: Tables, duration: float = 0.3, dt: float = 0.01, **more: Any) -> symphys.Problem:
    """A problem that has nothing but these tables."""
    return symphys.load({"simulation": {"duration": duration, "dt": dt}, **tables, **more})


def by_name(tables: Tables, kind: str) -> dict[str, Tables]:
    """The tables of a list by their names."""
    return {table["name"]: table for table in tables.get(kind, [])}


def mujoco_motion(model: Any, duration: float, ctrl: ArrayLike = 0.0, qpos: Array | None = None) -> Any:
    """MjData after so long, by Runge-Kutta steps of ``FINE``; commands are ``ctrl``."""
    import mujoco

    model.opt.timestep, model.opt.integrator = FINE, mujoco.mjtIntegrator.mjINT_RK4
    data = mujoco.MjData(model)
    data.qpos[:] = model.qpos0 if qpos is None else qpos
    data.ctrl[:] = ctrl
    mujoco.mj_step(model, data, round(duration / FINE))
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return data


def apart(model: Any, data: Any, motion: Any, bodies: dict[str, str] | None = None) -> float:
    """How far the centres of mass of bodies are from MuJoCo's at the end [m]; ``bodies``: names here, and there."""
    import mujoco

    names = [mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_BODY, k) for k in range(1, model.nbody)]
    pairs = bodies or {name: name for name in names}
    errors = [motion[f"{own}.position"][-1] - data.xipos[model.body(other).id] for own, other in pairs.items()]
    return float(np.sqrt(np.square(errors).sum(axis=1).mean()))


def texts(findings: tuple[Finding, ...], kind: str) -> str:
    """All that is said of this kind, one finding a line."""
    return "\n".join(f"{each.what}: {each.how} {each.amount}" for each in findings if each.kind == kind)
