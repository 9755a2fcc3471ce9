"""Meshes of a model that is read: those that cannot be read are left out by name, and the model stays."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from symphys.importing.findings import Finding
from symphys.importing.wording import counted, listed

READABLE = (".stl", ".obj", ".msh")
NAMED = re.compile(r"Element (?:'mesh', )?name '([^']*)'")
ABOUT_MESHES = ("mesh", "decoder", "faces", "vertices", "qhull")
"""Words of messages about meshes."""
TINY = 1e-3
"""[m] Size of what stands in for a shape that is left out; it touches nothing and weighs nothing."""


def compiled(spec: Any, findings: list[Finding]) -> Any:
    """The compiled model; meshes that MuJoCo cannot read are taken out, one after the other, and noted.

    Raises:
        ValueError: MuJoCo refuses something else.
    """
    while True:
        try:
            return spec.compile()
        except ValueError as error:
            mesh = guilty(spec, str(error))
            if mesh is None:
                raise
            take_out(spec, mesh, reason(str(error)), findings)


def guilty(spec: Any, message: str) -> Any:
    """The mesh that an error is about; None if it is about none."""
    if not any(word in message.lower() for word in ABOUT_MESHES):
        return None
    match = NAMED.search(message)
    for mesh in spec.meshes:
        if match and mesh.name == match[1]:
            return mesh
    by_file = [mesh for mesh in spec.meshes if mesh.file and Path(mesh.file).name in message]
    return by_file[0] if by_file else None


def reason(message: str) -> str:
    """Why MuJoCo refuses a mesh, in one short line without paths."""
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
        geom.size = [TINY, 0, 0]
        geom.contype = geom.conaffinity = 0
        geom.mass = 0.0
    for skin in list(spec.skins):
        spec.delete(skin)
    spec.delete(mesh)


def unreadable(path: Path) -> str:
    """Why a mesh of this name is not read; empty if it may be."""
    suffix = path.suffix.lower()
    return "" if suffix in READABLE else f"MuJoCo reads no {suffix or 'files without a suffix'}"


def merge_reasons(findings: list[Finding]) -> list[Finding]:
    """Meshes that were left out for one reason as one finding."""
    groups: dict[str, list[str]] = {}
    for finding in findings:
        if finding.what.startswith("mesh "):
            groups.setdefault(finding.how, []).append(finding.what.removeprefix("mesh "))
    found = [finding for finding in findings if not finding.what.startswith("mesh ")]
    for how, names in groups.items():
        what = f"mesh {names[0]}" if len(names) == 1 else f"{len(names)} meshes: {listed(names)}"
        found.append(Finding("left out", what, how))
    return found
