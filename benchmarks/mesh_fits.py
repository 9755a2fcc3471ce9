"""Shapes in place of the meshes of real robots: the largest deviation of each kind. Needs trimesh, example-robot-data.

Prints a row a mesh. With ``pictures`` and a folder it draws the best fit of each there.
"""

from __future__ import annotations

import sys
import sysconfig
import time
from pathlib import Path
from typing import Any

from symphys.importing.fitting import Fit, best, draw_fit, fits
from symphys.model.shapes import Convex

ROBOTS = Path(sysconfig.get_paths()["purelib"]) / "cmeel.prefix" / "share" / "example-robot-data" / "robots"
MESHES = (
    "ur_description/meshes/ur5/collision/upperarm.stl",
    "ur_description/meshes/ur5/collision/forearm.stl",
    "panda_description/meshes/collision/link5.stl",
    "panda_description/meshes/collision/hand.stl",
    "talos_data/meshes/v2/ankle_Y_collision.stl",
    "talos_data/meshes/v2/knee_collision.stl",
    "solo_description/meshes/stl/solo12/solo12_upper_leg_left_side.stl",
    "tiago_description/meshes/pmb2/base/base_collision.stl",
    "xarm_description/**/link2.stl",
    "go2_description/collisions/thigh_convex.stl",
)
ONE = ("sphere", "capsule", "cylinder", "box", "ellipsoid")
COLUMNS = ("size", "hull", *ONE, "spheres", "capsules", "best", "seconds")


def main(arguments: list[str]) -> None:
    """Print the table."""
    import trimesh

    print("mesh: largest deviation in either direction [mm]")
    print(f"{'':34}" + "".join(f"{column:>11}" for column in COLUMNS))
    for name in MESHES:
        found = sorted(ROBOTS.glob(name)) or sorted(ROBOTS.glob(f"{name.split('/')[0]}/**/{Path(name).name}"))
        if not found:
            print(f"{Path(name).name:34} is not there")
            continue
        mesh: Any = trimesh.load(found[0], force="mesh")
        start = time.perf_counter()
        every = fits(mesh.vertices, mesh.faces)
        spent, chosen = time.perf_counter() - start, best(every)
        cells = [f"{chosen.size_mm:.0f}", f"{hull(mesh):.1f}", *(f"{least(every, kind):.1f}" for kind in ONE)]
        cells += [f"{least(every, kind):.1f}" for kind in ("spheres", "capsules")]
        cells += [f"{len(chosen.shapes)} {chosen.kind}", f"{spent:.1f}"]
        print(f"{found[0].stem:34}" + "".join(f"{cell:>11}" for cell in cells), flush=True)
        if arguments[:1] == ["pictures"]:
            draw_fit(chosen, mesh.vertices, mesh.faces, Path(arguments[1]) / f"{found[0].stem}.png", found[0].stem)


def least(every: list[Fit], kind: str) -> float:
    """The least deviation of a kind [mm]."""
    return min(each.deviation_mm for each in every if each.kind == kind)


def hull(mesh: Any) -> float:
    """How far the convex hull reaches out of a mesh at most [mm]."""
    from symphys.importing.fitting.fit import checked

    solid = Convex(mesh.vertices).hull
    whole = checked(solid.corners, solid.triangles)
    own = checked(mesh.vertices, mesh.faces)
    free = whole.samples[own.outside(whole.samples)]
    return float(1000 * own.distance(free).max()) if len(free) else 0.0


if __name__ == "__main__":
    main(sys.argv[1:])
