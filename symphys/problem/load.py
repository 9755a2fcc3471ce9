"""Build the data of a problem from the tables of its file, and find all faults in them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import casadi as ca
from pydantic import ValidationError

from symphys.errors import Issue, ProblemError
from symphys.files import printable
from symphys.model.state_layout import input_sizes
from symphys.model.world import World
from symphys.problem.include import appendix
from symphys.problem.limits import check_hulls, check_pair_limit, check_rollout
from symphys.problem.model import (
    ALIVE,
    FeedbackController,
    ForceLaw,
    ProblemData,
    Sensor,
    Simulation,
    Termination,
    Variable,
)
from symphys.problem.parametric.parts import Part
from symphys.problem.parametric.placement import check_carried, forward_kinematics
from symphys.problem.parametric.world import ParametricWorld
from symphys.problem.quantities import (
    Quantity,
    delay_quantities,
    duration_quantity,
    formula_units,
    quantities,
    recording_quantities,
    start_quantities,
    weight_quantities,
)
from symphys.problem.reading.faults import Faults, Place
from symphys.problem.reading.messages import report
from symphys.problem.reading.source import check_range
from symphys.problem.recordings.files import recorded_appendix
from symphys.problem.recordings.reading import read_identification, with_duration
from symphys.problem.references import read_references, reference_values
from symphys.problem.schema import Document
from symphys.problem.start import StartValues, at_guess, check_joints, check_overlap, formula_names
from symphys.problem.tables.bodies import read_body, read_state, read_statics
from symphys.problem.tables.contact import (
    MEMBERS,
    check_collides_with,
    check_laws,
    check_varied,
    read_contact,
    read_pairs,
)
from symphys.problem.tables.control import force_quantities, read_controllers, read_forces, read_sensors
from symphys.problem.tables.guess import read_guess
from symphys.problem.tables.joints import check_couplings, read_couplings, read_joints, read_sites
from symphys.problem.tables.objectives import Objectives, read_objectives, read_termination, with_termination_cost
from symphys.problem.tables.scenarios import read_scenarios
from symphys.problem.tables.simulation import (
    check_read_at_start,
    dotted,
    phase_quantities,
    read_phases,
    read_sets,
    read_time,
)
from symphys.problem.tables.variables import read_variables
from symphys.types import Array

if TYPE_CHECKING:
    from symphys.problem.sweeps.sweep import Sweep

SHARED_NAMES = (
    *MEMBERS,
    "joint",
    "coupling",
    "site",
    "sensor",
    "controller",
    "force",
    "reference",
    "variable",
    "recording",
)
OWN_NAMES = ("phase", "cost", "target", "constraint", "output", "scenario")


def read_document(data: Mapping[str, Any], faults: Faults) -> Document:
    """Tables and keys of the right kinds, with names that are unique, and numbers that can be computed with."""
    check_range(data, faults)
    faults.stop_if_any()
    try:
        document = Document.model_validate(data)
    except ValidationError as error:
        report(error, Document, faults)
        if not faults.issues:
            raise
    faults.stop_if_any()  # out here it has no second traceback
    check_names(document, faults)
    faults.stop_if_any()
    return document


def check_names(document: Document, faults: Faults) -> None:
    """Surfaces and variables share one set of names; costs, targets and constraints have one each."""
    for kinds in (SHARED_NAMES, *((key,) for key in OWN_NAMES)):
        named = [(key, index, table.name) for key in kinds for index, table in enumerate(getattr(document, key))]
        seen: dict[str, Place] = {}
        for key, index, name in named:
            place: Place = (key, index, "name")
            if name in seen:
                text = f'"{name}" is already the name of another {" or ".join(kinds)}'
                faults.add(place, text + faults.elsewhere(place, seen[name]))
            seen.setdefault(name, place)
    if document.termination is not None and document.fall is not None:
        faults.add(("fall",), "is the old name of [termination], which is given too; leave one of the two out")
    owners = {table.name: (key, k) for key in SHARED_NAMES for k, table in enumerate(getattr(document, key))}
    for place, group in groups(document):
        if group in owners:
            owner = owners[group]
            text = f'"{group}" is already the name of a {owner[0]}{faults.elsewhere(place, owner)}'
            faults.add(place, f"{text}; a group needs one of its own")


def groups(document: Document) -> list[tuple[Place, str]]:
    """Return every mention of a group with its place."""
    members = [((key, index), table) for key in MEMBERS for index, table in enumerate(getattr(document, key))]
    ground = [] if document.ground is None else [(("ground",), document.ground)]
    return [((*place, "group"), table.group) for place, table in (*members, *ground) if table.group is not None]


def build(
    path: Path,
    text: str,
    document: Document,
    faults: Faults,
    functions: Mapping[str, ca.Function],
    starts: StartValues,
    sweep: Sweep | None,
) -> ProblemData:
    """The problem; each stage needs the ones before without fault."""
    simulation, mpc = read_time(with_duration(document, faults), faults)
    references, texts = read_references(document, faults)
    given = reference_values(references, ca.DM(0))
    parametric, initial = read_world(document, faults)
    faults.stop_if_any()
    nominal = parametric.world({})
    check_laws(parametric, nominal, faults)
    check_couplings(nominal, faults)
    known = quantities(parametric, initial, input_sizes(nominal)) | duration_quantity(simulation.duration)
    warm = simulation.warm_start
    sensors, controllers = read_control(document, parametric, known, functions, starts, given, warm, faults)
    sets = read_sets(document.phase, parametric, faults)
    known |= (
        named_quantities(document, controllers, sets, parametric)
        | delay_quantities(references)
        | start_quantities(parametric)
    )
    variables = read_variables(document.variable, known, simulation, faults)
    check_variables(document, simulation, parametric, nominal, variables, faults)
    sampled = {name: quantity for name, quantity in known.items() if quantity.kind not in ("duration", "recording")}
    scenarios = read_scenarios(document.scenario, sampled, parametric, simulation, variables, faults)
    faults.stop_if_any()
    values = at_guess(parametric, known, variables)
    start = checked_start(starts, parametric, values, faults)
    named = {**formula_names(values, start, variables, warm), **given}
    forces, termination, objectives = read_laws(document, simulation, sets, nominal, known, named, variables, faults)
    measured = read_identification(document, parametric, nominal, initial, simulation, named, variables, faults)
    check_read_at_start(objectives.phases, sensors, (document.ending[0], termination), faults)
    return ProblemData(
        name=printable(path.stem),
        title=document.title or printable(path.stem),
        description=document.description,
        file=str(path),
        text=text + appendix(texts) + recorded_appendix(measured.new_files),
        simulation=simulation,
        parametric=parametric,
        initial=initial,
        parameters=parametric.parameters(),
        variables=variables,
        **vars(objectives),
        goal=document.objective.goal,
        stop_when_met=stop_when_met(document, objectives),
        solver_tables=document.solver,
        sensors=sensors,
        controllers=controllers,
        forces=forces,
        references=references,
        solvers=None if document.solvers is None else tuple(dict.fromkeys(document.solvers)),
        termination=termination,
        scenarios=scenarios or None,
        mpc=mpc,
        **measured.fields(),
        guess=read_guess(document.guess, simulation, nominal, references, faults),
        sweep=sweep,
    )


def named_quantities(
    document: Document,
    controllers: Sequence[FeedbackController],
    sets: Mapping[str, Mapping[str, tuple[float, ...]]],
    parametric: ParametricWorld,
) -> dict[str, Quantity]:
    """Collect what variables may set besides the world: numbers of controllers, laws, phases; clocks of recordings."""
    delays = [(name, each.delay) for table in document.recording for name, each in table.input_tables.items()]
    clocks = recording_quantities((table.name for table in document.recording), delays)
    return (
        weight_quantities(controllers) | force_quantities(document.force) | phase_quantities(sets, parametric) | clocks
    )


def checked_start(starts: StartValues, parametric: ParametricWorld, values: Mapping[str, Any], faults: Faults) -> Any:
    """The state at the guess; what overlaps there, and joints that do not fit, are faults."""
    start = starts.of(parametric, values)
    check_overlap(parametric, start, faults)
    check_joints(parametric, start, faults)
    return start


def read_control(
    document: Document,
    parametric: ParametricWorld,
    known: Mapping[str, Quantity],
    functions: Mapping[str, ca.Function],
    starts: StartValues,
    given: Mapping[str, Any],
    warm_start: bool,
    faults: Faults,
) -> tuple[tuple[Sensor, ...], tuple[FeedbackController, ...]]:
    """Sensors and controllers without fault."""
    sensors: tuple[Sensor, ...] = ()
    if document.sensor:
        values = at_guess(parametric, known, ())
        read = {**formula_names(values, starts.of(parametric, values), (), warm_start), **given}
        sensors = read_sensors(document.sensor, read, faults)
        faults.stop_if_any()
    varied = {name.partition("[")[0].strip() for table in document.variable for name in table.sets}
    controllers = read_controllers(document.controller, sensors, known, functions, faults, varied)
    faults.stop_if_any()
    return sensors, controllers


def check_variables(
    document: Document,
    simulation: Simulation,
    parametric: ParametricWorld,
    nominal: World,
    variables: Sequence[Variable],
    faults: Faults,
) -> None:
    """Check that what variables and phases set fits the world, and that the rollout fits into memory."""
    check_rollout(nominal, simulation, variables, faults)
    varied = varied_names(document, variables)
    check_varied(parametric, nominal, varied, faults)
    check_carried(parametric, varied, faults, ("anchor", "start", "start_rate"))


def varied_names(document: Document, variables: Sequence[Variable | None]) -> list[tuple[Place, str]]:
    """Yield what variables and phases set, with the place in the file."""
    found: list[tuple[Place, str]] = [
        (("phase", k, "sets"), name) for k, table in enumerate(document.phase) for name, _ in dotted(table.sets)
    ]
    for k, variable in enumerate(variables):
        found += [(("variable", k, "sets"), slot.name) for slot in (variable.slots if variable else ())]
    return found


def read_laws(
    document: Document,
    simulation: Simulation,
    sets: Mapping[str, Mapping[str, tuple[float, ...]]],
    nominal: World,
    known: Mapping[str, Quantity],
    named: Mapping[str, Any],
    variables: Sequence[Variable],
    faults: Faults,
) -> tuple[tuple[ForceLaw, ...], Termination | None, Objectives]:
    """Force laws, termination and objectives; ``named`` has a value for each name in formulas, as the guess has it."""
    free = any(variable.kind == "duration" for variable in variables)
    phases = read_phases(document.phase, sets, simulation, free, faults)
    forces = read_forces(document.force, known, named, variables, phases, faults)
    others = {each.name for each in variables} | {each.name for each in document.reference}
    sensed = {name: value for name, value in named.items() if name.partition(".")[0] not in others}
    termination = read_termination(document, sensed, input_sizes(nominal), faults)
    names = {**named} | ({} if document.ending[1] is None else {ALIVE: ca.DM(1)})
    units = formula_units(nominal, names, variables)
    objectives = read_objectives(document, simulation, names, units, faults, phases, free)
    objectives = replace(objectives, costs=with_termination_cost(document, objectives.costs, faults))
    faults.stop_if_any()
    return forces, termination, objectives


def read_world(document: Document, faults: Faults) -> tuple[ParametricWorld, dict[str, Array]]:
    """The world's parametric and the state of every body at the start."""
    bodies = tuple(read_body(index, table, faults) for index, table in enumerate(document.body))
    statics = read_statics(document, [table.position for table in document.body], faults)
    parts: tuple[Part, ...] = (*bodies, *statics)
    names = [part.name for part in parts]
    shared = list(dict.fromkeys(group for _, group in groups(document)))
    check_collides_with(names, shared, document, faults)
    pairs = read_pairs(document.pair, names, shared, faults)
    initial: dict[str, Array] = {}
    for index, table in enumerate(document.body):
        initial |= read_state(table, index, faults)
    bare = [table.name for table in document.body if table.shape is None and table.inertia is None]
    massless = [body.name for body in bodies if not body.mass and body.name in bare]
    joints = read_joints(document.joint, [body.name for body in bodies], initial, faults, massless)
    if not faults.issues:
        initial = forward_kinematics(joints, initial, faults)
    x, y, z = document.world.gravity
    sites = read_sites(document.site, [body.name for body in bodies], faults)
    couplings = read_couplings(document.coupling, joints, faults)
    law = read_contact(document.contact)
    parametric = ParametricWorld(bodies, statics, pairs, law, (x, y, z), joints, couplings, sites)
    check_pair_limit(parametric, faults)
    check_hulls(parametric, faults)
    return parametric, initial


def stop_when_met(document: Document, objectives: Objectives) -> bool:
    """Return the key of the file; by default True with a goal, or with targets and no costs."""
    if document.objective.stop is not None:
        return document.objective.stop == "met"
    return document.objective.goal is not None or (bool(objectives.targets) and not objectives.costs)


def require_solvable(problem: ProblemData) -> None:
    """ProblemError if nothing may vary, or if there is no objective, with what to add."""
    body = next(iter(problem.initial)).split(".")[0]
    issues = []
    if not problem.variables:
        example = f'[[variable]] with name = "start", sets = "{body}.velocity"'
        issues.append(
            Issue("variable", f"there is none, so a solver has nothing to choose; add, for instance, {example}")
        )
    if not (problem.costs or problem.targets or problem.constraints):
        example = f'[[target]] with name = "there", value = "{body}.position - [1, 0, 0]", tolerance = 0.01'
        issues.append(
            Issue(
                "target", f"there is none, and no cost or constraint: nothing to aim at; add, for instance, {example}"
            )
        )
    if issues:
        raise ProblemError(problem.file, issues)
