"""Changes to what MuJoCo has parsed, before it compiles it: what it would refuse, invent or read needlessly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from symphys.importing.compiled import Inertial, JointMotor
from symphys.importing.findings import Finding
from symphys.importing.problem import ImportProblem
from symphys.importing.reading.folders import Folders
from symphys.importing.reading.meshes import take_out, unreadable
from symphys.importing.reading.urdf_text import Mimic
from symphys.importing.wording import counted, listed
from symphys.types import Array

LEAST = 1e-14
"""[kg], [kg m^2] MuJoCo refuses moving bodies with less."""
LARGEST = 1e12
"""A number of a model beyond which it is a mistake."""
HARMLESS = (1e-3, 1e-6)
"""[kg], [kg m^2] What a link has in the compiled model whose own numbers MuJoCo refuses."""


def leave_images(spec: Any, findings: list[Finding]) -> None:
    """Textures and skins are for pictures: their files are not read."""
    textures, skins = list(spec.textures), list(spec.skins)
    for material in spec.materials:
        material.textures = [""] * len(material.textures)
    for each in (*textures, *skins):
        spec.delete(each)
    if textures:
        findings.append(Finding("left out", counted(len(textures), "texture"), "images change no motion"))
    if skins:
        findings.append(Finding("left out", counted(len(skins), "skin"), "pictures show the shapes below it"))


def bound(spec: Any) -> None:
    """What the file says of memory and of long computations is for MuJoCo's own simulation."""
    import mujoco

    spec.memory = -1
    spec.njmax = spec.nconmax = spec.nstack = -1
    spec.nuserdata = 0
    spec.compiler.fusestatic = 0
    spec.compiler.LRopt.mode = mujoco.mjtLRMode.mjLRMODE_NONE


def check_assets(spec: Any, folders: Folders) -> None:
    """Refuse meshes and height fields outside of the allowed folders.

    Raises:
        ImportProblem: names the file and the option that allows it.
    """
    for each in (*spec.meshes, *spec.hfields):
        if each.file:
            for folder in ("", spec.meshdir or ""):
                path = folders.own / folder / each.file
                if path.is_file():
                    folders.check(path, each.file, f"the asset {each.name!r}")


def drop_visuals(spec: Any) -> None:
    """Geometry of URDF that is for pictures only, so that no mesh of it is read."""
    for geom in [geom for geom in spec.geoms if geom.contype == 0 and geom.conaffinity == 0]:
        spec.delete(geom)
    used = {geom.meshname for geom in spec.geoms}
    for mesh in [mesh for mesh in spec.meshes if mesh.name not in used]:
        spec.delete(mesh)


def find_meshes(spec: Any, folders: Folders, findings: list[Finding]) -> None:
    """Give each mesh of a URDF the path of its file; those without one are left out."""
    folder = spec.meshdir or ""
    for mesh in list(spec.meshes):
        path = folders.mesh(mesh.file, folder)
        if path is None:
            why = "there is no such file; --assets DIR names further folders to look in"
        else:
            why = unreadable(path)
        if why:
            take_out(spec, mesh, why, findings)
        else:
            mesh.file = str(path)
    spec.meshdir = ""
    spec.strippath = False


def keep_inertials(spec: Any, folders: Folders, findings: list[Finding]) -> dict[str, Inertial]:
    """Mass properties of URDF links where MuJoCo would refuse the file's, or invent some; by name of link.

    The parsed model gets harmless ones instead.
    """
    kept, none, refused = dict[str, Inertial](), [], []
    for body in spec.bodies[1:]:
        own = inertial(body)
        if own.mass < 0 or not np.isfinite(own.inertia).all():
            text = f"must not be negative, and the inertia must be finite; it is {own.mass:g}"
            raise ImportProblem(str(folders.file), text, f'<link name="{body.name}"> mass')
        if max(own.mass, np.abs(own.centre).max(), np.abs(own.inertia).max()) > LARGEST:
            text = f"mass, centre and inertia must be at most {LARGEST:g} in size"
            raise ImportProblem(str(folders.file), text, f'<link name="{body.name}"> inertial')
        moments = np.linalg.eigvalsh(own.inertia)
        if not body.explicitinertial:
            none += [body.name] if body.geoms else []
        elif own.mass >= LEAST and moments[0] > LEAST and moments[0] + moments[1] >= moments[2]:
            continue
        else:
            refused.append(body.name)
        kept[body.name] = own
        body.explicitinertial = True
        body.mass = max(own.mass, HARMLESS[0])
        body.fullinertia = [np.nan, 0, 0, 0, 0, 0]
        body.inertia = [HARMLESS[1]] * 3
    if none:
        text = "they have no <inertial>, thus mass 0; MuJoCo would make one from their shapes"
        findings.append(Finding("recovered", f"mass of {listed(none)}", text))
    if refused:
        text = "MuJoCo refuses the mass or inertia that the file gives; the file's own is taken"
        findings.append(Finding("recovered", f"inertia of {listed(refused)}", text))
    return kept


def inertial(body: Any) -> Inertial:
    """What the file says of a body's mass, in the frame of the body."""
    if not body.explicitinertial:
        return Inertial(0.0, np.zeros(3), np.zeros((3, 3)))
    if np.isnan(body.fullinertia[0]):
        own = np.diag(np.array(body.inertia, float))
    else:
        xx, yy, zz, xy, xz, yz = (float(each) for each in body.fullinertia)
        own = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    turn = rotation(np.array(body.iquat, float))
    return Inertial(float(body.mass), np.array(body.ipos, float), turn @ own @ turn.T)


def rotation(q: Array) -> Array:
    """(3, 3) of a quaternion w x y z of any length."""
    w, x, y, z = q / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def add_motors(spec: Any, motors: Mapping[str, JointMotor]) -> None:
    """Motors whose command is the torque or force at the joint."""
    import mujoco

    for joint in spec.joints:
        joint.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
    for name, motor in motors.items():
        made = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        made.gainprm[0], made.ctrllimited = 1.0, mujoco.mjtLimited.mjLIMITED_TRUE
        made.ctrlrange = [-motor.effort, motor.effort]


def add_couplings(spec: Any, mimics: Sequence[Mimic]) -> None:
    """Joints that follow others."""
    import mujoco

    for each in mimics:
        made = spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, name1=each.joint, name2=each.follows)
        made.objtype = mujoco.mjtObj.mjOBJ_JOINT
        made.data[:2] = [each.offset, each.multiplier]
