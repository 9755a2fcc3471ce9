"""What a caller may choose about an import."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal


@dataclass(frozen=True)
class ImportOptions:
    """Choices of an import.

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
