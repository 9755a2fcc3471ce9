"""Shared libraries of C files: from the cache, or built and kept there."""

from __future__ import annotations

import ctypes
import hashlib
import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache as cached
from pathlib import Path
from typing import IO

from symphys.codegen.errors import KernelUnavailable
from symphys.codegen.toolchain.cache import Cache, default_cache
from symphys.codegen.toolchain.compiler import Compiler, find_compiler, processor
from symphys.codegen.toolchain.processes import ELSEWHERE
from symphys.codegen.toolchain.source_file import SourceFile, resource
from symphys.codegen.toolchain.temporary import TemporaryFolder
from symphys.records import dataclass


@dataclass(frozen=True)
class Built:
    """A library on disk, and how it came there."""

    path: Path
    compiler: Compiler
    flags: tuple[str, ...]
    cached: bool
    note: str = ""


@contextmanager
def shared_library(parts: Sequence[SourceFile], cache: Cache, texts: str | None = None) -> Iterator[Built]:
    """Build the library of these sources; one that is not kept in the cache lasts as long as the context.

    ``texts``: what stands for the sources; None: their checksum.
    """
    compiler = find_compiler()
    flags = compiler.flags(processor())
    key = library_key(texts_of(parts) if texts is None else texts, compiler, flags)
    if (path := cache.find(key)) is not None:
        yield Built(path, compiler, flags, cached=True)
        return
    with temporary_folder("symphys-kernel-") as folder:
        with cache.building(key):
            found = cache.find(key)  # another process may have built it meanwhile
            path, note = (found, "") if found else _kept(cache, key, compiler.build(parts, flags, Path(folder)))
        yield Built(path, compiler, flags, found is not None, note)


def kept_library(texts: str, cache: Cache) -> Built | None:
    """Return the library of C files with that checksum, if it is kept."""
    compiler = find_compiler()
    flags = compiler.flags(processor())
    path = cache.find(library_key(texts, compiler, flags))
    return None if path is None else Built(path, compiler, flags, cached=True)


def compile_for(given: IO[bytes]) -> None:
    """Keep the library that a ``Background`` asks for, and print its path, or why there is none."""
    request = json.load(given)
    parts, texts = [SourceFile(**part) for part in request["parts"]], request["texts"]
    cache = Cache(Path(request["cache"]["folder"]), request["cache"]["limit"])
    try:
        with shared_library(parts, cache, texts) as built:
            said = {"error": built.note} if built.note else {"path": str(built.path)}
    except KernelUnavailable as error:
        said = {"error": str(error)}
    with suppress(OSError):  # the process that started this one may have ended
        print(json.dumps(said), flush=True)


def texts_of(parts: Sequence[SourceFile]) -> str:
    """Return a checksum of C files."""
    return hashlib.sha256(
        "\0".join(
            f"{part.narrow} {part.straight} {part.broadcasts} {part.light} {part.text}" for part in parts
        ).encode()
    ).hexdigest()


def library_key(texts: str, compiler: Compiler, flags: Sequence[str]) -> str:
    """Return the key under which the library of C files with that checksum is kept."""
    return hashlib.sha256("\0".join([texts, *compiler.command, compiler.version, *flags]).encode()).hexdigest()[:32]


def _kept(cache: Cache, key: str, path: Path) -> tuple[Path, str]:
    """Return the library in the cache; or its path and the reason why it was not kept."""
    try:
        return cache.store(key, path), ""
    except OSError as error:
        why = f"the kernel was not kept in {cache.folder} ({error.strerror}); it will be compiled again next time"
        return path, why


def temporary_folder(kind: str) -> TemporaryFolder:
    """Make a ``TemporaryFolder``; KernelUnavailable if there is no room for one."""
    try:
        return TemporaryFolder(kind)
    except OSError as error:
        where = f"the temporary folder {error.filename}" if error.filename else "a temporary folder"
        raise KernelUnavailable(f"{where} cannot be made: {error.strerror or error}; {ELSEWHERE}") from error


def loaded(path: Path) -> ctypes.CDLL:
    """Load a compiled library; KernelUnavailable if the system refuses."""
    try:
        return ctypes.CDLL(str(path))
    except OSError as error:
        raise KernelUnavailable(f"the compiled kernel cannot be loaded: {error}") from error


@cached
def own_library(name: str, light: bool = False) -> ctypes.CDLL:
    """Return a C file of this package that knows no program, built once for a machine; KernelUnavailable if not.

    ``light``: see ``SourceFile``.
    """
    with shared_library([_own(name, light)], default_cache()) as built:
        return loaded(built.path)


def has_own_library(name: str, light: bool = False) -> bool:
    """Whether ``own_library`` was built before; KernelUnavailable if it cannot be."""
    return kept_library(texts_of([_own(name, light)]), default_cache()) is not None


def _own(name: str, light: bool) -> SourceFile:
    return SourceFile(resource(name), light=light)
