"""The process in which MuJoCo reads a model: request, repairs of the parsed model, compiling, answer.

The request is a file and options as JSON. The answer is a compiled model in a folder, with findings, recovered and
kept numbers, or an error. The parent process bounds time and memory, and hides whatever MuJoCo prints.
"""

from __future__ import annotations

import json
import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from symphys.importing.reading.checking import read_bytes
from symphys.importing.reading.folders import Folders
from symphys.importing.reading.urdf_text import Base, Mimic, base_floats, lost_elements, lost_mimics, motors, read_urdf
from symphys.importing.records import Finding, ImportProblem, Inertial, JointMotor, counted, listed

READABLE = (".stl", ".obj", ".msh")
NAMED_ELEMENT = re.compile(r"Element (?:'mesh', )?name '([^']*)'")
MESH_WORDS = ("mesh", "decoder", "faces", "vertices", "qhull")
"""Words of messages about meshes."""
STANDIN_SIZE = 1e-3
"""[m] Size of the stand-in for a shape that is left out, which touches nothing and weighs nothing."""
MIN_INERTIA = 1e-14
"""[kg], [kg m^2] Least mass and inertia of a moving body for MuJoCo."""
MAX_NUMBER = 1e12
"""Size beyond which a number of a model counts as a mistake."""
STANDIN_INERTIA = (1e-3, 1e-6)
"""[kg], [kg m^2] Stand-in mass and inertia of a link whose own MuJoCo refuses."""
MODEL, ANSWER, REQUEST = "model.mjb", "answer.json", "request.json"
MAX_MEMORY = 8 << 30
"""[bytes] Memory of the process."""
MAX_BODIES = 2000
"""Largest number of bodies of a model."""
FINITE_WORDS = (
    "body_pos body_quat body_ipos body_mass body_inertia jnt_pos jnt_axis jnt_stiffness geom_pos geom_size "
    "qpos0 dof_armature dof_damping dof_frictionloss site_pos actuator_gainprm actuator_biasprm "
    "actuator_gear key_qpos"
)
FINITE = FINITE_WORDS.split()
"""Arrays of a compiled model that must be finite."""


def main(folder: Path) -> None:
    """Answer the request in a folder."""
    limit_memory()
    warnings.simplefilter("ignore")
    request = json.loads((folder / REQUEST).read_text(encoding="utf-8"))
    folders = Folders(Path(request["file"]), tuple(Path(each) for each in request["assets"]))
    try:
        answer = read(folders, request["kind"], request["base"], folder / MODEL)
    except ImportProblem as error:
        answer = {"problem": error.text, "where": error.where}
    except MemoryError:
        answer = {"problem": "it needs more memory than there is", "where": ""}
    (folder / ANSWER).write_text(json.dumps(answer), encoding="utf-8")


def limit_memory() -> None:
    """Let the process fail before the machine does, where the system can."""
    try:
        import resource
    except ImportError:
        return
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    limit = MAX_MEMORY if hard == resource.RLIM_INFINITY else min(MAX_MEMORY, hard)
    resource.setrlimit(resource.RLIMIT_AS, (limit, hard))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def read(folders: Folders, kind: str, base: Base, target: Path) -> dict[str, Any]:
    """Compile a model and save it; return the answer."""
    import mujoco

    findings = list[Finding]()
    try:
        spec = mujoco.MjSpec.from_file(str(folders.file))
        ignore_memory_options(spec)
        answer: dict[str, Any] = {}
        if kind == "urdf":
            answer = read_urdf_model(spec, folders, base, findings)
        else:
            leave_images(spec, findings)
            check_assets(spec, folders)
        model = compiled(spec, findings)
        check_compiled(folders, model)
        mujoco.mj_saveModel(model, str(target))
    except (ValueError, TypeError, UnicodeError, mujoco.FatalError, mujoco.UnexpectedError) as error:
        raise ImportProblem(str(folders.file), in_one_line(str(error), folders)) from None
    answer["files"] = files(spec, folders)
    answer["findings"] = [asdict(each) for each in merge_reasons(findings)]
    return answer


def in_one_line(message: str, folders: Folders) -> str:
    """Return the message of MuJoCo without its layout and the model's folder."""
    text = " ".join(message.split()).replace(str(folders.own) + "/", "")
    for head in ("XML Error:", "Error:"):
        text = text.removeprefix(head).strip()
    return f"MuJoCo refuses it: {text[:400]}"


def files(spec: Any, folders: Folders) -> list[str]:
    """Return the files of meshes and height fields that were read."""
    paths = [folders.own / (spec.meshdir or "") / each.file for each in (*spec.meshes, *spec.hfields) if each.file]
    return [str(path) for path in paths]


