"""The operations of graphs in C."""

from __future__ import annotations

UNARY = "exp log sqrt sin cos tan asin acos atan floor ceil erf sinh cosh tanh asinh acosh atanh log1p expm1"
LIBRARY = tuple(UNARY.split())
LIBRARY_OF_TWO = ("pow", "fmod", "remainder", "copysign", "atan2", "hypot")
"""Functions of the C library."""
INFIX = {"add": "+", "sub": "-", "mul": "*", "div": "/"}
COMPARE = {"lt": "<", "le": "<=", "eq": "==", "ne": "!="}
FORMS = (
    {name: f"{{0}} {sign} {{1}}" for name, sign in INFIX.items()}
    | {name: f"(I)({{0}} {sign} {{1}})" for name, sign in COMPARE.items()}
    | {name: f"{name}_({{0}})" for name in LIBRARY}
    | {name: f"{name}_({{0}}, {{1}})" for name in LIBRARY_OF_TWO}
    | {
        "neg": "-{0}",
        "not": "~{0}",
        "and": "{0} & {1}",
        "or": "{0} | {1}",
        "isnt0": "(I)({0} != S(0.0))",
        "one": "(V)({0} & (I)S(1.0))",
        "iez": "(V)({0} & (I){1})",
        "select": "(V)(({0} & (I){1}) | (~{0} & (I){2}))",
        "fabs": "(V)((I){0} & MAGNITUDE)",
        "fma": "FMA({0}, {1}, {2})",
        "fms": "FMA({0}, {1}, -{2})",
        "fnma": "FMA(-{0}, {1}, {2})",
    }
)
"""C expressions of operands {0}, {1}, {2}, for vectors."""
PLAIN = (
    FORMS
    | {name: f"{{0}} {sign} {{1}}" for name, sign in COMPARE.items()}
    | {name: f"{name}({{0}})" for name in LIBRARY}
    | {name: f"{name}({{0}}, {{1}})" for name in LIBRARY_OF_TWO}
    | {
        "not": "!{0}",
        "isnt0": "{0} != S(0.0)",
        "one": "(V){0}",
        "iez": "{0} ? {1} : S(0.0)",
        "select": "{0} ? {1} : {2}",
        "fabs": "fabs({0})",
    }
)
"""C expressions of operands for single numbers in plain C, where a mask is 0 or 1."""
SCALAR = (
    FORMS | {name: PLAIN[name] for name in ("not", "isnt0", "one", "iez", "select", *COMPARE)} | {"fabs": "fabs_({0})"}
)
"""C expressions of operands for blocks of one lane, in either precision."""
