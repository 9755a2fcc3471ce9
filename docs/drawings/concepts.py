"""Drawings of the pages in `docs/concepts`."""

from __future__ import annotations

from math import cos, exp, pi, radians, sin, sqrt

from style import BLUE, INK, ORANGE, Drawing, Point


def along(start: Point, angle: float, length: float) -> Point:
    """Return the point at a distance [px] from another one; `angle` [degrees] counts from x towards y, upwards."""
    return start[0] + length * cos(radians(angle)), start[1] - length * sin(radians(angle))


def arc(centre: Point, radius: float, first: float, last: float) -> list[Point]:
    """Return points on an arc between two angles [degrees]."""
    return [along(centre, first + (last - first) * k / 24, radius) for k in range(25)]


def axes(drawing: Drawing, origin: Point, width: float, height: float, across: str, up: str) -> None:
    """Draw two axes of a chart with their names."""
    x, y = origin
    drawing.arrow(origin, (x + width, y))
    drawing.arrow(origin, (x, y - height))
    drawing.text((x + width, y + 18), across, anchor="end")
    drawing.text((x + 8, y - height + 6), up)


def frames() -> Drawing:
    """World frame, body frame at the centre of mass, joint, site."""
    d = Drawing(720, 330, "World frame, body frame and joint of an arm with two links.")
    d.ground(290, 20, 700)
    d.arrow((70, 290), (70, 200), BLUE)
    d.arrow((70, 290), (170, 290), BLUE)
    d.circle((70, 290), 7, BLUE)
    d.line((65, 285), (75, 295), colour=BLUE)
    d.line((65, 295), (75, 285), colour=BLUE)
    d.text((80, 205), "z, up", BLUE)
    d.text((150, 280), "x", BLUE)
    d.text((12, 268), "y, away", BLUE, size=12)
    d.text((12, 282), "from you", BLUE, size=12)
    d.text((20, 318), "world frame, z = 0 on the ground", size=12)

    shoulder = (270.0, 288.0)
    elbow = along(shoulder, 72, 150)
    hand = along(elbow, 18, 240)
    for start, end, length, angle in ((shoulder, elbow, 150, 72), (elbow, hand, 240, 18)):
        middle = ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2)
        d.box((middle[0] - length / 2, middle[1] - 13), length, 26, round_=13, turn=-angle)
    d.dot(shoulder, INK, 5)
    d.circle(elbow, 7, ORANGE, 2.2)
    d.dot(elbow, ORANGE, 2.5)
    d.line(elbow, along(elbow, 72, 72), dash=True)
    d.curve(arc(elbow, 58, 72, 22), ORANGE, 1.8)
    tip = along(elbow, 22, 58)
    d.arrow(along(elbow, 27, 58.5), tip, ORANGE)
    d.text((elbow[0] - 12, elbow[1] - 80), "elbow.angle", ORANGE, anchor="end", mono=True, size=13)
    d.text((elbow[0] - 12, elbow[1] - 62), "second body against the first", size=12, anchor="end")
    d.text((elbow[0] - 20, elbow[1] + 8), "axis and point in world axes", size=12, anchor="end")

    centre = along(elbow, 18, 125)
    d.arrow(centre, along(centre, 18, 62), BLUE)
    d.arrow(centre, along(centre, 108, 62), BLUE)
    d.dot(centre, BLUE, 4)
    d.line((70, 290), centre, colour=BLUE, width=1.2, dash=True)
    d.text((centre[0] + 4, centre[1] - 68), "body frame", BLUE)
    d.text((centre[0] + 16, centre[1] + 42), "forearm.position", BLUE, mono=True, size=13)
    d.text((centre[0] + 16, centre[1] + 60), "centre of mass, in world axes", size=12)
    d.dot(hand, ORANGE, 4.5)
    d.text((hand[0] + 12, hand[1] - 6), "site", ORANGE)
    d.text((hand[0] + 12, hand[1] + 14), "tip.position", ORANGE, mono=True, size=13)
    return d


