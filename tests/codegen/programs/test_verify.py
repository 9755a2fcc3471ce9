"""A program that contradicts itself is refused when it is made, with the call and the words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import casadi as ca
import pytest

from symphys.codegen import FunctionCall, Place, Program, ProgramError

X = ca.SX.sym("x", 2)
TWICE = ca.Function("twice", [X], [2 * X])
Z, SUM, A, B, STATE = Place(0, 2), Place(2, 2), Place(4, 2), Place(6, 2), Place(8, 2, 2)


def make(**parts: Any) -> Program:
    whole: Mapping[str, Any] = {"size": 20, "z": Z, "parameters": Place(0, 0), "zeroed": (SUM,), "steps": 5}
    return Program(**{**whole, "outputs": {"sum": SUM}, **parts})


def call(a: Place, b: Place, accumulate: bool = False) -> FunctionCall:
    return FunctionCall(TWICE, (a,), (b,), accumulate)


START = call(Z, STATE)


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"steps": -1}, "steps must be 0 or more, not -1"),
        ({"z": Place(19, 2)}, "z: words 19 to 20 lie outside the memory of 20 words"),
        ({"zeroed": (Place(1, 2),)}, "zeroed place: words 1 to 2 overlap another input"),
        ({"constants": ((Place(3, 1), (1.0,)),)}, "constant: words 3 to 3 overlap another input"),
        ({"constants": ((A, (1.0,)),)}, "has 2 words, but there are 1 values"),
        ({"prologue": (call(Z, A), call(Z, A))}, r"prologue call 1 \(twice\): words 4 to 5 are written already"),
        ({"prologue": (call(A, B), call(Z, A))}, "prologue call 0.*reads words 4 to 5, before they are complete"),
        ({"prologue": (call(A, B),)}, "reads words 4 to 5, which nobody writes"),
        ({"prologue": (call(Z, A, True),)}, "adds to words 4 to 5, which nobody wrote or zeroed before"),
        ({"prologue": (call(Z, Place(4, 3)),)}, "result 0 has 2 words, its place 3"),
        ({"prologue": (FunctionCall(TWICE, (Z, Z), (A,)),)}, "has 1 arguments but 2 places"),
        ({"body": (call(B, A), call(Z, B))}, r"body call 0 \(twice\): reads words 6 to 7, before they are complete"),
        ({"body": (call(Z, A),), "epilogue": (call(A, B),)}, "reads words 4 to 5, which are scratch of the body"),
        ({"body": (call(Z, A),), "outputs": {"a": A}}, "output a: reads words 4 to 5, which are scratch"),
        ({"outputs": {"a": A}}, "output a: reads words 4 to 5, which nobody writes"),
        ({"body": (call(Z, SUM, True), call(SUM, A))}, "body call 1.*reads words 2 to 3, before they are complete"),
        ({"body": (call(STATE, STATE.later()),)}, "body call 0.*reads words 8 to 9, which nobody writes"),
        ({"prologue": (START,), "body": (call(Z, STATE),)}, "body call 0.*words 8 to 9 are written already"),
        ({"prologue": (START,), "body": (call(STATE.later(), A), call(STATE, STATE.later()))}, "before they are"),
        ({"body": (call(Z, Place(8, 2, 1)),)}, "its steps overwrite each other"),
        ({"body": (call(Z, Place(8, 2, 3)),)}, "lie outside the memory"),
        ({"body": (call(Z, STATE, True),)}, "with a stride; write them instead"),
    ],
)
def test_faults_are_named(parts: dict[str, Any], message: str) -> None:
    with pytest.raises(ProgramError, match=message):
        make(**parts)


def test_functions_must_be_dense_columns_of_sx() -> None:
    x = ca.MX.sym("x", 2)
    free = ca.Function("free", [X], [X * ca.SX.sym("y")], {"allow_free": True})
    sparse = ca.Function("sparse", [X], [ca.SX(ca.Sparsity(2, 1))])
    for function, message in (
        (ca.Function("mx", [x], [x]), "is not an SX Function"),
        (free, "has free symbols"),
        (sparse, "result 0 is not a dense column"),
    ):
        with pytest.raises(ProgramError, match=message):
            make(prologue=(FunctionCall(function, (Z,), (A,)),))


def test_sound_programs_pass() -> None:
    make(prologue=(START,), body=(call(STATE, STATE.later()), call(STATE, A), call(A, SUM, True)))
    make(body=(call(Z, A), call(Z, A, True), call(A, B)), epilogue=(call(SUM, Place(8, 2)),))
    make(steps=0, body=(call(Z, A),))
