"""The process in which MuJoCo reads a model: what it gets, what it answers.

It gets a file and options as JSON. It leaves a compiled model and an answer in a folder: what was found, recovered and
kept, or what is wrong. Its parent bounds its time and memory. Whatever MuJoCo prints stays in it.
"""

from __future__ import annotations

import json
import sys
import warnings
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from symphys.importing.findings import Finding
from symphys.importing.problem import ImportProblem
from symphys.importing.reading.checking import read_bytes
from symphys.importing.reading.folders import Folders
from symphys.importing.reading.mending import (
    LARGEST,
    add_couplings,
    add_motors,
    bound,
    check_assets,
    drop_visuals,
    find_meshes,
    keep_inertials,
    leave_images,
)
from symphys.importing.reading.meshes import compiled, merge_reasons
from symphys.importing.reading.urdf_text import Base, base_floats, lost_elements, lost_mimics, motors, read_urdf

MODEL, ANSWER, REQUEST = "model.mjb", "answer.json", "request.json"
MOST_MEMORY = 8 << 30
"""[bytes] of the process."""
MOST_BODIES = 2000
FINITE_WORDS = (
    "body_pos body_quat body_ipos body_mass body_inertia jnt_pos jnt_axis jnt_stiffness geom_pos geom_size "
    "qpos0 dof_armature dof_damping dof_frictionloss site_pos actuator_gainprm actuator_biasprm "
    "actuator_gear key_qpos"
)
FINITE = FINITE_WORDS.split()
"""Arrays of a compiled model that must be numbers."""


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
    limit = MOST_MEMORY if hard == resource.RLIM_INFINITY else min(MOST_MEMORY, hard)
    resource.setrlimit(resource.RLIMIT_AS, (limit, hard))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def read(folders: Folders, kind: str, base: Base, target: Path) -> dict[str, Any]:
    """Compile a model and save it; the answer."""
    import mujoco

    findings = list[Finding]()
    try:
        spec = mujoco.MjSpec.from_file(str(folders.file))
        bound(spec)
        answer = (
            read_urdf_model(spec, folders, base, findings) if kind == "urdf" else read_mjcf(spec, folders, findings)
        )
        model = compiled(spec, findings)
        check_compiled(folders, model)
        mujoco.mj_saveModel(model, str(target))
    except (ValueError, TypeError, UnicodeError, mujoco.FatalError, mujoco.UnexpectedError) as error:
        raise ImportProblem(str(folders.file), in_one_line(str(error), folders)) from None
    answer["files"] = files(spec, folders)
    answer["findings"] = [asdict(each) for each in merge_reasons(findings)]
    return answer


def files(spec: Any, folders: Folders) -> list[str]:
    """Of meshes and height fields that were read."""
    paths = [folders.own / (spec.meshdir or "") / each.file for each in (*spec.meshes, *spec.hfields) if each.file]
    return [str(path) for path in paths]


def in_one_line(message: str, folders: Folders) -> str:
    """What MuJoCo says, without its layout and the model's folder."""
    text = " ".join(message.split()).replace(str(folders.own) + "/", "")
    for head in ("XML Error:", "Error:"):
        text = text.removeprefix(head).strip()
    return f"MuJoCo refuses it: {text[:400]}"


def read_mjcf(spec: Any, folders: Folders, findings: list[Finding]) -> dict[str, Any]:
    """Prepare a parsed MJCF."""
    leave_images(spec, findings)
    check_assets(spec, folders)
    return {}


def read_urdf_model(spec: Any, folders: Folders, base: Base, findings: list[Finding]) -> dict[str, Any]:
    """Prepare a parsed URDF; what the answer says beside the findings."""
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


def check_compiled(folders: Folders, model: Any) -> None:
    """Refuse a model whose numbers are none, or that is too large.

    Raises:
        ImportProblem: says which.
    """
    if model.nbody == 1:
        raise ImportProblem(str(folders.file), "it has no bodies; a robot has at least one <body>, or <link>")
    if model.nbody - 1 > MOST_BODIES:
        raise ImportProblem(str(folders.file), f"it has {model.nbody - 1} bodies; at most {MOST_BODIES} are read")
    for name in FINITE:
        values = np.asarray(getattr(model, name), float)
        if not np.isfinite(values).all() or np.abs(values).max(initial=0.0) > LARGEST:
            raise ImportProblem(str(folders.file), f"compiled, its numbers {name} are infinite or beyond {LARGEST:g}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