def shooting() -> Drawing:
    """Single shooting, multiple shooting, differential dynamic programming."""
    d = Drawing(720, 250, "Three ways to shoot: one simulation, many arcs, feedback about a motion.")
    titles = ("Single shooting", "Multiple shooting", "DDP (ilqr)")
    for k, title in enumerate(titles):
        x = 20 + 240 * k
        d.text((x, 24), title, bold=True)
        axes(d, (x, 190), 205, 140, "time", "state")
        d.circle((x + 185, 95), 7, ORANGE, 2)
        d.dot((x + 185, 95), ORANGE, 2.5)
    d.text((205, 76), "target", ORANGE, size=12, anchor="middle")

    def motion(x: float, start: float, end: float) -> float:
        share = (x - start) / (end - start)
        return 165 - 70 * share * share * (3 - 2 * share)

    for end, dash in ((40, True), (18, True), (0, False)):
        curve = [(20 + x, motion(x, 0, 185) + end * (x / 185) ** 2) for x in range(0, 186, 5)]
        d.curve(curve, BLUE, 2 if not dash else 1.3, dash)
    d.dot((20, 165), BLUE)
    d.text((20, 228), "z sets the start and the controls", size=12)

    for k in range(4):
        first, last = 46.25 * k, 46.25 * (k + 1)
        low = motion(first, 0, 185) + (14 if k else 0)
        slope = (-0.25, -0.72, -0.72, -0.42)[k]
        points = [(260 + x, low + slope * (x - first) - 0.002 * (x - first) ** 2) for x in (first, last - 23, last)]
        d.curve(points, BLUE)
        d.dot((260 + first, low), BLUE)
        if k < 3:
            target = motion(last, 0, 185) + 14
            d.line((260 + last, points[-1][1]), (260 + last, target), colour=ORANGE, width=2)
    d.text((360, 160), "gaps close", ORANGE, size=12)
    d.text((260, 228), "z and the states at nodes vary", size=12)

    curve = [(500 + x, motion(x, 0, 185)) for x in range(0, 186, 5)]
    for side in (-1, 1):
        d.curve([(x, y + side * (4 + 16 * exp(-((x - 580) ** 2) / 5000))) for x, y in curve], INK, 1, True)
    d.curve(curve, BLUE)
    for x in (45, 90, 135):
        y = motion(x, 0, 185)
        for side in (-1, 1):
            d.arrow((500 + x, y + side * 22), (500 + x, y + side * 5), ORANGE, 1.5, 6)
    d.dot((500, 165), BLUE)
    d.text((560, 60), "feedback", ORANGE, size=12)
    d.text((500, 228), "a gain for the control of each step", size=12)
    return d


def contact() -> Drawing:
    """The gap with its root, the friction cone, an impact."""
    d = Drawing(720, 270, "Gap and time of impact, friction cone, restitution.")
    d.text((20, 24), "Gap and time of impact", bold=True)
    d.arrow((30, 150), (220, 150))
    d.arrow((30, 210), (30, 45))
    d.text((38, 52), "gap g")
    d.text((222, 170), "t", anchor="end")
    fall = [(30 + x, 75 + 0.0047 * x * x) for x in range(0, 127, 3)]
    d.curve(fall, BLUE)
    d.curve([(30 + x, 75 + 0.0047 * x * x) for x in range(126, 162, 3)], INK, 1.3, True)
    d.curve([(156 + x, 150 - 0.85 * x + 0.0047 * x * x) for x in range(0, 61, 3)], BLUE)
    d.dot((156, 150), ORANGE, 5)
    d.text((150, 172), "t^{*}", ORANGE, anchor="end")
    d.line((30, 205), (30, 218))
    d.line((216, 205), (216, 218))
    d.line((30, 211), (216, 211), width=1)
    d.text((123, 232), "one time step", size=12, anchor="middle")
    d.text((30, 256), "g(t^{*}) = 0, with its derivative", size=12)

    d.text((270, 24), "Friction cone", bold=True)
    tip = (360.0, 190.0)
    d.path("M 300 80 L 360 190 L 420 80 A 60 14 0 0 1 300 80 Z", ORANGE, 1.5, fill=ORANGE, shade=0.12)
    d.path("M 300 80 A 60 14 0 0 1 420 80", ORANGE, 1.5)
    d.arrow(tip, (360, 62), INK)
    d.text((367, 64), "p_n")
    d.arrow(tip, (386, 96), BLUE, 2.2)
    d.text((392, 116), "p", BLUE)
    d.arrow((360, 80), (420, 80), ORANGE, 1.5, 7)
    d.text((428, 84), "μ p_n", ORANGE)
    d.ground(192, 280, 450)
    d.text((270, 232), "inside: sticks; on the edge: slides", size=12)
    d.text((270, 256), "|p_t| ≤ μ p_n", size=12)

    d.text((500, 24), "Restitution", bold=True)
    d.ground(192, 500, 700)
    for x, filled in ((545, 0.12), (640, 0.3)):
        d.circle((x, 166), 25, INK, fill=INK, shade=filled)
    d.arrow((545, 166), (575, 112), BLUE, 2.2)
    d.arrow((515, 112), (541, 158), BLUE, 2.2)
    d.text((503, 104), "v^{-}", BLUE)
    d.text((580, 112), "v^{+}", BLUE)
    d.arrow((640, 191), (640, 92), ORANGE, 2.2)
    d.arrow((640, 191), (612, 191), ORANGE, 2.2)
    d.text((648, 100), "p_n", ORANGE)
    d.text((608, 184), "p_t", ORANGE, anchor="end")
    d.text((500, 232), "v^{+} = -e v^{-} along the normal", size=12)
    d.text((500, 256), "less if energy would rise", size=12)
    return d


