"""MuJoCo in a process of its own, within a time: what crashes or hangs there is a message here."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from symphys.errors import Unavailable
from symphys.importing.problem import ImportProblem
from symphys.importing.reading.child import ANSWER, MODEL, REQUEST

LONGEST = 120.0
"""[s] that MuJoCo may take to read and compile a model."""
START = "import sys, json; sys.path[:] = json.loads(sys.argv[2]); from pathlib import Path; "
CALL = "from symphys.importing.reading.child import main; main(Path(sys.argv[1]))"
MISSING = "models of robots are read by MuJoCo, which is not installed; pip install 'symphys[robots]'"


def need_mujoco() -> Any:
    """The package ``mujoco``; Unavailable where it is missing or too old."""
    try:
        import mujoco
    except ImportError:
        raise Unavailable(MISSING) from None
    if not hasattr(mujoco, "MjSpec"):
        raise Unavailable(f"mujoco {mujoco.__version__} is too old; {MISSING}")
    return mujoco


def compile_isolated(request: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
    """The compiled model and the answer of the process that reads it; see ``child``.

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
    """Run the process that answers the request in a folder; its exit code."""
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
            timeout=LONGEST,
            check=False,
        )
    except subprocess.TimeoutExpired:
        text = f"MuJoCo takes longer than {LONGEST:g} s to read it; it was stopped"
        raise ImportProblem(str(file), text) from None
    return done.returncode
