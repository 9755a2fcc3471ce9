"""Plans on disk: all that a compiled kernel needs besides its library, as numbers and names, without code."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from symphys.codegen.emit.guarding import Guarding
from symphys.codegen.emit.planned import Plan
from symphys.codegen.program.program import AdjointDiscount, FunctionCall, Place, Program
from symphys.records import dataclass


class KeptProgram(Program):
    """A program whose calls are made only on demand, such as to look for a NaN."""

    def __init__(self, fields: dict[str, Any], make: Callable[[], Program]) -> None:
        """Keep all fields but the calls, and ``make``, which makes the whole program."""
        for name, value in (*fields.items(), ("_make", make)):
            object.__setattr__(self, name, value)

    def _whole(self) -> Program:
        made = self.__dict__.get("_made")
        if made is None:
            made = self._make()  # type: ignore[attr-defined]
            object.__setattr__(self, "_made", made)
        assert isinstance(made, Program)
        return made

    @property
    def prologue(self) -> tuple[FunctionCall, ...]:
        """Return the calls before the first step."""
        return self._whole().prologue

    @property
    def body(self) -> tuple[FunctionCall, ...]:
        """Return the calls of a step."""
        return self._whole().body

    @property
    def epilogue(self) -> tuple[FunctionCall, ...]:
        """Return the calls after the last step."""
        return self._whole().epilogue


@dataclass(frozen=True)
class KeptPlan:
    """The part of a kernel that is kept on disk besides its library.

    Attributes:
        program: without its calls.
        plan: without its functions.
        names: of the outputs that are differentiated.
        texts: checksum of the C files; see ``build.texts_of``.
        functions, operations: see ``BuildReport``.
        single_lane: the plan of the library of one lane; None: the same.
    """

    program: Program
    plan: Plan
    names: tuple[str, ...]
    texts: str
    functions: int
    operations: int
    single_lane: Plan | None = None

    def write(self, path: Path) -> None:
        """Write the plan to a file."""
        program, plan = self.program, self.plan
        discounted = program.discounted
        head = {
            "size": program.size,
            "z": listed(program.z),
            "parameters": listed(program.parameters),
            "steps": program.steps,
            "outputs": {name: listed(place) for name, place in program.outputs.items()},
            "zeroed": list(map(listed, program.zeroed)),
            "constants": [listed(place) for place, _ in program.constants],
            "discounted": discounted and [listed(discounted.state), discounted.kept and listed(discounted.kept)],
            "tape": plan.tape,
            "counts": {name: count for name, (count, _) in plan.tables.items()},
            "guarding": plan.guarding and [plan.guarding.first, plan.guarding.arena],
            "names": self.names,
            "texts": self.texts,
            "functions": self.functions,
            "operations": self.operations,
        }
        arrays: dict[str, Any] = {f"table_{name}": table for name, (_, table) in plan.tables.items()}
        if (single_lane := self.single_lane) is not None:
            head["alone"] = [
                {name: count for name, (count, _) in single_lane.tables.items()},
                single_lane.size,
                single_lane.tape,
            ]
            head["signature"] = single_lane.signature
            arrays |= {f"alone_{name}": table for name, (_, table) in single_lane.tables.items()}
        if plan.guarding is not None:
            arrays |= {f"guarding_{name}": rows for name, rows in plan.guarding.rows.items()}
        values = np.array([x for _, row in program.constants for x in row], np.float64)
        text = np.frombuffer(json.dumps(head).encode(), np.uint8)
        with path.open("wb") as file:
            np.savez(file, head=text, values=values, written=plan.written, **arrays)

    @classmethod
    def read(cls, path: Path, make: Callable[[], Program]) -> KeptPlan:
        """Read a plan from a file; ``make`` makes the program with its calls."""
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        head = json.loads(arrays.pop("head").tobytes())
        constants, values, start = [], arrays.pop("values"), 0
        for place in (Place(*each) for each in head["constants"]):
            constants.append((place, tuple(values[start : start + place.size].tolist())))
            start += place.size
        discounted = head["discounted"]
        fields = {
            "size": head["size"],
            "z": Place(*head["z"]),
            "parameters": Place(*head["parameters"]),
            "steps": head["steps"],
            "outputs": {name: Place(*each) for name, each in head["outputs"].items()},
            "zeroed": tuple(Place(*each) for each in head["zeroed"]),
            "constants": tuple(constants),
            "discounted": discounted
            and AdjointDiscount(Place(*discounted[0]), discounted[1] and Place(*discounted[1])),
        }
        tables = {name: (count, arrays[f"table_{name}"]) for name, count in head["counts"].items()}
        guarding = None
        if head["guarding"]:
            rows = {name.partition("_")[2]: each for name, each in arrays.items() if name.startswith("guarding_")}
            guarding = Guarding(head["guarding"][0], rows, head["guarding"][1])
        plan, single_lane = Plan((), tables, head["tape"], arrays["written"], guarding), None
        if "alone" in head:
            counts, size, tape = head["alone"]
            tables = {name: (count, arrays[f"alone_{name}"]) for name, count in counts.items()}
            single_lane = replace(plan, tables=tables, tape=tape, size=size, signature=head["signature"])
        program = KeptProgram(fields, make)
        return cls(
            program, plan, tuple(head["names"]), head["texts"], head["functions"], head["operations"], single_lane
        )


def listed(place: Place) -> list[int]:
    """Return a place as numbers."""
    return [place.offset, place.size, place.stride]
