"""Draw a problem's motion before anything is solved, as a figure and as a page."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from symphys import problems
from symphys.api.transcriptions import transcribed
from symphys.api.values import vector
from symphys.problem import Problem, is_robot, robot_alone
from symphys.problem.problem import Source, load
from symphys.results.scene_of_problem import make_scene

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def show(
    problem: Source,
    values: Mapping[str, ArrayLike] | None = None,
    /,
    *,
    page: str | Path | None = None,
    **variables: ArrayLike,
) -> Figure:
    """Draw the motion of a problem from the side and from above, with its guess or with other values.

    Args:
        problem: any argument of ``load``, or a robot by itself: a shipped one, ``"robots/arm.toml"``, or a file that
            problems may include. A robot falls to the ground; motors that track an angle or a position hold the start.
        values: values of variables by name: (components,), or (knots, components).
        page: an HTML file to write as well; it plays the motion, and draws states, joints and contacts.
        variables: the same as ``values``, for names that are Python words.

    Returns:
        A matplotlib figure.

    Raises:
        NotFinite: a number of the motion is not finite; names the time step and the body.
        SymphysError: there is no such problem or variable, or the shape of its values does not fit.

    Example:
        >>> import symphys
        >>> figure = symphys.show("ball_throw", throw=[10, 0, 2], page="throw.html")
        >>> [axes.get_title(loc="left") for axes in figure.axes]
        ['Side view', 'Top view']
    """
    from symphys.report import write_motion_page
    from symphys.report.figures import style
    from symphys.report.scene.motion import draw_motion

    read_in = shown(problem)
    made = transcribed(read_in, True, "casadi")
    z = vector(made.shooting, {**(values or {}), **variables})
    motion = made.simulate(z)
    scene = make_scene(read_in, made.shooting.by_block(z), motion)
    if page is not None:
        write_motion_page(motion, scene, Path(page), title=read_in.title)
    with style.paper():
        return draw_motion(motion, scene)


def shown(source: Source) -> Problem:
    """Load a problem, or make one of a robot by itself."""
    if isinstance(source, str | Path):
        path = Path(source)
        if path.is_file() and is_robot(path):
            return robot_alone(path)
        if isinstance(source, str) and not path.exists() and source not in problems.catalogue():
            part = problems.shipped(source)
            if problems.is_part(part):
                return robot_alone(part)
    return load(source)
