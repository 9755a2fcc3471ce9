"""A model file as the tables of a problem file, with a finding on each of its parts.

MuJoCo compiles the model in a process of its own, so that a crash or an endless loop of it is an error message here.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from symphys.errors import Unavailable, install_advice
from symphys.files import modified
from symphys.importing.packages import model_file
from symphys.importing.reading.checking import check_model
from symphys.importing.reading.child import ANSWER, MODEL, REQUEST
from symphys.importing.reading.folders import Folders
from symphys.importing.records import (
    CompiledModel,
    Finding,
    ImportOptions,
    ImportProblem,
    Inertial,
    JointMotor,
    Kind,
    gathered,
)
from symphys.importing.tables.contacts import read_contacts
from symphys.importing.tables.joints import read_couplings, read_joints, read_loops, read_motors
from symphys.importing.tables.links import body_table, read_links
from symphys.importing.tables.pose import begin, keyframe, lift, reference_pose
from symphys.importing.tables.reading import ModelReading, numbers
from symphys.importing.tables.sensors import read_sensors
from symphys.importing.tables.shapes import read_shapes, read_statics
from symphys.importing.tables.site_motors import read_sites_and_motors
from symphys.records import dataclass

DEFAULT_OPTIONS = ImportOptions()
COMPILE_TIMEOUT = 120.0
"""[s] that MuJoCo may take to read and compile a model."""
START = "import sys, json; sys.path[:] = json.loads(sys.argv[2]); from pathlib import Path; "
CALL = "from symphys.importing.reading.child import main; main(Path(sys.argv[1]))"
MISSING = "reading a robot model needs MuJoCo: pip install mujoco, or " + install_advice("robots")


def read_source(path: str | Path, options: ImportOptions = DEFAULT_OPTIONS) -> CompiledModel:
    """Read and compile a model.

    Args:
        path: of an MJCF or URDF file.
        options: what may be read beside it, and whether its base floats.

    Raises:
        ImportProblem: names the file as given, and where known the line, the element and the attribute.
        Unavailable: MuJoCo, which does the reading, is not installed.
    """
    file = Path(path)
    for folder in options.assets:
        if not folder.is_dir():
            raise ImportProblem(str(file), f"--assets {folder}: there is no such folder")
    folders = Folders(file.absolute(), tuple(folder.absolute() for folder in options.assets))
    try:
        text = check_model(folders)
        assets = [str(each) for each in folders.assets]
        request = {"file": str(folders.file), "assets": assets, "kind": text.kind, "base": options.base}
        model, answer = compile_isolated(request)
    except ImportProblem as error:
        raise ImportProblem(str(file), error.text, error.where) from None
    findings = [Finding(**each) for each in answer["findings"]]
    if text.kind == "mjcf" and options.base != "auto":
        how = "an MJCF says itself what floats: a body with a freejoint; base is for URDF"
        findings.append(Finding("left out", f"base = {options.base!r}", how))
    inertials = {
        name: Inertial(mass, np.array(centre), np.array(inertia))
        for name, (mass, centre, inertia) in answer.get("inertials", {}).items()
    }
    motors = {name: JointMotor(*each) for name, each in answer.get("motors", {}).items()}
    read = (folders.file, *text.included, *(Path(each) for each in answer["files"]))
    return CompiledModel(file, text.kind, model, inertials, motors, tuple(findings), read)


def need_mujoco() -> Any:
    """Return the package ``mujoco``; Unavailable where it is missing or too old."""
    try:
        import mujoco
    except ImportError:
        raise Unavailable(MISSING) from None
    if not hasattr(mujoco, "MjSpec"):
        raise Unavailable(f"mujoco {mujoco.__version__} is too old; {MISSING}")
    return mujoco


def compile_isolated(request: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
    """Return the compiled model and the answer of the process that reads it; see ``child``.

    Raises:
        ImportProblem: the model cannot be read, within the time and memory that it may take.
    """
    mujoco = need_mujoco()
    with tempfile.TemporaryDirectory(prefix="symphys_import_") as name:
        folder = Path(name)
        (folder / REQUEST).write_text(json.dumps(request), encoding="utf-8")
        code = run(folder, request["file"])
        try:
            answer = json.loads((folder / ANSWER).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            text = f"MuJoCo's process ended without an answer (code {code}): it cannot read this model"
            raise ImportProblem(request["file"], text) from None
        if "problem" in answer:
            raise ImportProblem(request["file"], answer["problem"], answer["where"])
        model = mujoco.MjModel.from_binary_path(str(folder / MODEL))
    return model, answer


def run(folder: Path, file: str) -> int:
    """Run the process that answers the request in a folder; return its exit code."""
    paths = json.dumps([path or str(Path.cwd()) for path in sys.path])
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MUJOCO_GL": "disable"}
    command = [sys.executable, "-c", START + CALL, str(folder), paths]
    try:
        done = subprocess.run(
            command,
            cwd=folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            timeout=COMPILE_TIMEOUT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        text = f"MuJoCo takes longer than {COMPILE_TIMEOUT:g} s to read it; it was stopped"
        raise ImportProblem(str(file), text) from None
    return done.returncode


KINDS: tuple[Kind, ...] = ("taken", "approximated", "left out", "recovered")
"""Kinds of findings, in the order in which they are shown."""
MAX_CACHED = 32
"""Robots that a process keeps, since reading one takes a second."""
GRAVITY = (0.0, 0.0, -9.81)
"""[m/s^2] The gravity of a world without [world]."""


@dataclass(frozen=True)
class Imported:
    """A robot.

    Attributes:
        file: the model file.
        title: the model's own name, else the name of the file.
        tables: of a problem file, as ``[[include]]`` takes them: bodies, joints, ...
        findings: the fate of the parts of the model, in the order of ``KINDS``.
    """

    file: Path
    title: str
    tables: dict[str, Any]
    findings: tuple[Finding, ...]


_kept: dict[tuple[str, ImportOptions], tuple[dict[Path, int | None], Imported]] = {}
"""Robots by path and options, with the times of their files."""


def read_robot(path: str | Path, options: ImportOptions = DEFAULT_OPTIONS) -> Imported:
    """Read an MJCF or URDF file, unless this process has read it and none of its files has changed.

    ``package://name/path`` is a file of an installed package.

    Raises:
        ImportProblem: names the file, and where known the line, the element and the attribute.
        Unavailable: MuJoCo, which does the reading, is not installed.
    """
    path = model_file(path)
    key = (str(path.absolute()), options)
    times, known = _kept.get(key, ({}, None))
    if known is None or any(modified(file) != time for file, time in times.items()):
        source = read_source(path, options)
        known = made(source, options)
        while len(_kept) >= MAX_CACHED:
            _kept.pop(next(iter(_kept)))
        _kept[key] = {file: modified(file) for file in source.files}, known
    return replace(known, file=path, tables=deepcopy(known.tables))


def made(source: CompiledModel, options: ImportOptions) -> Imported:
    """Return the robot of a compiled model."""
    tables, findings = tables_of(source, options)
    unique = dict.fromkeys((*source.findings, *findings))
    ordered = tuple(sorted(unique, key=lambda finding: KINDS.index(finding.kind)))
    return Imported(source.file, title(source.model, source.file), tables, ordered)


def title(model: Any, file: Path) -> str:
    """Return the name of a compiled model; the name of the file if it has none of its own."""
    own = bytes(model.names).split(b"\0", 1)[0].decode("utf-8", "replace")
    return file.stem if own in ("", "MuJoCo Model") else own


def tables_of(source: CompiledModel, options: ImportOptions) -> tuple[dict[str, Any], tuple[Finding, ...]]:
    """Return the tables of a problem file, and findings on the parts of the model.

    Raises:
        ImportProblem: the keyframe does not exist.
    """
    import mujoco

    key = keyframe(mujoco, source.model, options.keyframe, str(source.file))
    reading = ModelReading(mujoco, source.model, reference_pose(mujoco, source.model, key), options, key, source.motors)
    lift(reading)
    read_links(reading, source.inertials)
    frames, joints = read_joints(reading)
    read_motors(reading, joints)
    reading.driven |= {table["name"] for table in joints if "motor" in table}
    shapes = read_shapes(reading)
    bodies = list[dict[str, Any]]()
    for top in dict.fromkeys(link.top for link in reading.links.values()):
        bodies += [*frames.get(top, []), body_table(reading.links[top], [shape for _, shape in shapes.get(top, [])])]
    statics = read_statics(reading)
    reading.jointed |= {tuple(sorted(table["between"])) for table in joints}
    contacts = read_contacts(reading, shapes, bodies, statics)
    touching = contacts.pop("touching", set())
    for table in joints:
        if tuple(sorted(table["between"])) in touching:
            table["collide"] = True
    begin(reading, joints)
    sites = read_sites_and_motors(reading)
    couplings = read_couplings(reading)
    loops = read_loops(reading, touching)
    sensors = read_sensors(reading)
    nothing_of(reading)
    found = {
        **world_tables(reading),
        "body": bodies,
        **statics,
        **contacts,
        "joint": [*joints, *loops],
        "coupling": couplings,
        "site": sites,
        "sensor": sensors,
    }
    taken(reading, found)
    return {name: table for name, table in found.items() if table or name == "ground"}, gathered(reading.findings)


def world_tables(reading: ModelReading) -> dict[str, Any]:
    """Return [world] if gravity is not the usual one."""
    gravity = numbers(np.array(reading.model.opt.gravity))
    if reading.off("GRAVITY"):
        gravity = [0.0, 0.0, 0.0]
    return {} if tuple(gravity) == GRAVITY else {"world": {"gravity": gravity}}


def nothing_of(reading: ModelReading) -> None:
    """Note the parts that have no counterpart at all."""
    model = reading.model
    counts = {
        "tendons": model.ntendon,
        "skins": model.nskin,
        "flexible bodies": model.nflex,
        "plugins": model.nplugin,
        "cameras": model.ncam,
        "lights": model.nlight,
        "materials": model.nmat,
    }
    lost = [f"{count} {what}" for what, count in counts.items() if count]
    if lost:
        reading.note("left out", ", ".join(lost), "they have no counterpart")
    if model.opt.density or model.opt.viscosity:
        amount = f"{model.opt.density:g} kg/m^3, {model.opt.viscosity:g} Pa s"
        reading.note("left out", "the fluid", "nothing acts on bodies that move through it", amount)
    if np.any(model.opt.wind):
        reading.note("left out", "wind", "there is no fluid")
    springs = [
        k
        for k in range(model.ntendon)
        if any(np.any(of[k]) for of in (model.tendon_stiffness, model.tendon_damping, model.tendon_limited))
    ]
    if springs:
        names = ", ".join(reading.name("tendon", k) or str(k) for k in springs)
        reading.note("left out", f"springs, dampers and limits of tendons {names}", "they pull on nothing here")
    if np.any(model.body_gravcomp):
        amount = f"{np.max(model.body_gravcomp):g}"
        reading.note("left out", "compensation of gravity", "all bodies have weight", amount)


def taken(reading: ModelReading, tables: dict[str, Any]) -> None:
    """Note what was taken over, in one line; names that had to change; the time step of the model."""
    counted = {key: len(tables.get(key) or ()) for key in ("body", "joint", "coupling", "site", "sensor")}
    motors = sum("motor" in table for table in (*tables["joint"], *tables["site"]))
    frames = sum(table["mass"] == 0 for table in tables["body"])
    parts = [f"{counted['body'] - frames} bodies", f"{counted['joint']} joints", f"{motors} motors"]
    parts += [f"{frames} frames between joints of one body"] if frames else []
    parts += [f"{counted[key]} {key}s" for key in ("coupling", "site", "sensor") if counted[key]]
    finding = Finding("taken", ", ".join(parts), "as they are in the model")
    reading.findings.insert(0, finding)
    if reading.names.renamed:
        names = ", ".join(f"{was} is {name}" for was, name in reading.names.renamed)
        reading.note("taken", f"{len(reading.names.renamed)} parts under other names", names)
    turned = [j for j in reading.joint_names if reading.model.jnt_type[j] > 1 and reading.reference(j)]
    if turned:
        text = "their coordinates are 0 at the reference pose: " + ", ".join(
            f"{reading.joint_names[j]} is {reading.reference(j):g} less" for j in turned
        )
        reading.note("taken", f"{len(turned)} joints with a reference of their own", text)
    reading.note("left out", f"time step {reading.model.opt.timestep:g} s", "the problem chooses its own")