def check_compiled(folders: Folders, model: Any) -> None:
    """Refuse a model that is too large, or with numbers that are not finite.

    Raises:
        ImportProblem: says which.
    """
    if model.nbody == 1:
        raise ImportProblem(str(folders.file), "it has no bodies; a robot has at least one <body>, or <link>")
    if model.nbody - 1 > MAX_BODIES:
        raise ImportProblem(str(folders.file), f"it has {model.nbody - 1} bodies; at most {MAX_BODIES} are read")
    for name in FINITE:
        values = np.asarray(getattr(model, name), float)
        if not np.isfinite(values).all() or np.abs(values).max(initial=0.0) > MAX_NUMBER:
            raise ImportProblem(
                str(folders.file), f"compiled, its numbers {name} are infinite or beyond {MAX_NUMBER:g}"
            )


def read_urdf_model(spec: Any, folders: Folders, base: Base, findings: list[Finding]) -> dict[str, Any]:
    """Prepare a parsed URDF; return the fields of the answer besides the findings."""
    urdf = read_urdf(read_bytes(folders.file, folders.file))
    floating = []
    for root in spec.worldbody.bodies:
        if len(root.joints):
            continue
        floats, why = base_floats(urdf, root.name, base)
        findings.append(why)
        if floats:
            floating.append(root.name)
    drop_visuals(spec)
    find_meshes(spec, folders, findings)
    kept = keep_inertials(spec, folders, findings)
    for root in list(spec.worldbody.bodies):
        if root.name in floating:
            root.add_freejoint()
    found, about = motors(urdf)
    mimics, lost = lost_mimics(urdf, [each.name1 for each in spec.equalities])
    findings += [*about, *lost, *lost_elements(urdf)]
    add_motors(spec, found)
    add_couplings(spec, mimics)
    return {
        "inertials": {name: [own.mass, own.centre.tolist(), own.inertia.tolist()] for name, own in kept.items()},
        "motors": {name: [motor.effort, motor.velocity] for name, motor in found.items()},
    }


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
        if max(own.mass, np.abs(own.centre).max(), np.abs(own.inertia).max()) > MAX_NUMBER:
            text = f"mass, centre and inertia must be at most {MAX_NUMBER:g} in size"
            raise ImportProblem(str(folders.file), text, f'<link name="{body.name}"> inertial')
        moments = np.linalg.eigvalsh(own.inertia)
        if not body.explicitinertial:
            none += [body.name] if body.geoms else []
        elif own.mass >= MIN_INERTIA and moments[0] > MIN_INERTIA and moments[0] + moments[1] >= moments[2]:
            continue
        else:
            refused.append(body.name)
        kept[body.name] = own
        body.explicitinertial = True
        body.mass = max(own.mass, STANDIN_INERTIA[0])
        body.fullinertia = [np.nan, 0, 0, 0, 0, 0]
        body.inertia = [STANDIN_INERTIA[1]] * 3
    if none:
        text = "they have no <inertial>, thus mass 0; MuJoCo would make one from their shapes"
        findings.append(Finding("recovered", f"mass of {listed(none)}", text))
    if refused:
        text = "MuJoCo refuses the mass or inertia that the file gives; the file's own is taken"
        findings.append(Finding("recovered", f"inertia of {listed(refused)}", text))
    return kept


def inertial(body: Any) -> Inertial:
    """Return the file's mass properties of a body, in the frame of the body."""
    import mujoco

    if not body.explicitinertial:
        return Inertial(0.0, np.zeros(3), np.zeros((3, 3)))
    if np.isnan(body.fullinertia[0]):
        own = np.diag(np.array(body.inertia, float))
    else:
        xx, yy, zz, xy, xz, yz = (float(each) for each in body.fullinertia)
        own = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    q = np.array(body.iquat, float)
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, q / np.linalg.norm(q))
    turn = matrix.reshape(3, 3)
    return Inertial(float(body.mass), np.array(body.ipos, float), turn @ own @ turn.T)


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


def unreadable(path: Path) -> str:
    """Return why a mesh of this name is not read; empty if it may be."""
    suffix = path.suffix.lower()
    return "" if suffix in READABLE else f"MuJoCo reads no {suffix or 'files without a suffix'}"


def drop_visuals(spec: Any) -> None:
    """Remove geometry of URDF that is for pictures only, so that none of its meshes is read."""
    for geom in [geom for geom in spec.geoms if geom.contype == 0 and geom.conaffinity == 0]:
        spec.delete(geom)
    used = {geom.meshname for geom in spec.geoms}
    for mesh in [mesh for mesh in spec.meshes if mesh.name not in used]:
        spec.delete(mesh)


