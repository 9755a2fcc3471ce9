"""Bodies above each other and the joints between them, as text of problem files."""

from __future__ import annotations

HINGE, SLIDER = "hinge = { axis = [0, 1, 0] }", "slider = { axis = [1, 0, 0] }"
UNIVERSAL = "universal = { axes = [[0, 1, 0], [1, 0, 0]] }"


def body(name: str, z: float, more: str = "", inertia: str = "1") -> str:
    return f'[[body]]\nname = "{name}"\nmass = 1\ninertia = {inertia}\nposition = [0, 0, {z}]\n{more}\n'


def joint(name: str, ends: str, z: float, more: str = "", kind: str = HINGE) -> str:
    first, second = ends.split()
    return f'[[joint]]\nname = "{name}"\nbetween = ["{first}", "{second}"]\n{kind}\npoint = [0, 0, {z}]\n{more}\n'
