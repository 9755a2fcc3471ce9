"""Records of an import: its options, its error, what became of each part, and the compiled model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from symphys.errors import SymphysError
from symphys.records import dataclass
from symphys.types import Array

Kind = Literal["taken", "approximated", "left out", "recovered"]
MAX_LISTED = 6
"""Names that a message lists at most."""


class ImportProblem(SymphysError):
    """Raised for a model that cannot be read: the file, where in it, and what would be valid."""

    def __init__(self, file: str, text: str, where: str = "") -> None:
        """Keep file, text, and ``where``: element and attribute, or an option; may be empty."""
        self.file, self.where, self.text = file, where, text
        super().__init__(f"{file}: {where + ': ' if where else ''}{text}")


@dataclass(frozen=True)
class ImportFinding:
    """The fate of one part of a model, or of several alike.

    Attributes:
        kind: its fate.
        what: the part, as the file calls it.
        how: the replacement, or why it was left out; one sentence.
        amount: how far off, with its unit; empty where that has no sense.
    """

    kind: Kind
    what: str
    how: str
    amount: str = ""


Finding = ImportFinding
"""The short name within this package; findings of an examination are another class."""


def gathered(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """Merge findings that say the same of several parts into one with all their names."""
    found: dict[tuple[str, str, str, str], list[Finding]] = {}
    for finding in findings:
        head = finding.what.rpartition(" ")[0]
        found.setdefault((finding.kind, head, finding.how, finding.amount), []).append(finding)
    return tuple(joined(head, several) for (_, head, _, _), several in found.items())


def joined(head: str, several: Sequence[Finding]) -> Finding:
    """Join ``joint a`` and ``joint b`` to ``joint a, b``."""
    names = list(dict.fromkeys(finding.what.rpartition(" ")[2] for finding in several))
    if len(names) == 1 or not head:
        return several[0]
    return replace(several[0], what=f"{head} {', '.join(names)}")


def listed(names: Sequence[str]) -> str:
    """Return the first few names, and how many more there are."""
    more = len(names) - MAX_LISTED
    return ", ".join(names[:MAX_LISTED]) + (f" and {more} more" if more > 0 else "")


def counted(count: int, one: str, many: str = "") -> str:
    """Return a count with its noun, such as ``1 mesh`` or ``3 meshes``."""
    return f"{count} {one}" if count == 1 else f"{count} {many or one + 's'}"


@dataclass(frozen=True)
class ImportOptions:
    """The options of an import.

    Attributes:
        keyframe: the name of the keyframe at which the robot begins; None: the model's reference pose.
        self_collision: whether bodies of the robot may touch each other, as far as the model lets them.
        base: of a URDF, whether its root link floats; "auto": unless the file holds it to the world.
        assets: folders besides the model's own from which files may be read.
        meshes: "hull": a mesh is its convex hull, which touches planes, terrain and spheres; "fit": the spheres, boxes
            or capsules that come nearest to it, which touch each other too. To fit a mesh takes some ten seconds.
    """

    keyframe: str | None = None
    self_collision: bool = True
    base: Literal["auto", "free", "fixed"] = "auto"
    assets: tuple[Path, ...] = ()
    meshes: Literal["hull", "fit"] = "hull"


@dataclass(frozen=True)
class Inertial:
    """The mass properties of a link in a file.

    Attributes:
        mass: [kg].
        centre: (3,) of mass, in the link's frame [m].
        inertia: (3, 3) about it, in the link's axes [kg m^2].
    """

    mass: float
    centre: Array
    inertia: Array


@dataclass(frozen=True)
class JointMotor:
    """The motor of a joint in a URDF: largest effort [N m] or [N], largest velocity [rad/s] or [m/s]."""

    effort: float
    velocity: float = np.inf


@dataclass(frozen=True)
class CompiledModel:
    """A compiled model.

    Attributes:
        file: the model file.
        kind: "mjcf" or "urdf".
        model: MjModel.
        inertials: by the names of bodies, where the model's numbers are not those of the file.
        motors: by the names of joints, of a URDF.
        findings: losses of MuJoCo, and recovered parts.
        files: all files that were read: the model, included files, meshes and height fields.
    """

    file: Path
    kind: str
    model: Any
    inertials: Mapping[str, Inertial] = field(default_factory=dict)
    motors: Mapping[str, JointMotor] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()
    files: tuple[Path, ...] = ()
