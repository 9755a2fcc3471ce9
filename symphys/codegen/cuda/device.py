"""The interface of a device that launches kernels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from numpy.typing import DTypeLike, NDArray

Array = Any
"""An array in the memory of the device."""
Module = Any
"""Loaded kernels."""


class Device(Protocol):
    """Something that runs CUDA kernels.

    Attributes:
        name: in words.
        lanes: threads of a warp, which are the robots of a block.
    """

    name: str
    lanes: int

    def load(self, texts: Sequence[str]) -> tuple[Module, str, bool, str]:
        """Return kernels from their texts: with the compiler, whether they came from a cache, and a note or nothing."""

    def free(self) -> int:
        """Return the bytes that an array can have."""

    def put(self, values: NDArray[Any]) -> Array:
        """Return a copy on the device."""

    def empty(self, shape: tuple[int, ...], dtype: DTypeLike) -> Array:
        """Return memory with any values."""

    def lacks(self) -> str:
        """Return in one line why the device cannot multiply its arrays; empty if it can."""

    def address(self, array: Array) -> int:
        """Return the address of the array's first word."""

    def get(self, array: Array) -> NDArray[Any]:
        """Return a copy of an array, once all that was launched is done."""

    def launch(self, module: Module, name: str, blocks: int, threads: tuple[int, int], job: Array) -> None:
        """Begin to run a kernel of one argument, the address of its job."""

    def wait(self) -> None:
        """Wait until all that was launched is done."""
