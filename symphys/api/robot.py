"""Robots read from MJCF and URDF files: their tables, what became of their parts, problems about them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from html import escape
from math import inf
from pathlib import Path
from typing import Any, Literal

from symphys.files import write_text
from symphys.importing.records import Finding, ImportOptions
from symphys.importing.robot import Imported, read_robot
from symphys.importing.writing import HEADINGS, described, robot_text, sentence
from symphys.problem import Problem, problem_of_tables
from symphys.problem.robot_alone import lowest, stands
from symphys.records import dataclass


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot that was read from another program's model.

    Attributes:
        imported: the tables of the robot and the findings of the import.
    """

    imported: Imported

    @property
    def title(self) -> str:
        """The title of the model."""
        return self.imported.title

    @property
    def tables(self) -> dict[str, Any]:
        """The tables of a problem file, as ``[[include]]`` takes them: ``body``, ``joint``, ... in m and rad."""
        return self.imported.tables

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The fate of each part of the model: taken, approximated, left out, or recovered from its file."""
        return self.imported.findings

    def text(self) -> str:
        """Return the robot as the text of a file for ``[[include]]``."""
        return robot_text(self.imported)

    def save(self, path: str | Path) -> Path:
        """Write a file for ``[[include]]`` and return its path.

        Raises:
            SymphysError: the file cannot be written.
        """
        write_text(Path(path), self.text())
        return Path(path)

    def problem(self, duration: float = 1.0, dt: float = 0.01, ground: bool = True, **tables: Any) -> Problem:
        """Make a problem about the robot.

        Args:
            duration: duration [s], a whole number of steps.
            dt: time step [s].
            ground: whether a floating robot whose model has no static surface gets a ground at its lowest point.
            tables: further tables of a problem file: ``variable=[{...}]``, ``solver={...}``. Lists are appended to the
                robot's.

        Raises:
            ProblemError: names every fault found, each with table and key.
        """
        whole: dict[str, Any] = {"title": self.title, "simulation": {"duration": duration, "dt": dt}}
        for key, value in (*self.tables.items(), *tables.items()):
            whole[key] = joined(whole.get(key), value)
        name = self.imported.file.stem
        if ground and not stands(whole):
            low = lowest(problem_of_tables(whole, name))
            whole["ground"] = {"height": low} if low < inf else {}
        return problem_of_tables(whole, name)

    def __str__(self) -> str:
        """Return the title and the findings, line by line."""
        lines = [f"{self.title}, {self.imported.file}: {described(self.imported)}"]
        for heading, found in grouped(self.findings):
            lines += [f"{heading}:", *(f"  {sentence(finding)}" for finding in found)]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        """Return the findings as a table, for notebooks."""
        rows = "".join(
            f"<tr><td>{escape(heading)}</td><td>{escape(each.what)}</td><td>{escape(each.how)}</td>"
            f"<td>{escape(each.amount)}</td></tr>"
            for heading, found in grouped(self.findings)
            for each in found
        )
        return f"<p><b>{escape(self.title)}</b>: {escape(described(self.imported))}</p><table>{rows}</table>"


def load_robot(
    path: str | Path,
    *,
    keyframe: str | None = None,
    self_collision: bool = True,
    base: Literal["auto", "free", "fixed"] = "auto",
    assets: Iterable[str | Path] = (),
    meshes: Literal["hull", "fit"] = "hull",
) -> Robot:
    """Read a robot from an MJCF or URDF file; needs the extra ``robots``.

    Args:
        path: the file, or ``package://gymnasium/envs/mujoco/assets/ant.xml`` for one in an installed package.
        keyframe: the keyframe of the model at which the robot starts; None: its reference pose.
        self_collision: whether bodies of the robot may touch each other.
        base: whether the root link of a URDF floats: "free", "fixed", or "auto": it floats unless a link "world" holds
            it or the robot is an arm.
        assets: folders besides the model's own from which meshes and included files may be read.
        meshes: "hull": the convex hull of each mesh, which touches planes and terrain; "fit": spheres, boxes or
            capsules fitted to it, which touch other bodies too and take some ten seconds a mesh.

    Raises:
        SymphysError: names the file, and where known the line, the element and the attribute; or says that MuJoCo,
            which does the reading, is not installed.
    """
    folders = tuple(Path(each) for each in assets)
    return Robot(read_robot(path, ImportOptions(keyframe, self_collision, base, folders, meshes)))


def grouped(findings: Iterable[Finding]) -> list[tuple[str, list[Finding]]]:
    """Group findings by kind, each with its heading."""
    found = list(findings)
    groups = [(heading, [each for each in found if each.kind == kind]) for kind, heading in HEADINGS.items()]
    return [(heading, members) for heading, members in groups if members]


def joined(first: Any, second: Any) -> Any:
    """Concatenate two lists, merge two tables; otherwise return the second value."""
    if isinstance(first, list) and isinstance(second, list):
        return [*first, *second]
    if isinstance(first, Mapping) and isinstance(second, Mapping):
        return {**first, **second}
    return second