def add_motors(spec: Any, motors: Mapping[str, JointMotor]) -> None:
    """Add motors whose command is the torque or force at the joint."""
    import mujoco

    for joint in spec.joints:
        joint.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE
    for name, motor in motors.items():
        made = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        made.gainprm[0], made.ctrllimited = 1.0, mujoco.mjtLimited.mjLIMITED_TRUE
        made.ctrlrange = [-motor.effort, motor.effort]


def add_couplings(spec: Any, mimics: Sequence[Mimic]) -> None:
    """Add couplings for joints that follow others."""
    import mujoco

    for each in mimics:
        made = spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, name1=each.joint, name2=each.follows)
        made.objtype = mujoco.mjtObj.mjOBJ_JOINT
        made.data[:2] = [each.offset, each.multiplier]


def leave_images(spec: Any, findings: list[Finding]) -> None:
    """Remove textures and skins, which are for pictures, so that their files are not read."""
    textures, skins = list(spec.textures), list(spec.skins)
    for material in spec.materials:
        material.textures = [""] * len(material.textures)
    for each in (*textures, *skins):
        spec.delete(each)
    if textures:
        findings.append(Finding("left out", counted(len(textures), "texture"), "images change no motion"))
    if skins:
        findings.append(Finding("left out", counted(len(skins), "skin"), "pictures show the shapes below it"))


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


def ignore_memory_options(spec: Any) -> None:
    """Ignore options of the file on memory and long computations, which are for MuJoCo's own simulation."""
    import mujoco

    spec.memory = -1
    spec.njmax = spec.nconmax = spec.nstack = -1
    spec.nuserdata = 0
    spec.compiler.fusestatic = 0
    spec.compiler.LRopt.mode = mujoco.mjtLRMode.mjLRMODE_NONE


def compiled(spec: Any, findings: list[Finding]) -> Any:
    """Compile the model; meshes that MuJoCo cannot read are taken out, one after the other, and noted.

    Raises:
        ValueError: MuJoCo refuses something else.
    """
    while True:
        try:
            return spec.compile()
        except ValueError as error:
            mesh = blamed_mesh(spec, str(error))
            if mesh is None:
                raise
            take_out(spec, mesh, reason(str(error)), findings)


def blamed_mesh(spec: Any, message: str) -> Any:
    """Return the mesh that an error is about; None if it is not about a mesh."""
    if not any(word in message.lower() for word in MESH_WORDS):
        return None
    match = NAMED_ELEMENT.search(message)
    for mesh in spec.meshes:
        if match and mesh.name == match[1]:
            return mesh
    by_file = [mesh for mesh in spec.meshes if mesh.file and Path(mesh.file).name in message]
    return by_file[0] if by_file else None


def reason(message: str) -> str:
    """Return why MuJoCo refuses a mesh, in one short line without paths."""
    line = " ".join(message.split("Element ")[0].split()).removeprefix("Error:").strip()
    line = re.sub(r"'[^']*[/\\]([^'/\\]*)'", r"'\1'", line)
    return f"MuJoCo cannot read it: {line[:160]}"


def take_out(spec: Any, mesh: Any, why: str, findings: list[Finding]) -> None:
    """Remove a mesh; shapes that use it become points that touch nothing and weigh nothing."""
    import mujoco

    users = [geom for geom in spec.geoms if geom.meshname == mesh.name]
    touching = [geom for geom in users if geom.contype or geom.conaffinity]
    weighing = sorted({geom.parent.name for geom in users if not geom.parent.explicitinertial})
    what = f"mesh {mesh.name or Path(mesh.file).name}"
    text = f"{why}; {counted(len(touching), 'shape that touches', 'shapes that touch')} things go with it"
    if weighing:
        text += f", and what it weighs in {listed(weighing)}"
    findings.append(Finding("left out", what, text))
    for geom in users:
        geom.meshname, geom.type = "", mujoco.mjtGeom.mjGEOM_SPHERE
        geom.size = [STANDIN_SIZE, 0, 0]
        geom.contype = geom.conaffinity = 0
        geom.mass = 0.0
    for skin in list(spec.skins):
        spec.delete(skin)
    spec.delete(mesh)


def merge_reasons(findings: list[Finding]) -> list[Finding]:
    """Merge findings on meshes that were left out for one reason."""
    groups: dict[str, list[str]] = {}
    for finding in findings:
        if finding.what.startswith("mesh "):
            groups.setdefault(finding.how, []).append(finding.what.removeprefix("mesh "))
    found = [finding for finding in findings if not finding.what.startswith("mesh ")]
    for how, names in groups.items():
        what = f"mesh {names[0]}" if len(names) == 1 else f"{len(names)} meshes: {listed(names)}"
        found.append(Finding("left out", what, how))
    return found
