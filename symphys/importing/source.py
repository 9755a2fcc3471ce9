"""From the path of a model to what MuJoCo compiled of it, with what was lost and recovered on the way."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from symphys.importing.compiled import Inertial, JointMotor, Source
from symphys.importing.findings import Finding
from symphys.importing.options import ImportOptions
from symphys.importing.problem import ImportProblem
from symphys.importing.reading.checking import XmlText, check_model
from symphys.importing.reading.folders import Folders
from symphys.importing.reading.isolated import compile_isolated

AS_IT_IS = ImportOptions()
__all__ = ["Inertial", "JointMotor", "Source", "read_source"]


def read_source(path: str | Path, options: ImportOptions = AS_IT_IS) -> Source:
    """Read and compile a model.

    Args:
        path: of an MJCF or URDF file.
        options: what may be read beside it, and whether its base floats.

    Raises:
        ImportProblem: names the file, and where known the line, the element and the attribute.
        Unavailable: MuJoCo, which does the reading, is not installed.
    """
    file = Path(path)
    for folder in options.assets:
        if not folder.is_dir():
            raise ImportProblem(str(file), f"--assets {folder}: there is no such folder")
    folders = Folders(file.absolute(), tuple(folder.absolute() for folder in options.assets))
    return compile_checked(file, check(file, folders), folders, options)


def check(file: Path, folders: Folders) -> XmlText:
    """The checked text; messages name the file as the caller did."""
    try:
        return check_model(folders)
    except ImportProblem as error:
        raise ImportProblem(str(file), error.text, error.where) from None


def compile_checked(file: Path, text: XmlText, folders: Folders, options: ImportOptions) -> Source:
    """Compile what was checked."""
    request = {
        "file": str(folders.file),
        "assets": [str(each) for each in folders.assets],
        "kind": text.kind,
        "base": options.base,
    }
    try:
        model, answer = compile_isolated(request)
    except ImportProblem as error:
        raise ImportProblem(str(file), error.text, error.where) from None
    findings = [Finding(**each) for each in answer["findings"]]
    if text.kind == "mjcf" and options.base != "auto":
        how = "an MJCF says itself what floats: a body with a freejoint; base is for URDF"
        findings.append(Finding("left out", f"base = {options.base!r}", how))
    return Source(
        file,
        text.kind,
        model,
        inertials(answer),
        {name: JointMotor(*each) for name, each in answer.get("motors", {}).items()},
        tuple(findings),
        (folders.file, *text.included, *(Path(each) for each in answer["files"])),
    )


def inertials(answer: Mapping[str, Any]) -> dict[str, Inertial]:
    """Mass properties that were kept, by name of link."""
    return {
        name: Inertial(mass, np.array(centre), np.array(inertia))
        for name, (mass, centre, inertia) in answer.get("inertials", {}).items()
    }
