"""The libraries that know no program, compiled once for a machine: beside the tracing of the first program."""

from __future__ import annotations

import threading
from contextlib import suppress
from functools import cache

from symphys.codegen.errors import KernelUnavailable
from symphys.codegen.graph.graph import OWN, library
from symphys.codegen.toolchain.build import width_of
from symphys.codegen.toolchain.cache import default_cache
from symphys.codegen.toolchain.libraries import has_own_library, shared_library


@cache
def begin_own_libraries() -> None:
    """Begin to compile them on a thread of its own, where the first of them is not there; once in a process."""
    with suppress(KernelUnavailable):
        if not has_own_library(*OWN):
            threading.Thread(target=_compile, name="symphys-libraries", daemon=True).start()


def _compile() -> None:
    from symphys.codegen.emit.codes import SLOPES_DRIVER, interpreter
    from symphys.codegen.runtime.riccati import compiled_riccati

    with suppress(KernelUnavailable, OSError):
        library()
        lanes = width_of("auto", single=False)
        for source in (interpreter(lanes, False), interpreter(lanes, False, SLOPES_DRIVER)):
            with shared_library([source], default_cache()):
                pass
        compiled_riccati()
