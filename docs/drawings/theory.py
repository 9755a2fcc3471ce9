"""Drawings of the theory pages: the step, the contact, the sweeps, the kernel, the joint."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, sin, sqrt

from style import BLUE, INK, ORANGE, Drawing, Point


def step_phases() -> Drawing:
    """Four phases of one substep, of a ball that falls onto the ground."""
    drawing = Drawing(760, 268, "Phases of a substep: predict, find impacts, solve velocities, move and store")
    titles = ("1-2  Predict", "3  Find contacts", "4-6  Solve velocities", "7-8  Move and store")
    notes = (
        ("free motion from the", "velocities without the", "last contact forces"),
        ("gap along the path,", "first root t* = time", "of impact"),
        ("impulses of contacts", "and joints, by sweeps", "of projections"),
        ("displacement, leftover", "overlap, lasting forces", "for the next step"),
    )
    for k, (title, lines) in enumerate(zip(titles, notes, strict=True)):
        x = 8 + 190 * k
        drawing.box((x, 8), 174, 252, shade=0.05)
        drawing.text((x + 87, 32), title, bold=True, anchor="middle")
        drawing.ground(168, x + 14, x + 160)
        drawing.lines((x + 87, 206), lines, size=12, step=16, anchor="middle")
        if k:
            drawing.arrow((x - 14, 100), (x - 2, 100), head=7)
    start, path = (36.0, 70.0), [(36 + 104 * s, 70 + 26 * s + 78 * s * s) for s in (j / 20 for j in range(21))]
    for k in range(4):
        x = 8 + 190 * k - 8
        points = [(px + x, py) for px, py in path]
        ball = (start[0] + x, start[1])
        at = (sqrt(26**2 + 4 * 78 * 80) - 26) / (2 * 78)  # 70 + 26 s + 78 s^2 = 150: the ball touches the ground
        touch = (36 + 104 * at + x, 150.0)
        if k < 2:
            drawing.curve(points, dash=True)
            drawing.circle(points[-1], 18, BLUE, 1.2)
            drawing.circle(ball, 18, fill=INK, shade=0.15)
        if k == 0:
            drawing.arrow(ball, (ball[0] + 34, ball[1] + 8), BLUE)
            drawing.text((ball[0] + 38, ball[1] + 8), "v", BLUE, italic=True)
        elif k == 1:
            drawing.circle((touch[0], 150), 18, ORANGE)
            drawing.dot((touch[0], 168), ORANGE)
            drawing.text((touch[0] + 16, 136), "t*", ORANGE, italic=True)
        elif k == 2:
            drawing.circle((touch[0], 150), 18, ORANGE)
            drawing.arrow((touch[0], 168), (touch[0] - 14, 112), ORANGE, 2.2)
            drawing.text((touch[0] - 20, 118), "impulse", ORANGE, size=12, anchor="end")
            drawing.arrow((touch[0], 150), (touch[0] + 38, 124), BLUE)
            drawing.text((touch[0] + 32, 116), "v^{+}", BLUE, italic=True)
        else:
            end = (touch[0] + 26, 124.0)
            before = [point for point in points if point[0] <= touch[0]]
            drawing.curve([*before[:-1], (touch[0], 150), end], width=1.6)
            drawing.circle(ball, 18, width=1.2)
            drawing.circle(end, 18, BLUE, fill=BLUE, shade=0.2)
            drawing.text((end[0] + 4, end[1] - 26), "x_{k+1}", BLUE, italic=True, anchor="middle")
    return drawing


def split_step() -> Drawing:
    """A step that is split at its first impact."""
    drawing = Drawing(650, 174, "A step is split at its first impact: substep, impact without duration, substep")
    y, x0, touch, x1 = 104.0, 40.0, 270.0, 600.0
    drawing.arrow((x0 - 20, y), (x1 + 30, y))
    drawing.text((x1 + 26, y + 20), "t", italic=True)
    for x, name in ((x0, "t_k"), (touch, "t*"), (x1, "t_{k+1}")):
        drawing.line((x, y - 7), (x, y + 7), colour=ORANGE if name == "t*" else INK, width=2.2)
        drawing.text((x, y + 26), name, ORANGE if name == "t*" else INK, italic=True, anchor="middle")
    drawing.box((x0 + 4, y - 58), touch - x0 - 10, 44, BLUE)
    drawing.text(((x0 + touch) / 2, y - 40), "substep", BLUE, anchor="middle", bold=True)
    drawing.text(((x0 + touch) / 2, y - 23), "fast contacts give no impulse", size=12, anchor="middle")
    drawing.box((touch + 6, y - 58), x1 - touch - 10, 44, BLUE)
    drawing.text(((x1 + touch) / 2, y - 40), "substep", BLUE, anchor="middle", bold=True)
    drawing.text(((x1 + touch) / 2, y - 23), "leapfrog restarts with lag 0", size=12, anchor="middle")
    drawing.arrow((touch, y - 76), (touch, y - 12), ORANGE)
    drawing.text((touch, y - 84), "impact: no time passes, only velocities change", ORANGE, size=12, anchor="middle")
    drawing.text(
        (touch, y + 56),
        "a later impact in the same step uses the next split, or waits for the next step",
        size=12,
        anchor="middle",
    )
    return drawing


def contact_frame() -> Drawing:
    """Gap, normal and arms of a contact, and its friction cone."""
    drawing = Drawing(720, 300, "Gap, normal and arms of a contact (left) and its friction cone (right)")
    # the gap between a box and the ground
    drawing.ground(240, 20, 340)
    drawing.box((86, 76), 150, 96, turn=-24)
    centre, corner = (161.0, 124.0), (112.0, 198.4)
    drawing.dot(centre)
    drawing.arrow(centre, (corner[0] + 2, corner[1] - 4), BLUE)
    drawing.text((140, 176), "r", BLUE, italic=True, anchor="start")
    drawing.text((164, 112), "centre of mass", size=12, anchor="middle")
    drawing.dot(corner, ORANGE)
    drawing.dot((corner[0], 240), ORANGE)
    drawing.line(corner, (corner[0], 240), colour=ORANGE, dash=True)
    drawing.text((corner[0] - 10, 224), "gap", ORANGE, anchor="end")
    drawing.arrow((262, 240), (262, 186), ORANGE)
    drawing.text((270, 200), "n", ORANGE, italic=True, bold=True)
    drawing.lines((180, 274), ("n points from the second surface to the first",), size=12, anchor="middle")
    # the friction cone
    tip, radius, height = (540.0, 240.0), 84.0, 168.0
    drawing.ground(240, 400, 690)
    rim = tip[1] - height
    drawing.path(
        f"M {tip[0]} {tip[1]} L {tip[0] - radius} {rim} A {radius} 20 0 0 0 {tip[0] + radius} {rim} Z",
        width=0,
        fill=ORANGE,
        shade=0.12,
    )
    drawing.path(
        f"M {tip[0] - radius} {rim} A {radius} 20 0 1 0 {tip[0] + radius} {rim} "
        f"A {radius} 20 0 1 0 {tip[0] - radius} {rim}",
        ORANGE,
    )
    drawing.line((tip[0] - radius, rim), tip, (tip[0] + radius, rim), colour=ORANGE)
    drawing.arrow(tip, (tip[0], rim - 40), INK)
    drawing.text((tip[0] + 8, rim - 30), "n", italic=True, bold=True)
    end = (tip[0] + 44, rim + 50)
    drawing.arrow(tip, end, BLUE, 2.4)
    drawing.text((end[0] - 4, end[1] - 8), "impulse", BLUE, size=12, anchor="middle")
    drawing.line(end, (end[0], 240), colour=BLUE, dash=True, width=1.2)
    drawing.line(end, (tip[0], end[1]), colour=BLUE, dash=True, width=1.2)
    drawing.text((end[0] + 6, 190), "normal", BLUE, size=12)
    drawing.text(((tip[0] + end[0]) / 2 + 2, 256), "tangent", BLUE, size=12, anchor="middle")
    drawing.arrow((tip[0] - 14, 222), (tip[0] - 78, 222), INK, 1.6)
    drawing.text((tip[0] - 84, 226), "slip u", anchor="end", size=12)
    drawing.text((545, 282), "|tangent| \u2264 friction \u00b7 normal", ORANGE, size=12, anchor="middle")
    return drawing


def time_of_impact() -> Drawing:
    """The gap along the predicted path over one step, with its first root."""
    drawing = Drawing(690, 262, "The gap along the predicted path; its first root in the step is the time of impact")
    x0, x1, zero = 60.0, 420.0, 180.0
    drawing.arrow((x0 - 20, zero), (x1 + 60, zero))
    drawing.arrow((x0, 236), (x0, 18))
    drawing.text((x0 - 10, 30), "gap", anchor="end")
    drawing.text((x1 + 58, zero + 20), "t", italic=True)
    for x, name in ((x0, "t_k"), (x1, "t_k + dt")):
        drawing.line((x, zero - 6), (x, zero + 6), width=2)
        drawing.text((x - 6 if x == x0 else x, zero + 24), name, italic=True, anchor="end" if x == x0 else "middle")

    def free(s: float) -> float:
        return 60 + 60 * s + 120 * s * s

    root = (-60 + sqrt(60**2 + 4 * 120 * 120)) / 240
    tx = x0 + root * (x1 - x0)
    samples = [j / 24 for j in range(25)]
    drawing.curve([(x0 + s * (x1 - x0), free(s)) for s in samples if s <= root] + [(tx, zero)])
    drawing.curve([(tx, zero)] + [(x0 + s * (x1 - x0), free(s)) for s in samples if s > root], dash=True, width=1.6)
    drawing.curve([(tx, zero), (x1, 112)], colour=ORANGE)
    drawing.dot((tx, zero), ORANGE, 4.5)
    drawing.text((tx - 4, zero + 24), "t*", ORANGE, italic=True, bold=True, anchor="middle")
    drawing.text((190, 76), "predicted path, free motion", BLUE, size=12)
    drawing.text((x1 + 10, 108), "after the impact", ORANGE, size=12)
    drawing.text((x1 + 10, 244), "prediction, not used", BLUE, size=12)
    drawing.box((516, 24), 160, 52, shade=0.05)
    drawing.lines((596, 46), ("t* is differentiated with", "respect to the state"), size=12, anchor="middle")
    return drawing


def sweep_order() -> Drawing:
    """Projected Gauss-Seidel: every constraint reads the velocities that the one before it left."""
    drawing = Drawing(760, 250, "Order of projected Gauss-Seidel: warm start, then sweeps over joints and contacts")
    names = ("joint 1", "joint 2", "contact A", "contact B", "contact C")
    drawing.box((10, 66), 104, 74, BLUE)
    drawing.lines((62, 92), ("warm start:", "forces of the", "last step"), size=12, step=16, anchor="middle")
    for k, name in enumerate(names):
        x, colour = 146 + 112 * k, INK if name.startswith("joint") else ORANGE
        drawing.box((x, 76), 88, 54, colour)
        drawing.text((x + 44, 98), name, colour, anchor="middle", bold=True, size=13)
        drawing.text((x + 44, 118), "project", size=12, anchor="middle")
        drawing.arrow((x - 22 if k else 116, 103), (x - 2, 103), BLUE, head=7)
    drawing.arrow((684, 103), (726, 103), BLUE)
    drawing.text((742, 107), "\u2026", BLUE, anchor="middle")
    drawing.text((146, 58), "one sweep: each projection reads the velocities that the previous one left", BLUE, size=12)
    drawing.path("M 638 134 C 638 186 638 190 600 190 L 230 190 C 192 190 190 186 190 142", BLUE)
    drawing.arrow((190, 146), (190, 133), BLUE)
    drawing.text((414, 182), "repeat: sweeps", BLUE, anchor="middle")
    drawing.text(
        (414, 212),
        "every fourth sweep, with large mass ratios: extrapolate the last change (17)",
        size=12,
        anchor="middle",
    )
    drawing.text((146, 30), "contact: normal impulse \u2265 0, then friction inside its cone", ORANGE, size=12)
    drawing.text((414, 236), "result: velocities after the step, accumulated impulses", anchor="middle", size=12)
    return drawing


def file_to_kernel() -> Drawing:
    """From a problem file to lanes: world and formulas, graphs of functions, list of calls, C code, lanes."""
    drawing = Drawing(780, 226, "From problem file to kernel: problem, graphs of functions, calls, C code, lanes")
    stages = (
        ("problem file", ("bodies, joints,", "objectives")),
        ("graphs", ("one per kind of", "function; adjoints")),
        ("calls", ("function, places", "in a flat memory")),
        ("C code", ("one C function", "per graph; driver")),
        ("lanes", ("one rollout each;", "threads for blocks")),
    )
    for k, (name, lines) in enumerate(stages):
        x = 8 + 156 * k
        colour = BLUE if name == "lanes" else ORANGE if name in ("graphs", "calls") else INK
        drawing.box((x, 8), 134, 206, colour, shade=0.06)
        drawing.text((x + 67, 32), name, colour, anchor="middle", bold=True)
        drawing.lines((x + 67, 182), lines, size=12, step=16, anchor="middle")
        if k:
            drawing.arrow((x - 20, 104), (x - 3, 104), head=8)
    for j, line in enumerate(("[[body]]", 'shape = "box"', "[[pair]]", "[[target]]")):
        drawing.text((22, 74 + 20 * j), line, size=12, mono=True)
    nodes: dict[str, Point] = {"a": (196, 70), "b": (266, 70), "*": (231, 102), "c": (196, 112), "+": (222, 142)}
    for start, end in (("a", "*"), ("b", "*"), ("*", "+"), ("c", "+")):
        (x, y), (u, v) = nodes[start], nodes[end]
        length = sqrt((u - x) ** 2 + (v - y) ** 2)
        drawing.arrow(
            (x + 9 * (u - x) / length, y + 9 * (v - y) / length),
            (u - 10 * (u - x) / length, v - 10 * (v - y) / length),
            ORANGE,
            1.3,
            5,
        )
    for name, (x, y) in nodes.items():
        drawing.circle((x, y), 9, ORANGE)
        drawing.text((x, y + 4), name, ORANGE, size=12, anchor="middle")
    for j, line in enumerate(("f0(s0, p) \u2192 s1", "f1(s1) \u2192 c1", "f1(s2) \u2192 c2", "f2(c1, c2)\u2192 s3")):
        drawing.text((330, 74 + 20 * j), line, ORANGE, size=11, mono=True)
    for j, line in enumerate(("V v2 = i0[1];", "V v4 = i1[0];", "V v5 = v2*v4;", "o0[1] = v8;")):
        drawing.text((488, 74 + 20 * j), line, size=11.5, mono=True)
    for row in range(4):
        for lane in range(8):
            drawing.box((650 + 13.5 * lane, 62 + 23 * row), 11, 17, BLUE, shade=0.12 + 0.1 * (row % 2), round_=2)
    return drawing


def joint_tree() -> Drawing:
    """A robot's kinematic tree, with a coordinate per joint and a loop that is closed by a constraint."""
    drawing = Drawing(740, 262, "A kinematic tree: coordinates along joints, contacts at feet, a joint closing a loop")
    drawing.ground(226, 20, 330)
    drawing.box((90, 40), 170, 34, fill=INK)
    drawing.text((175, 62), "root", anchor="middle")

    def leg(hip: Point, angles: tuple[float, float], lengths: tuple[float, float] = (76, 76)) -> Point:
        knee = (hip[0] + lengths[0] * sin(angles[0]), hip[1] + lengths[0] * cos(angles[0]))
        foot = (knee[0] + lengths[1] * sin(angles[1]), knee[1] + lengths[1] * cos(angles[1]))
        drawing.line(hip, knee, foot, colour=INK, width=7)
        for joint in (hip, knee):
            drawing.circle(joint, 7, BLUE, fill=BLUE, shade=0.25)
        drawing.dot(foot, ORANGE, 6)
        return foot

    left, right = leg((110, 78), (-0.35, 0.25)), leg((240, 78), (0.35, -0.2))
    drawing.arrow((left[0], 224), (left[0], 178), ORANGE)
    drawing.text((left[0] + 10, 196), "impulse", ORANGE, size=12)
    drawing.path("M 96 92 A 20 20 0 0 0 118 102", BLUE)
    drawing.text((62, 108), "q_1", BLUE, italic=True)
    drawing.text((60, 162), "q_2", BLUE, italic=True)
    drawing.text((286, 112), "q_3", BLUE, italic=True)
    drawing.text((right[0] + 42, 160), "q_4", BLUE, italic=True)
    # the factored matrix
    x, y, cell = 420.0, 46.0, 24.0
    drawing.text((x + 60, 30), "mass matrix of the tree", anchor="middle", size=12)
    for row in range(5):
        for column in range(5):
            filled = row == 0 or column == 0 or ((row - 1) // 2 == (column - 1) // 2)
            colour = BLUE if row and column else INK
            if filled:
                drawing.box((x + cell * column, y + cell * row), cell - 3, cell - 3, colour, shade=0.25, round_=3)
    drawing.lines(
        (560, 72),
        ("root (grey) couples", "with every branch;", "branches (blue) do not", "couple with each other"),
        size=12,
    )
    drawing.lines(
        (420, 200),
        (
            "a push on a foot moves all bodies of its tree:",
            "momentum = J\u1d40 \u00b7 impulse, solved branch by branch,",
            "with the Schur complement on the root",
        ),
        size=12,
    )
    return drawing


DRAWINGS: dict[str, Callable[[], Drawing]] = {
    "step_phases": step_phases,
    "split_step": split_step,
    "contact_frame": contact_frame,
    "time_of_impact": time_of_impact,
    "sweep_order": sweep_order,
    "file_to_kernel": file_to_kernel,
    "joint_tree": joint_tree,
}
