"""The libraries that know no program, compiled once for a machine: beside the tracing of the first program."""

from __future__ import annotations

import threading
from contextlib import suppress
from functools import cache

from symphys.codegen.errors import KernelUnavailable
from symphys.codegen.toolchain.build import width_of
from symphys.codegen.toolchain.cache import default_cache
from symphys.codegen.toolchain.libraries import kept_library, shared_library, texts_of
from symphys.codegen.toolchain.source_file import SourceFile, resource


@cache
def begin_own_libraries() -> None:
    """Begin to compile them on a thread of its own, where the first of them is not there; once in a process."""
    with suppress(KernelUnavailable):
        first = SourceFile(resource("graphs.c"), light=True)
        if kept_library(texts_of([first]), default_cache()) is None:
            threading.Thread(target=_compile, name="symphys-libraries", daemon=True).start()


def _compile() -> None:
    from symphys.codegen.emit.codes import interpreter
    from symphys.codegen.graph.graph import library
    from symphys.codegen.runtime.riccati import compiled_riccati

    with suppress(KernelUnavailable, OSError):
        library()
        lanes = width_of("auto", single=False)
        for source in (interpreter(lanes, False), interpreter(lanes, False, ("slopes.c",))):
            with shared_library([source], default_cache()):
                pass
        compiled_riccati()
