"""A problem and where it comes from: a shipped name, a file, a text or tables; changed, and written again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Any

import casadi as ca
import tomli_w

from symphys import problems
from symphys.model.world import World
from symphys.problem.model import NOTHING, ProblemData
from symphys.problem.reader import read_problem
from symphys.problem.reading.source import parse_toml, read_source
from symphys.problem.world_tables import world_tables
from symphys.records import dataclass

SET = "set"
"""The table of a problem file that holds settings."""


@dataclass(frozen=True, eq=False)
class Problem(ProblemData):
    """A validated problem, which never changes: ``set`` gives another one.

    Attributes:
        settings: what was changed in the text, by dotted key.
        functions: of controllers with ``function``, by name.
        varied: names of parameters in which it differs from others of its sweep, whose kernel takes them as inputs.
    """

    settings: Mapping[str, object] = field(default_factory=dict)
    functions: Mapping[str, ca.Function] = field(default_factory=dict, repr=False)
    varied: frozenset[str] = frozenset()

    def set(self, key: str | Mapping[str, object], value: object = None) -> Problem:
        """Return a copy with another value, or with several from a mapping.

        Args:
            key: of the problem file, dotted: ``ball.mass``, ``ground.friction``, ``simulation.dt``, ``throw.guess``,
                ``solver.gradient.iterations``. Tables in lists go by name; their kind, as in ``body.ball.mass``, is
                needed only where tables of two kinds share the name.
            value: a number, text, list or table, as in the file.

        Raises:
            ProblemError: names the key and what would be valid.

        Example:
            >>> import symphys
            >>> problem = symphys.load("ball_throw")
            >>> heavier = problem.set("ball.mass", 2.0)
            >>> float(problem.parameters["ball.mass"][0]), float(heavier.parameters["ball.mass"][0])
            (1.0, 2.0)
        """
        changes = key if isinstance(key, Mapping) else {key: value}
        made = _made(Path(self.file), self.text, {**self.settings, **changes}, self.functions)
        return made if self.sweep is None else replace(made, sweep=self.sweep)

    @classmethod
    def from_world(
        cls,
        world: World,
        start: Mapping[str, Any] | None = None,
        *,
        duration: float,
        dt: float = 0.01,
        variables: Mapping[str, Any] = NOTHING,
        costs: Mapping[str, Any] = NOTHING,
        targets: Mapping[str, Any] = NOTHING,
        constraints: Mapping[str, Any] = NOTHING,
        outputs: Mapping[str, Any] = NOTHING,
        name: str = "problem",
        functions: Mapping[str, ca.Function] = NOTHING,
        **tables: Any,
    ) -> Problem:
        """A problem about a world that was built in Python.

        Args:
            world: of numbers, without symbols; see ``make_world``.
            start: states by name, ``"ball.position": [0, 0, 1]`` [m]; what is missing is as the bodies were placed,
                else zero, and upright. Joints must hold together there; their coordinates need not be 0.
            duration: [s], a whole number of steps.
            dt: time step [s].
            variables: by name what each sets, ``{"throw": "ball.velocity"}``, or the keys of its table,
                ``{"throw": {"sets": "ball.velocity", "guess": [3, 0, 3]}}``.
            costs: by name the formula of each, or the keys of its table.
            targets: likewise; their tables have a ``tolerance``.
            constraints: likewise.
            outputs: likewise.
            name: of the problem.
            functions: of controllers with ``function``; see ``load_problem``.
            tables: further tables of a problem file, such as ``solver={"gradient": {"iterations": 200}}``.

        Raises:
            SymphysError: names what cannot be, or what a problem file cannot say.

        Example:
            >>> from symphys import Problem, solve
            >>> from symphys.model import Body, Plane, make_world
            >>> ball = Body.ball("ball", radius=0.1, mass=0.5, position=(0, 0, 1))
            >>> world = make_world([ball], [Plane.ground()])
            >>> there = {"value": "ball.position - [3, 0, 1]", "tolerance": 0.01}
            >>> throw = {"sets": "ball.velocity", "guess": [6, 0, 2]}
            >>> problem = Problem.from_world(world, duration=0.5, variables={"throw": throw}, targets={"there": there})
            >>> solve(problem, "least_squares", backend="casadi").solved
            True
        """
        lists = {
            "variable": listed(variables, "sets"),
            "cost": listed(costs, "value"),
            "target": listed(targets, "value"),
            "constraint": listed(constraints, "value"),
            "output": listed(outputs, "value"),
        }
        own = {key: entries for key, entries in lists.items() if entries}
        made = {"simulation": {"duration": duration, "dt": dt}, **world_tables(world, start or {}), **own}
        return problem_of_tables({**made, **tables}, name, functions)

    def to_toml(self) -> str:
        """The text of a problem file that is this problem: its own, with what was changed in a table [set] at the end.

        Files that it includes are in the text. Numbers of nets from other files are not, nor is a table [sweep].
        """
        if not self.settings:
            return self.text
        data = parse_toml(Path(self.file), self.text)
        if SET in data:
            return tomli_w.dumps({**data, SET: {**data[SET], **self.settings}})
        return f"{self.text.rstrip()}\n\n{tomli_w.dumps({SET: dict(self.settings)})}"


def load_problem(
    path: str | Path, settings: Mapping[str, object] = NOTHING, functions: Mapping[str, ca.Function] = NOTHING
) -> Problem:
    """Read and validate a problem file.

    Args:
        path: the TOML file.
        settings: values that replace those in the file, by dotted key: ``simulation.dt``, ``body.ball.mass`` or
            ``body.0.mass``, ``ground.friction``, ``solver.gradient.iterations``, ``target.<name>.tolerance``.
        functions: for controllers with ``function``, by name: casadi functions of (sensed, time, weights).

    Raises:
        ProblemError: names the file and every fault found, each with table, key and what would be valid.

    Example:
        >>> import symphys
        >>> from symphys.problem import load_problem
        >>> load_problem(symphys.new("mine.toml"), {"simulation.dt": 0.005}).simulation.dt
        0.005
    """
    path = Path(path)
    return _made(path, read_source(path), settings, functions)


def problem_of_tables(
    tables: Mapping[str, Any],
    name: str = "problem",
    functions: Mapping[str, ca.Function] = NOTHING,
    settings: Mapping[str, object] = NOTHING,
) -> Problem:
    """A problem from the tables of a problem file as dicts and lists: ``{"simulation": {"duration": 2, ...}, ...}``.

    Numpy's arrays and numbers may stand for lists and numbers. Raises ProblemError like ``load_problem``.
    """
    return _made(Path(f"{name}.toml"), tomli_w.dumps(plain(tables)), settings, functions)


def listed(entries: Mapping[str, Any], key: str) -> list[dict[str, Any]]:
    """Tables with their names; what is no table is the value of ``key``."""
    return [
        {"name": name, **(entry if isinstance(entry, Mapping) else {key: entry})} for name, entry in entries.items()
    ]


def plain(value: Any) -> Any:
    """Convert numpy's types and tuples, which TOML does not know."""
    if isinstance(value, Mapping):
        return {str(key): plain(each) for key, each in value.items()}
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    return value


def _made(path: Path, text: str, settings: Mapping[str, object], functions: Mapping[str, ca.Function]) -> Problem:
    settings = plain(settings)
    data = read_problem(path, text, settings, functions)
    return Problem(**vars(data), settings=settings, functions=dict(functions))


Source = str | Path | Mapping[str, Any] | Problem
"""What names a problem."""


def load(source: Source, functions: Mapping[str, ca.Function] | None = None) -> Problem:
    """A problem, validated.

    Args:
        source: the name of a shipped problem, the path of a problem file, or its tables as dicts and lists.
        functions: of controllers with ``function``, by name: casadi functions of (sensed, time, weights).

    Raises:
        ProblemError: names the file and every fault found, each with table, key and what would be valid.
        SymphysError: there is no such file, and no shipped problem of that name.

    Example:
        >>> import symphys
        >>> problem = symphys.load("ball_throw")
        >>> [variable.name for variable in problem.variables]
        ['throw', 'spin']
    """
    given = functions or {}
    if isinstance(source, Problem):
        return source
    if isinstance(source, Mapping):
        return problem_of_tables(source, functions=given)
    return load_problem(problems.find(str(source)), functions=given)