def smoothing() -> Drawing:
    """The smooth maximum, a sled that friction holds, a miss."""
    d = Drawing(720, 285, "What smoothing changes, and a miss that it does not change.")
    names = ("exact", "small smoothing", "large smoothing")
    widths = ((INK, 0.0), (BLUE, 22.0), (ORANGE, 50.0))

    d.text((20, 24), "The smooth maximum", bold=True)
    axes(d, (20, 190), 200, 140, "x", "max(x, 0)")
    d.line((110, 190), (110, 195))
    d.text((110, 208), "0", size=12, anchor="middle")
    for colour, w in widths:
        points = [(110 + x, 190 - (x + sqrt(x * x + w * w)) / 2) for x in range(-88, 97, 4)]
        d.curve(points, colour, 2)
    d.text((20, 240), "Its slope is never zero.", size=12)

    d.text((260, 24), "Friction holds a sled", bold=True)
    axes(d, (260, 190), 205, 140, "push", "distance")
    for colour, w in widths:
        points = [(260 + x, 190 - 1.05 * ((x - 95) + sqrt((x - 95) ** 2 + w * w)) / 2) for x in range(4, 187, 4)]
        d.curve(points, colour, 2)
    d.line((355, 185), (355, 195))
    d.text((355, 208), "μ m g", size=12, anchor="middle")
    d.text((260, 240), "Smoothing gives a gradient.", size=12)

    d.text((500, 24), "A ball misses", bold=True)
    axes(d, (500, 190), 205, 140, "aim", "distance of the other ball")
    for colour, w in widths:
        throw = [0 if x < 120 else 72 * sin(pi * (x - 120) / 130) for x in range(4, 187, 2)]
        points = [(504 + 2 * k, 188 - y - w / 40) for k, y in enumerate(throw)]
        d.curve(points, colour, 2 if w == 0 else 1.4)
    d.dot((545, 188), ORANGE, 5)
    d.text((545, 174), "guess", ORANGE, size=12, anchor="middle")
    d.text((660, 100), "hits", size=12, anchor="middle")
    d.text((500, 240), "Every curve is flat at the guess.", size=12)

    for k, (colour, words) in enumerate(zip((INK, BLUE, ORANGE), names, strict=True)):
        x = 24 + 160 * k
        d.line((x, 268), (x + 20, 268), colour=colour, width=2)
        d.text((x + 26, 272), words, size=12)
    return d


def trust() -> Drawing:
    """From the point of a solver to the verdict."""
    d = Drawing(720, 300, "From the solver's point to the verdict.")

    def step(x: float, y: float, width: float, title: str, lines: list[str], colour: str, height: float = 0) -> None:
        d.box((x, y), width, height or 34 + 18 * len(lines), colour)
        d.text((x + width / 2, y + 23), title, colour, anchor="middle", bold=True)
        for k, line in enumerate(lines):
            d.text((x + width / 2, y + 44 + 18 * k), line, size=12, anchor="middle")

    step(14, 100, 128, "Solver", ["any method,", "any smoothing"], INK)
    d.arrow((142, 135), (186, 135))
    d.text((164, 125), "z", anchor="middle", italic=True)
    step(188, 90, 150, "Exact simulation", ["smoothing 0,", "checked step by step"], BLUE, 86)
    d.arrow((338, 115), (394, 68))
    d.arrow((338, 152), (394, 190))
    step(396, 24, 150, "Request", ["targets, constraints,", "goal: met or missed"], BLUE)
    step(
        396,
        116,
        150,
        "Doubts",
        ["finer time steps", "energy, momentum", "overlap, tunnelling", "contact residual", "growth of errors"],
        ORANGE,
    )
    d.arrow((546, 60), (592, 60))
    d.arrow((546, 180), (592, 180))
    d.box((594, 24), 116, 34, BLUE)
    d.text((652, 46), "solved", BLUE, anchor="middle", bold=True)
    d.box((594, 68), 116, 34, INK)
    d.text((652, 90), "not solved", anchor="middle")
    d.box((594, 156), 116, 50, ORANGE)
    d.text((652, 177), "met, but not", ORANGE, anchor="middle")
    d.text((652, 195), "to be trusted", ORANGE, anchor="middle")
    d.text(
        (396, 268),
        "One doubt is enough. A run without doubts that meets everything is solved.",
        size=12,
        anchor="middle",
    )
    return d


DRAWINGS = {
    "concepts_frames": frames,
    "concepts_shooting": shooting,
    "concepts_contact": contact,
    "concepts_smoothing": smoothing,
    "concepts_trust": trust,
}
