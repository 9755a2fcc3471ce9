"""Parts of a URDF that MuJoCo does not keep: motors, speeds, mimics, and which link is the root."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import field
from typing import Literal
from xml.etree import ElementTree
from xml.parsers import expat

from symphys.importing.records import Finding, JointMotor, counted, listed
from symphys.records import dataclass

Base = Literal["auto", "free", "fixed"]
WORLD = "world"
"""The link that MuJoCo takes for the world."""
MOVING_KINDS = ("revolute", "continuous", "prismatic", "floating", "planar", "spherical")
UNREAD_ELEMENTS = {
    "visual": "meshes and colours for pictures; pictures show the shapes that touch things",
    "gazebo": "settings of another simulator",
    "sensor": "sensors of URDF; add [[sensor]] tables",
    "safety_controller": "limits of a controller on the robot",
    "calibration": "reference positions of encoders",
    "verbose": "meshes by another name",
}
"""Elements that nothing reads, and their purpose."""


@dataclass(frozen=True)
class Mimic:
    """A joint that follows another: its coordinate = multiplier * that of the other + offset."""

    joint: str
    follows: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class JointText:
    """A joint as the file has it.

    Attributes:
        name: of the joint.
        kind: "revolute", ...
        parent: name of a link.
        child: name of a link.
        effort: [N m] or [N]; None: not said.
        velocity: [rad/s] or [m/s]; None: not said.
        mimic: the joint that it follows.
    """

    name: str
    kind: str
    parent: str
    child: str
    effort: float | None = None
    velocity: float | None = None
    mimic: Mimic | None = None


@dataclass(frozen=True)
class UrdfText:
    """The parts of a URDF that matter here.

    Attributes:
        joints: all, in their order.
        driven: names of joints with a transmission; each once.
        links: names of all links.
        lost: how many elements of each name there are that nothing reads.
    """

    joints: tuple[JointText, ...] = ()
    driven: tuple[str, ...] = ()
    links: tuple[str, ...] = ()
    lost: dict[str, int] = field(default_factory=dict)


def read_urdf(text: bytes) -> UrdfText:
    """Read a checked text."""
    root = tree(text)
    joints = tuple(joint(each) for each in root.findall("joint"))
    driven = dict.fromkeys(name for each in root.iter("transmission") for name in driven_by(each))
    links = tuple(each.get("name", "") for each in root.findall("link"))
    lost = {tag: sum(1 for _ in root.iter(tag)) for tag in UNREAD_ELEMENTS}
    return UrdfText(joints, tuple(driven), links, {tag: count for tag, count in lost.items() if count})


def tree(text: bytes) -> ElementTree.Element:
    """Return the elements with the names that the file writes: prefixes are often not bound."""
    builder, parser = ElementTree.TreeBuilder(), expat.ParserCreate("UTF-8")
    parser.StartElementHandler, parser.EndElementHandler = builder.start, builder.end
    parser.CharacterDataHandler = builder.data
    parser.Parse(text, True)
    return builder.close()


def joint(element: ElementTree.Element) -> JointText:
    """Read one joint."""
    limit, mimic = element.find("limit"), element.find("mimic")
    name = element.get("name", "")
    follows = None
    if mimic is not None and mimic.get("joint"):
        multiplier, offset = value(mimic, "multiplier"), value(mimic, "offset")
        follows = Mimic(name, mimic.get("joint", ""), 1.0 if multiplier is None else multiplier, offset or 0.0)
    return JointText(
        name,
        element.get("type", ""),
        linked(element, "parent"),
        linked(element, "child"),
        value(limit, "effort"),
        value(limit, "velocity"),
        follows,
    )


def linked(element: ElementTree.Element, key: str) -> str:
    """Return the link that a joint names."""
    found = element.find(key)
    return "" if found is None else found.get("link", "")


def value(element: ElementTree.Element | None, key: str) -> float | None:
    """Return the number that an attribute gives; None if it gives none."""
    try:
        found = float("" if element is None else element.get(key, ""))
    except ValueError:
        return None
    return None if math.isnan(found) else found


def driven_by(transmission: ElementTree.Element) -> Iterator[str]:
    """Yield the names of the joints that a transmission drives."""
    for each in transmission.iter("joint"):
        name = each.get("name") or (each.text or "").strip()
        if name:
            yield name


def branches(urdf: UrdfText, root: str) -> int:
    """Return how many moving joints leave the root link and everything that is fixed to it."""
    held, count = [root], 0
    children: dict[str, list[JointText]] = {}
    for each in urdf.joints:
        children.setdefault(each.parent, []).append(each)
    seen = {root}
    while held:
        for each in children.get(held.pop(), ()):
            count += each.kind in MOVING_KINDS
            if each.kind not in MOVING_KINDS and each.child not in seen:
                seen.add(each.child)
                held.append(each.child)
    return count


def base_floats(urdf: UrdfText, root: str, base: Base) -> tuple[bool, Finding]:
    """Return whether the root link floats, and the finding on the reason.

    A file with a link "world" says what is fixed. Without one, a root from which a single moving joint leaves is the
    foot of an arm, and stands still. All others are bodies that go somewhere, and float.
    """
    count = branches(urdf, root)
    how = "base = 'free' or 'fixed' decides otherwise"
    what = f"root link {root}"
    if base != "auto":
        word = "floats" if base == "free" else "is fixed to the world"
        return base == "free", Finding("recovered", what, f"it {word}, as was asked for")
    if WORLD in urdf.links:
        return False, Finding("taken", what, f"it is fixed to the world, by the link 'world'; {how}")
    if count == 1:
        text = f"it is fixed to the world, since a single moving joint leaves it, as of an arm; {how}"
        return False, Finding("recovered", what, text)
    text = f"it floats, since {counted(count, 'moving joint')} leave it and no link is called 'world'; {how}"
    return True, Finding("recovered", what, text)


def motors(urdf: UrdfText) -> tuple[dict[str, JointMotor], list[Finding]]:
    """Return motors by joint: of transmissions, or, in a file without any, of all joints with an effort."""
    found, findings = dict[str, JointMotor](), list[Finding]()
    driven = set(urdf.driven) or {each.name for each in urdf.joints}
    weak, endless = [], []
    for each in urdf.joints:
        if each.name not in driven or each.kind not in MOVING_KINDS or (each.mimic and not urdf.driven):
            continue
        if each.effort is None or each.effort <= 0:
            weak += [each.name] if urdf.driven else []
        elif math.isinf(each.effort):
            endless.append(each.name)
        else:
            found[each.name] = JointMotor(each.effort, math.inf if each.velocity is None else each.velocity)
    source = "transmissions, with the effort of the joint's limit" if urdf.driven else "the effort of joint limits"
    if found:
        text = f"MuJoCo makes no motors of URDF; they are torque motors from {source}"
        findings.append(Finding("recovered", counted(len(found), "motor"), text))
    for names, text in (
        (weak, "it has a transmission and no effort above 0, thus no motor"),
        (endless, "its effort is infinite, thus no motor"),
    ):
        if names:
            findings.append(Finding("left out", f"motor of {listed(names)}", text))
    unknown = sorted(set(urdf.driven) - {each.name for each in urdf.joints})
    if unknown:
        findings.append(Finding("left out", f"transmission of {listed(unknown)}", "the file has no joint of that name"))
    return found, findings + speeds(urdf)


def speeds(urdf: UrdfText) -> list[Finding]:
    """Return the finding on velocity limits, which nothing enforces."""
    moving = [each for each in urdf.joints if each.kind in MOVING_KINDS]
    given = [each.velocity for each in moving if each.velocity and math.isfinite(each.velocity)]
    if not given:
        return []
    text = "nothing slows a joint at its velocity limit; add a [[constraint]] on its velocity"
    amount = f"{min(given):.4g} to {max(given):.4g} rad/s or m/s"
    return [Finding("left out", counted(len(given), "velocity limit"), text, amount)]


def lost_elements(urdf: UrdfText) -> list[Finding]:
    """Return findings on elements that nothing reads."""
    return [
        Finding("left out", f"{count} <{tag}>", f"{UNREAD_ELEMENTS[tag]}")
        for tag, count in urdf.lost.items()
        if tag in UNREAD_ELEMENTS
    ]


def lost_mimics(urdf: UrdfText, kept: Sequence[str]) -> tuple[tuple[Mimic, ...], list[Finding]]:
    """Return the mimics that a model does not have as couplings, with findings; ``kept``: joints that it couples."""
    lost = tuple(each.mimic for each in urdf.joints if each.mimic is not None and each.name not in kept)
    known = {each.name for each in urdf.joints if each.kind in ("revolute", "continuous", "prismatic")}
    usable = tuple(each for each in lost if each.joint in known and each.follows in known)
    findings = []
    if usable:
        names = listed([each.joint for each in usable])
        findings.append(Finding("recovered", f"mimic of {names}", "MuJoCo lost it; it is a coupling of joints"))
    refused = [each.joint for each in lost if each not in usable]
    if refused:
        text = "both joints of a coupling must be hinges or sliders of this file"
        findings.append(Finding("left out", f"mimic of {listed(refused)}", text))
    return usable, findings
