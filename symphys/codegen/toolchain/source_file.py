"""C files: what is compiled, and with which flags."""

from __future__ import annotations

from importlib.resources import files

from symphys.records import dataclass

ROOM = "symphys.codegen"


@dataclass(frozen=True)
class SourceFile:
    """A C file.

    Attributes:
        text: C.
        narrow: whether it is for fewer lanes than a vector register has.
        straight: whether functions are straight lines of values, each computed once.
        broadcasts: whether functions read numbers into all lanes of a vector.
        light: whether little time is spent in it, and compiling should be quick.
    """

    text: str
    narrow: bool = False
    straight: bool = False
    broadcasts: bool = False
    light: bool = False


def resource(name: str) -> str:
    """Return the text of a C file of this room."""
    return files(ROOM).joinpath(name).read_text(encoding="utf-8")
