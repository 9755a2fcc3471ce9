"""A problem's rollout as a program of calls, for the compiled kernels.

Long sums over the samples of a motion are short calls, one after the other. As one function they are as long as the
motion: that of ten seconds of a quadruped has 230,000 operations, and takes the compiler two thirds of its time. The
order of the sums is that of casadi's, so that no bit differs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple, Protocol

import casadi as ca
import numpy as np

from symphys.codegen import AdjointDiscount, FunctionCall, MemoryLayout, Place, Program
from symphys.codegen.program.collection import uncollected
from symphys.expression import Formula
from symphys.model.controllers import Net
from symphys.model.controllers.net import Activation, Layer, activated
from symphys.model.state_layout import Layout as Columns
from symphys.model.state_layout import input_columns
from symphys.problem import ALIVE, FeedbackController
from symphys.transcription.decision_variables import start_of
from symphys.transcription.formula_names import spans
from symphys.transcription.gradient_probe import combined
from symphys.transcription.objective import FormulaSamples, Series, Terms, terms
from symphys.transcription.rollout import Rollout
from symphys.types import Expr

if TYPE_CHECKING:
    from symphys.dynamics.tracing.guards import Guard, Part
    from symphys.dynamics.tracing.recording import TracedCall, TracedVector


class Places(Protocol):
    """The places of a rollout in a program."""

    rollout: Rollout
    layout: MemoryLayout
    smoothing: Place
    x: Place
    given: Place
    u: Place
    p: Place
    time: Place


def control_calls(rollout: Rollout, places: Places) -> list[FunctionCall]:
    """Return the calls before those of a step, from ``x`` and ``given`` to ``u``; none without feedback."""
    if rollout.feedback is None:
        return []
    return ControllerCalls(rollout, places).calls


class ControllerCalls:
    """Makes the calls of one step in order."""

    def __init__(self, rollout: Rollout, places: Places) -> None:
        """Make all calls."""
        self.rollout, self.places = rollout, places
        self.calls: list[FunctionCall] = []
        laws, given = rollout.control.laws, places.given
        if rollout.problem.controllers:
            sensed = {name: self.sense(name) for name in self.used()}
            outputs = [self.outputs(c, [sensed[name] for name in c.senses]) for c in rollout.problem.controllers]
            given = places.u if laws is None else places.layout.take(places.u.size)
            self.add_up(outputs, given)
        if laws is not None:
            self.calls.append(FunctionCall(laws, (places.x, given, places.p, places.time), (places.u,)))

    def used(self) -> list[str]:
        """Return the sensors that some controller reads."""
        return list(dict.fromkeys(name for c in self.rollout.problem.controllers for name in c.senses))

    def sense(self, name: str) -> Place:
        """Add the call of a sensor and return the place of its reading."""
        sensor = next(s for s in self.rollout.problem.sensors if s.name == name)
        places = self.places
        return self.call(self.rollout.control.sensor(sensor), places.x, places.p, places.time)

    def call(self, function: ca.Function, *inputs: Place) -> Place:
        """Add a call with one result and return the place of the result."""
        result = self.places.layout.take(int(function.numel_out(0)))
        self.calls.append(FunctionCall(function, inputs, (result,)))
        return result

    def outputs(self, controller: FeedbackController, senses: Sequence[Place]) -> list[Place]:
        """Add the calls of a controller and return the places of its outputs, in order."""
        law = controller.law
        if isinstance(law, Net):
            return self.net(law, self.numbers(controller, "weights"), senses)
        sensed = [ca.SX.sym("sensed", place.size) for place in senses]
        numbers = {key: ca.SX.sym(key, size) for key, size in law.sizes.items()}
        time = ca.SX.sym("time")
        value = law.act(ca.vertcat(ca.SX(0, 1), *sensed), time, numbers)
        function = ca.Function("act", [*sensed, time, *numbers.values()], [ca.densify(ca.SX(value))])
        held = [self.numbers(controller, key) for key in numbers]
        return [self.call(function, *senses, self.places.time, *held)]

    def numbers(self, controller: FeedbackController, key: str) -> Place:
        """Return the place of a controller's numbers among the parameters."""
        return part(self.places.p, self.rollout.parameters.columns[f"{controller.name}.{key}"])

    def net(self, net: Net, weights: Place, senses: Sequence[Place]) -> list[Place]:
        """Add a call for each output of a layer."""
        values, layers = list(senses), tuple(net.layers())
        for layer in layers:
            result = self.places.layout.take(layer.outputs)
            straight = part(weights, net.straight) if net.skip and layer == layers[-1] else None
            for k in range(layer.outputs):
                function, inputs = self.row(layer, k, weights, values, straight, senses)
                self.calls.append(FunctionCall(function, inputs, (part(result, slice(k, k + 1)),)))
            values = [result]
        return values

    def row(
        self,
        layer: Layer,
        k: int,
        weights: Place,
        values: Sequence[Place],
        straight: Place | None,
        senses: Sequence[Place],
    ) -> tuple[ca.Function, tuple[Place, ...]]:
        """Return the function of one output of a layer, and its arguments."""
        width, start = layer.inputs, layer.matrix.start
        products = [([*values], part(weights, slice(start + k * width, start + (k + 1) * width)))]
        if straight is not None:
            size = sum(place.size for place in senses)
            products.append(([*senses], part(straight, slice(k * size, (k + 1) * size))))
        bias = layer.biases.start + k
        biases = [part(weights, slice(bias, bias + 1))] if layer.biases.stop > layer.biases.start else []
        sizes = [([place.size for place in inputs], held.size) for inputs, held in products]
        places = [place for inputs, held in products for place in (*inputs, held)]
        return row_function(layer.activation, sizes, len(biases)), (*places, *biases)

    def add_up(self, outputs: Sequence[Sequence[Place]], result: Place) -> None:
        """Add the call that sums the inputs of variables and of all controllers."""
        controllers = self.rollout.problem.controllers
        given = ca.SX.sym("given", self.places.u.size)
        total, symbols = ca.SX(given), list[Expr]()
        columns = input_columns(self.rollout.world, self.rollout.inputs)
        for controller, parts in zip(controllers, outputs, strict=True):
            own = [ca.SX.sym("output", place.size) for place in parts]
            symbols += own
            for (name, component), scale, value in zip(
                controller.drives, controller.scale, ca.vertsplit(ca.vertcat(*own)), strict=True
            ):
                total[columns[name].start + component] += scale * value
        function = ca.Function("inputs", [given, *symbols], [ca.densify(total)])
        flat = [place for parts in outputs for place in parts]
        self.calls.append(FunctionCall(function, (self.places.given, *flat), (result,)))


