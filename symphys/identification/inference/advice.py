"""Which recording determines what kind of quantity: a table by the words of its name."""

from __future__ import annotations

from collections.abc import Iterable

ADVICE: dict[str, tuple[str, ...]] = {
    "record a collision with a body of known mass, or a motion under a known force or a motor's torque: under gravity "
    "and contact with fixed surfaces alone, masses cancel": ("mass", "density"),
    "record spins about several axes that a known torque or an off-centre collision changes": ("inertia", "moments"),
    "record tosses that spin freely about two axes, or let the body rest in several poses": (
        "center",
        "centre",
        "com",
        "center_of_mass",
        "centre_of_mass",
    ),
    "record a long slide, or a toss that lands with speed along the ground and little spin": ("friction", "mu"),
    "record bounces from several heights, up to the second impact": ("restitution", "bounce"),
    "record a long roll without sliding": ("rolling", "rolling_friction"),
    "record a spin about the vertical on one contact": ("torsional", "torsion", "torsional_friction", "spinning"),
    "record free flight, with lengths that are measured by a ruler": ("gravity",),
    "record a fall of known height, or measure a length by a ruler: without gravity or a known length, scales are "
    "free": ("scale", "length_scale", "size", "radius", "half_size", "length", "width", "thickness"),
    "record the body at rest in two places, one of them known": (
        "position",
        "offset",
        "height",
        "tilt",
        "x",
        "y",
        "z",
    ),
    "let the joint swing out freely from several speeds": ("damping", "drag", "viscosity"),
    "let the joint swing out to rest: its last swings show the dry friction": ("dry_friction", "coulomb", "armature"),
    "record a deflection under a known force, or the period of free swings with a known mass": ("stiffness", "spring"),
    "record the motor's answer to steps of known torque, with a known inertia": ("gain", "torque", "kp", "kd", "motor"),
    "record fast changes of the command: delays act only where something changes": ("delay", "latency", "time_offset"),
}
"""Sentence by the words that ask for it."""
GENERAL = "record motions that differ in this quantity alone, hold it at a known value, or give it a prior"


def advice(quantities: Iterable[str]) -> str:
    """A sentence for each kind among quantities such as ``cube.mass``, ``cube.size[2]``, in their order."""
    found = []
    for quantity in quantities:
        last = quantity.split(".")[-1].split("[")[0].strip().lower()
        fitting = [(len(word), text) for text, words in ADVICE.items() for word in words if is_kind(last, word)]
        said = max(fitting, default=(0, GENERAL))[1]
        if said not in found:
            found.append(said)
    specific = [text for text in found if text != GENERAL] or found
    joined = "; or ".join(specific)
    return joined[0].upper() + joined[1:]


def is_kind(name: str, word: str) -> bool:
    """Whether a name is the word, or ends or begins with it as a word of its own."""
    return name == word or name.endswith(("_" + word, " " + word)) or name.startswith(word + "_")
