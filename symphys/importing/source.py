"""The source of an import: a model that MuJoCo compiles in a process of its own, with losses and recovered parts.

A crash or an endless loop of MuJoCo is an error message here.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from symphys.errors import Unavailable
from symphys.importing.reading.checking import check_model
from symphys.importing.reading.child import ANSWER, MODEL, REQUEST
from symphys.importing.reading.folders import Folders
from symphys.importing.records import CompiledModel, Finding, ImportOptions, ImportProblem, Inertial, JointMotor

DEFAULT_OPTIONS = ImportOptions()
COMPILE_TIMEOUT = 120.0
"""[s] that MuJoCo may take to read and compile a model."""
START = "import sys, json; sys.path[:] = json.loads(sys.argv[2]); from pathlib import Path; "
CALL = "from symphys.importing.reading.child import main; main(Path(sys.argv[1]))"
MISSING = "models of robots are read by MuJoCo, which is not installed; pip install 'symphys[robots]'"


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