def part(place: Place, columns: slice) -> Place:
    """Return some words of a place."""
    return Place(place.offset + columns.start, columns.stop - columns.start, place.stride)


def row_function(activation: Activation, sizes: Sequence[tuple[list[int], int]], biases: int) -> ca.Function:
    """Return (values ..., weights), those of a skip connection if there is one, and a bias -> one output."""
    symbols, products = list[Expr](), list[Expr]()
    for values, held in sizes:
        own = [ca.SX.sym("value", size) for size in values]
        weights = ca.SX.sym("weights", held)
        symbols += [*own, weights]
        products.append(ca.dot(weights, ca.vertcat(*own)))
    bias = [ca.SX.sym("bias") for _ in range(biases)]
    first, *straight = products
    total = activated(activation, sum(bias, first))
    return ca.Function("row", [*symbols, *bias], [ca.densify(sum(straight, total))])


SUM_CHUNK = 64
"""Terms that one call adds."""


def sums_in_calls(
    layout: MemoryLayout, series: Sequence[Place], rows: int, scale: float | None
) -> tuple[list[FunctionCall], Place]:
    """Return calls that sum samples, and the place of the result.

    Args:
        layout: takes what the calls give.
        series: places of samples, ``rows`` numbers each, one after the other.
        rows: m.
        scale: of the squares; None: there are none.

    Returns:
        The calls, and the place of the sum (m,) of the samples with, after it, that of the squares of scale times each
        number.
    """
    count = rows + (scale is not None)
    calls, chunks = list[FunctionCall](), dict[int, ca.Function]()
    total = layout.take(count)
    calls.append(FunctionCall(ca.Function("zeros", [], [ca.DM.zeros(count)]), (), (total,)))
    longest = max(SUM_CHUNK // rows, 1) * rows
    for whole in series:
        for start in range(0, whole.size, longest):
            part, after = Place(whole.offset + start, min(longest, whole.size - start)), layout.take(count)
            if part.size not in chunks:
                chunks[part.size] = _chunk(rows, part.size // rows, scale)
            calls.append(FunctionCall(chunks[part.size], (total, part), (after,)))
            total = after
    return calls, total


def _chunk(rows: int, columns: int, scale: float | None) -> ca.Function:
    """Return (sums before, samples) -> sums after."""
    before, samples = ca.SX.sym("before", rows + (scale is not None)), ca.SX.sym("samples", rows * columns)
    after: list[Expr] = [before[i] for i in range(before.numel())]
    for k in range(rows * columns):
        after[k % rows] += samples[k]
        if scale is not None:
            scaled = scale * samples[k]
            after[rows] += scaled * scaled
    return ca.Function("sums", [before, samples], [ca.vertcat(*after)])


NO_FORMULAS: Mapping[str, Formula] = MappingProxyType({})


class RolloutPlaces:
    """The places of a rollout in a program; see ``Places``."""

    def __init__(self, rollout: Rollout, by_step: Sequence[str] = ()) -> None:
        """Reserve z, smoothing, times, parameters, inputs and states; ``by_step`` as in ``rollout_program``."""
        self.rollout, self.problem, self.steps, self.by_step = rollout, rollout.problem, rollout.steps, by_step
        self.layout = MemoryLayout()
        nx, nu, np_ = (int(part.shape[0]) for part in (rollout.x0, rollout.given, rollout.p))
        self.z, self.smoothing = self.layout.take(int(rollout.z.shape[0])), self.layout.take(1)
        self.p, self.given = self.layout.take(np_), self.layout.series(nu, self.steps)
        controls = {each.name for each in self.problem.variables if each.kind == "control"}
        alone = not rollout.world.scheduled and controls <= set(by_step)  # nothing else sets inputs: they begin with 0
        self.begun = self.layout.series(0 if alone else nu, self.steps) if by_step or alone else self.given
        self.u = self.given if rollout.feedback is None else self.layout.series(nu, self.steps)
        self.x = self.layout.series(nx, self.steps + 1)
        self.time = self.layout.series(1, self.steps + 1)

    def recorded(self, formula: Formula, shift: int) -> FunctionCall:
        """Return a call of each step for a formula at its start (0) or end (1); results are contiguous."""
        function = dense(self.rollout.compiled(formula))
        out = self.layout.series(int(function.size1_out(0)), self.steps)
        places = (self.x.later(shift), self.u, self.p, self.time.later(shift), self.z)
        return FunctionCall(function, places, (out,))

    def whole(self, call: FunctionCall) -> Place:
        """Return all results of a call of each step in order."""
        (out,) = call.outputs
        return Place(out.offset, out.size * self.steps)


def dense(function: ca.Function) -> ca.Function:
    """Return the function with dense results."""
    arguments = function.sx_in()
    results = [ca.densify(result) for result in function.call(arguments)]
    return ca.Function(function.name(), arguments, results)


def rollout_program(
    rollout: Rollout,
    exact: bool = False,
    recorded: Mapping[str, Formula] = NO_FORMULAS,
    shift: int = 1,
    by_step: Sequence[str] = (),
) -> Program:
    """Return a program of (z, smoothing) with the outputs of ``_epilogue``, and ``alive``.

    Args:
        rollout: of a problem.
        exact: for smoothing 0 only, whatever is given: it has less to compute.
        recorded: further outputs by name: what formulas are at the end of every step, one after the other.
        shift: 0 for those at the start of every step.
        by_step: names of variables with a constant knot for each step, which each step reads for itself. Else the
            prologue writes them all, in a function as long as they are.
    """
    with uncollected():
        return _rollout_program(rollout, exact, recorded, shift, by_step)


def _rollout_program(
    rollout: Rollout, exact: bool, recorded: Mapping[str, Formula], shift: int, by_step: Sequence[str]
) -> Program:
    # Formulas are sampled in every step; the epilogue combines the samples.
    places = RolloutPlaces(rollout, by_step)
    samples = FormulaSamples(rollout, separate=True)
    asked = terms(samples)
    formulas = {each: places.recorded(*each) for each in samples.series}
    series = {name: places.recorded(formula, shift) for name, formula in recorded.items()}
    step = step_calls(places, exact)
    epilogue, outputs = _epilogue(places, samples, asked, formulas)
    alive = _alive(places)
    if alive is not None:
        outputs["alive"] = alive.later(rollout.steps).still()
    outputs |= {name: places.whole(call) for name, call in series.items()}
    times = tuple(np.arange(rollout.steps + 1) * rollout.dt)
    fixed = () if rollout.problem.free_duration else ((Place(places.time.offset, len(times)), times),)
    return Program(
        size=places.layout.size,
        z=places.z,
        parameters=places.smoothing,
        steps=rollout.steps,
        outputs=outputs,
        prologue=(*_prologue(places), *step.numbers),
        body=(*_knot_calls(places), *step.body, *formulas.values(), *series.values()),
        epilogue=epilogue,
        constants=fixed,
        discounted=AdjointDiscount(places.x, alive),
    )


class StepCalls(NamedTuple):
    """The calls of a time step: ``numbers``, which hold in all steps and belong into the prologue, and ``body``."""

    numbers: list[FunctionCall]
    body: list[FunctionCall]


def step_calls(samples: Places, exact: bool) -> StepCalls:
    """Return the calls of one time step, from ``x`` and ``given`` to the ``x`` after: controllers, laws, then physics.

    Every program with time steps in it has these calls: rollouts, ``Stage``, slopes, policies.
    """
    from symphys.dynamics.functions import trace_step

    rollout = samples.rollout
    columns = Columns(rollout.world)
    recording = rollout.built(trace_step, exact)
    arguments = {"u": samples.u, "p": samples.p, "smoothing": samples.smoothing}
    after = samples.x.later() if rollout.termination is None else samples.layout.take(rollout.memory.size - 1)
    places: dict[TracedVector, Place] = {slot: _part(after, part) for slot, part in recording.results.items()}
    calls, numbers, zeros = control_calls(rollout, samples), list[FunctionCall](), None
    if widest := _most_zeros(recording.calls):
        zeros = samples.layout.take(widest)
        numbers.append(FunctionCall(ca.Function("zeros", [], [ca.DM.zeros(widest)]), (), (zeros,)))
    for piece in recording.calls:
        for slot in piece.inputs:
            if slot.name in columns:
                places[slot] = _part(samples.x, columns[slot.name])
            elif slot.name:
                places[slot] = arguments[slot.name]
        for slot in piece.outputs:
            own = samples.layout.take(slot.size)  # also of what lies in the next state: sizes of memories are kept
            places.setdefault(slot, own)
        if piece.inputs or any(slot.name for slot in piece.outputs):
            calls.append(_guarded(piece, places, zeros))
        else:
            numbers.append(FunctionCall(piece.function, (), tuple([places[slot] for slot in piece.outputs])))
    if after.size > columns.size:
        calls.append(_memory_call(samples, _part(after, slice(columns.size, None))))
    if rollout.termination is not None:
        calls.append(FunctionCall(rollout.termination, (samples.x, after, samples.p), (samples.x.later(),)))
    return StepCalls(numbers, calls)


def _most_zeros(calls: Sequence[TracedCall]) -> int:
    """Return the size of the longest result that zeros may replace."""
    return max(
        (
            vector.size
            for call in calls
            for guard in (call.guard, call.section)
            if guard is not None
            for vector, part in zip(call.outputs, guard.otherwise, strict=True)
            if part is not None and part.vector is None
        ),
        default=0,
    )


def _guarded(traced: TracedCall, places: Mapping[TracedVector, Place], zeros: Place | None) -> FunctionCall:
    """Return a call with its guard and its section, whose vectors lie in ``places``."""
    inputs, outputs = (tuple([places[slot] for slot in slots]) for slots in (traced.inputs, traced.outputs))

    def part_of(part: Part, size: int) -> Place:
        whole = zeros if part.vector is None else places[part.vector]
        assert whole is not None
        if part.start == 0 and size == whole.size:
            return whole
        return Place(whole.offset + part.start, size, whole.stride)

    def stood_for(guard: Guard | None) -> tuple[Place | None, tuple[Place | None, ...]]:
        if guard is None:
            return None, ()
        parts = zip(outputs, guard.otherwise, strict=True)
        return part_of(guard.word, 1), tuple(
            [None if part is None else part_of(part, place.size) for place, part in parts]
        )

    guard, otherwise = stood_for(traced.guard)
    section, beside = stood_for(traced.section)
    return FunctionCall(traced.function, inputs, outputs, False, guard, otherwise, section, beside)


def _alive(samples: RolloutPlaces) -> Place | None:
    """Return the place of the flag ``alive`` of each step; None without termination."""
    memory = samples.rollout.memory
    return _part(samples.x, memory.columns[ALIVE]) if memory.terminates else None


def _memory_call(samples: Places, result: Place) -> FunctionCall:
    """Return the call that stores what the sensors of the next step need of this one."""
    memory, inputs = samples.rollout.memory, samples.rollout.inputs
    x, u = ca.SX.sym("x", samples.x.size), ca.SX.sym("u", samples.u.size)
    function = ca.Function("remember", [x, u], [ca.densify(memory.after(x, u, inputs))])
    return FunctionCall(function, (samples.x, samples.u), (result,))


def _part(place: Place, columns: slice) -> Place:
    """Return some columns of a state."""
    start, stop, _ = columns.indices(place.size)
    return Place(place.offset + start, stop - start, place.stride)


def _knot_calls(samples: RolloutPlaces) -> list[FunctionCall]:
    """Return the call that adds a step's knots to its other inputs.

    There is none where the prologue writes inputs as they are, and none without inputs.
    """
    if samples.begun == samples.given or not samples.given.size:
        return []
    problem, columns = samples.problem, input_columns(samples.rollout.world, samples.rollout.inputs)
    begun = ca.SX.sym("begun", samples.begun.size)
    total = ca.SX(begun) if samples.begun.size else ca.SX.zeros(samples.given.size)
    knots, places = list[Expr](), list[Place]()
    for variable, (first, _) in zip(problem.variables, spans(problem.variables), strict=True):
        if variable.name in samples.by_step:
            knots.append(ca.SX.sym("knot", variable.components))
            places.append(Place(samples.z.offset + first, variable.components, variable.components))
            for slot in variable.slots:
                for k, component in enumerate(slot.components):
                    total[columns[slot.name].start + component] += knots[-1][k]
    function = ca.Function("knots", [begun, *knots], [ca.densify(total)])
    return [FunctionCall(function, (samples.begun, *places), (samples.given,))]


def _prologue(samples: RolloutPlaces) -> tuple[FunctionCall, ...]:
    rollout = samples.rollout
    first = start_of(samples.problem, rollout.world, rollout.inputs, rollout.parameters, rollout.z, samples.by_step)
    u0: Expr = first.u if samples.begun.size else ca.MX(0, 1)
    results = [ca.densify(ca.vec(part)) for part in (rollout.memory.start(first.x0), u0, first.p)]
    u = Place(samples.begun.offset, samples.begun.size * samples.steps)
    function = ca.Function("start", [rollout.z], results).expand()
    start = FunctionCall(function, (samples.z,), (samples.x.still(), u, samples.p))
    if not rollout.problem.free_duration:
        return (start,)
    p = ca.SX.sym("p", samples.p.size)
    dt = rollout.parameters.step_length(rollout.problem.simulation, p)
    times = ca.Function("times", [p], [ca.densify(ca.DM(np.arange(samples.steps + 1)) * dt)])
    return start, FunctionCall(times, (samples.p,), (Place(samples.time.offset, samples.steps + 1),))


def _epilogue(
    places: RolloutPlaces, samples: FormulaSamples, asked: Terms, formulas: Mapping[Series, FunctionCall]
) -> tuple[tuple[FunctionCall, ...], dict[str, Place]]:
    """Return the calls after the last step, and the places of their results."""
    parts = {
        "merit": asked.objective + asked.penalties,
        "objective": asked.objective,
        "errors": asked.errors,
        "constraints": asked.constraints,
        "costs": asked.costs,
        "outputs": asked.outputs,
        "probe": combined(asked.means),
    }
    if asked.residuals is not None:
        parts["residuals"] = asked.residuals
    parts = {name: ca.densify(part) for name, part in parts.items() if part.shape[0]}
    series = {each: places.whole(call) for each, call in formulas.items()}
    moments = [at for k, step in samples.moments for at in (places.x.later(k).still(), places.u.later(step).still())]
    sums, totals = list[FunctionCall](), list[Place]()
    for (keys, scale), symbol in samples.totals.items():
        rows = symbol.numel() - (scale is not None)
        calls, total = sums_in_calls(places.layout, [series[key] for key in keys], rows, scale)
        sums += calls
        totals.append(total)
    lie = [places.z, places.p, *moments, *series.values(), *totals]
    read = {symbol.__hash__() for symbol in ca.symvar(ca.veccat(*parts.values()))}
    used = [(symbol, at) for symbol, at in zip(samples.symbols, lie, strict=True) if symbol.__hash__() in read]
    function = ca.Function("objective", [symbol for symbol, _ in used], list(parts.values())).expand()
    columns = [ca.SX.sym("a", at.size) for _, at in used]
    shaped = [ca.reshape(column, symbol.shape) for column, (symbol, _) in zip(columns, used, strict=True)]
    function = ca.Function("objective", columns, function.call(shaped, True, False))
    outputs = {name: places.layout.take(int(part.shape[0])) for name, part in parts.items()}
    return (*sums, FunctionCall(function, tuple(at for _, at in used), tuple(outputs.values()))), outputs
