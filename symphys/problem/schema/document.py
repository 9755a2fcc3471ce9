"""The whole file."""

from __future__ import annotations

from typing import Any

from pydantic import ConfigDict, Field

from symphys.problem.schema.control import ControllerTable, ForceTable, ReferenceTable, SensorTable
from symphys.problem.schema.include import MAX_INCLUDES, IncludedTable, IncludeTable
from symphys.problem.schema.joints import CouplingTable, JointTable, SiteTable
from symphys.problem.schema.mpc import MpcTable
from symphys.problem.schema.objectives import (
    ConstraintTable,
    CostTable,
    GuessTable,
    ObjectiveTable,
    OutputTable,
    PhaseTable,
    TargetTable,
    TerminationTable,
    VariableTable,
)
from symphys.problem.schema.physics import (
    BlockTable,
    BodyTable,
    ContactTable,
    GroundTable,
    PairTable,
    PlaneTable,
    SimulationTable,
    TerrainTable,
    WorldTable,
)
from symphys.problem.schema.recording import IdentifyTable, RecordedFileTable, RecordingTable
from symphys.problem.schema.scenarios import ScenarioTable
from symphys.problem.schema.sweep import SweepTable
from symphys.problem.schema.types import Label, SchemaTable, deprecated


class Document(SchemaTable):
    """A symphys problem."""

    model_config = ConfigDict(json_schema_extra={"anyOf": [{"required": ["body"]}, {"required": ["include"]}]})

    title: Label | None = Field(default=None, description="one line; default: the file's name")
    description: str = Field(default="", description="what the problem is about; Markdown")
    solvers: list[Label] | None = Field(
        default=None,
        min_length=1,
        description="solvers that `symphys solve` runs without --solver; default: chosen from the problem",
    )
    simulation: SimulationTable
    world: WorldTable = WorldTable()
    include: list[IncludeTable] = Field(default=[], max_length=MAX_INCLUDES)
    included: list[IncludedTable] = Field(default=[], max_length=MAX_INCLUDES)
    body: list[BodyTable] = Field(default=[], min_length=1, validate_default=True)
    ground: GroundTable | None = None
    plane: list[PlaneTable] = Field(default=[])
    block: list[BlockTable] = Field(default=[])
    terrain: list[TerrainTable] = Field(default=[])
    contact: ContactTable = ContactTable()
    pair: list[PairTable] = Field(default=[])
    joint: list[JointTable] = Field(default=[])
    coupling: list[CouplingTable] = Field(default=[])
    site: list[SiteTable] = Field(default=[])
    sensor: list[SensorTable] = Field(default=[])
    controller: list[ControllerTable] = Field(default=[])
    force: list[ForceTable] = Field(default=[])
    reference: list[ReferenceTable] = Field(default=[])
    variable: list[VariableTable] = Field(default=[])
    guess: GuessTable | None = None
    phase: list[PhaseTable] = Field(default=[])
    cost: list[CostTable] = Field(default=[])
    target: list[TargetTable] = Field(default=[])
    constraint: list[ConstraintTable] = Field(default=[])
    output: list[OutputTable] = Field(default=[])
    scenario: list[ScenarioTable] = Field(default=[])
    termination: TerminationTable | None = None
    fall: TerminationTable | None = deprecated("termination")
    objective: ObjectiveTable = ObjectiveTable()
    solver: dict[str, dict[str, Any]] = Field(
        default={}, description="options by solver: [solver.gradient], [solver.cma], ..."
    )
    mpc: MpcTable | None = None
    recording: list[RecordingTable] = Field(default=[])
    recorded: list[RecordedFileTable] = Field(default=[])
    identify: IdentifyTable | None = None
    sweep: SweepTable | None = None
    set: dict[str, Any] = Field(
        default={}, description='values that replace others, such as those of included files: "body.torso.mass" = 3'
    )

    @property
    def ending(self) -> tuple[str, TerminationTable | None]:
        """The table that says when a motion is over, and the key that it has in the file."""
        return ("fall", self.fall) if self.fall is not None else ("termination", self.termination)
