"""Problem files with many pairs, most of them far apart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

SHAPES = {
    "sphere": "{ sphere = { radius = 0.1 } }",
    "capsule": "{ capsule = { radius = 0.06, length = 0.2 } }",
    "box": "{ box = { size = [0.2, 0.16, 0.12] } }",
}
HEAD = "[simulation]\nduration = {duration}\ndt = 0.01\nsweeps = 6\n[ground]\nfriction = 0.4\nrestitution = {bounce}\n"


def heap(kinds: Sequence[str], duration: float = 0.2, law: str = "friction = 0.4", restitution: float = 0.5) -> str:
    """Bodies that fly about in a pen, above one another; their velocities may vary, their places are targets."""
    random = np.random.default_rng(len(kinds))
    lines = [HEAD.format(duration=duration, bounce=restitution), f"[contact]\nrestitution = {restitution}\n{law}"]
    lines += [
        f'[[plane]]\nname = "{name}"\nnormal = {normal}\noffset = -0.3'
        for name, normal in (("left", [1, 0, 0]), ("right", [-1, 0, 0]))
    ]
    for i, kind in enumerate(kinds):
        place = [0.24 * (i % 2) - 0.12, 0.24 * (i // 2 % 2), 0.2 + 0.4 * (i // 4)]
        velocity = random.uniform(-1.5, 1.5, 3).round(3).tolist()
        lines.append(
            f'[[body]]\nname = "b{i}"\nshape = {SHAPES[kind]}\nmass = 1.0\nposition = {place}\n'
            f'[[variable]]\nname = "v{i}"\nsets = "b{i}.velocity"\nguess = {velocity}\nspread = 0.5\n'
            f'[[target]]\nname = "t{i}"\nvalue = "b{i}.position"\ntolerance = 1'
        )
    return "\n".join(lines)
