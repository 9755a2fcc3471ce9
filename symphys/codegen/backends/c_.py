"""Casadi's own C of the casadi functions, compiled: scalar code, batches by casadi's map over threads."""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import cast

import casadi as ca

from symphys import codegen as kernel
from symphys.codegen.backends.casadi_ import FunctionEvaluator
from symphys.codegen.backends.interface import Backend, BackendSource, Description, Function, ProblemFunctions
from symphys.shooting import Nlp

EVALUATED = ("value", "gradient", "residuals", "jacobian")
VISIBLE = '#define CASADI_SYMBOL_EXPORT __attribute__((visibility("default")))\n'


def c(source: BackendSource, threads: int) -> Backend:
    """Compile all functions; KernelUnavailable without a compiler. ``threads`` share a batch."""
    began = time.perf_counter()
    made = {name: getattr(source.functions, name) for name in EVALUATED}
    made |= parts(source.functions.nlp)
    present = {name: function for name, function in made.items() if function is not None}
    texts = [kernel.SourceFile(written(name, function)) for name, function in present.items()]
    with kernel.shared_library(texts, kernel.default_cache()) as built:
        try:
            compiled = {name: ca.external(name, str(built.path)) for name in present}
        except RuntimeError as error:
            why = " ".join(str(error).split())
            raise kernel.KernelUnavailable(f"the compiled functions cannot be loaded: {why}") from error
    functions = SimpleNamespace(**{name: compiled.get(name) for name in EVALUATED})
    nlp = Nlp(source.functions.nlp, *(compiled.get(name) for name in ("nlp", "nlp_gradient", "nlp_jacobian")))
    spent = time.perf_counter() - began
    description = Description(
        "c", 1, threads, "double", built.compiler.version, built.cached, spent, built.note, flags=built.flags
    )
    return Backend(description, FunctionEvaluator(cast(ProblemFunctions, functions), threads), nlp)


def parts(nlp: Function) -> dict[str, Function]:
    """Return the functions that an NLP solver needs without second derivatives."""
    z, smoothing = ca.MX.sym("z", nlp.size1_in(0)), ca.MX.sym("smoothing")
    objective, constraints = nlp(z, smoothing)
    results = {"nlp": [objective, constraints], "nlp_gradient": [objective, ca.gradient(objective, z)]}
    if constraints.numel():
        results["nlp_jacobian"] = [constraints, ca.jacobian(constraints, z)]
    return {name: ca.Function(name, [z, smoothing], outputs) for name, outputs in results.items()}


def written(name: str, function: Function) -> str:
    """Return the C text of a function under this name."""
    generator = ca.CodeGenerator(name)
    arguments = [ca.MX.sym("z", function.sparsity_in(0)), ca.MX.sym("smoothing")]
    same = function if function.name() == name else ca.Function(name, arguments, function.call(arguments))
    generator.add(same)
    return VISIBLE + str(generator.dump())
