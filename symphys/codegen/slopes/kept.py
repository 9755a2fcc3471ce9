"""Plans of Jacobians on disk: all that a compiled one needs besides its library, as numbers and names, without code."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from symphys.codegen.program.program import Place, Program
from symphys.codegen.slopes.plan import Adjoints, RowBlock, SlopePlan
from symphys.codegen.toolchain.plans import KeptProgram, listed
from symphys.records import dataclass

TABLES = ("entries", "calls", "copies", "uses", "cells")
"""Fields of ``Adjoints``."""
SERIES = ("forward", "read", "seeds")
"""Fields of ``SlopePlan`` that are arrays."""


@dataclass(frozen=True)
class KeptSlopes:
    """The part of a Jacobian that is kept on disk besides its library.

    Attributes:
        program: without its calls.
        plan: without its functions.
        texts: checksum of the C files.
        functions, operations: see ``BuildReport``.
    """

    program: Program
    plan: SlopePlan
    texts: str
    functions: int
    operations: int

    def write(self, path: Path) -> None:
        """Write the plan to a file."""
        program, plan = self.program, self.plan
        head = {
            "size": program.size,
            "z": listed(program.z),
            "parameters": listed(program.parameters),
            "outputs": {name: listed(place) for name, place in program.outputs.items()},
            "numbers": [plan.tape, plan.adjoints, plan.result],
            "rows": [block.rows for block in plan.blocks],
            "texts": self.texts,
            "functions": self.functions,
            "operations": self.operations,
        }
        arrays = {name: getattr(plan.backward, name) for name in TABLES}
        arrays |= {name: getattr(plan, name) for name in SERIES}
        arrays |= {f"left{k}": block.left for k, block in enumerate(plan.blocks)}
        arrays |= {f"taken{k}": block.taken for k, block in enumerate(plan.blocks)}
        with path.open("wb") as file:
            np.savez(file, head=np.frombuffer(json.dumps(head).encode(), np.uint8), **arrays)

    @classmethod
    def read(cls, path: Path, make: Callable[[], Program]) -> KeptSlopes:
        """Read a plan from a file; ``make`` makes the program with its calls."""
        with np.load(path, allow_pickle=False) as file:
            arrays: dict[str, Any] = {name: file[name] for name in file.files}
        head = json.loads(arrays["head"].tobytes())
        fields = {
            "size": head["size"],
            "z": Place(*head["z"]),
            "parameters": Place(*head["parameters"]),
            "steps": 1,
            "outputs": {name: Place(*each) for name, each in head["outputs"].items()},
            "zeroed": (),
            "constants": (),
            "discounted": None,
        }
        blocks = [RowBlock(rows, arrays[f"taken{k}"], arrays[f"left{k}"]) for k, rows in enumerate(head["rows"])]
        backward = Adjoints(*(arrays[name] for name in TABLES))
        tape, adjoints, result = head["numbers"]
        forward, read, seeds = (arrays[name] for name in SERIES)
        plan = SlopePlan((), forward, backward, blocks, tape, read, adjoints, seeds, result)
        return cls(KeptProgram(fields, make), plan, head["texts"], head["functions"], head["operations"])
