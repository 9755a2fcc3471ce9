"""Shapes of functions in a library of one lane: calls at once, and the access to the words of their places."""

from __future__ import annotations

from typing import NamedTuple

BROADCAST, INTERLEAVED, GATHER, GATHER_ALIASED = "all", "beside", "each", "turns"
"""One place for all lanes; places whose words are interleaved; a place for each lane; the same, where some coincide."""


class Access(NamedTuple):
    """The access to the words of an argument or result.

    Attributes:
        kind: see above.
        steps: from one word of a place to the next, for each lane.
    """

    kind: str
    steps: tuple[int, ...]


class Shape(NamedTuple):
    """The shape of a function that computes one call, or several at once.

    Attributes:
        lanes: calls at once.
        accesses: of the arguments, then of the results.
    """

    lanes: int
    accesses: tuple[Access, ...]


class PlaceWords:
    """C for the words of a function's places: ``i3`` is the fourth argument, ``o0`` the first result."""

    def __init__(self, word: str) -> None:
        """Keep the format ``word`` of a word, by the place's name and the number of the word."""
        self._word = word

    def pointers(self, name: str) -> list[str]:
        """Return the C expression of a place from the pairs of an entry."""
        return [name]

    def load(self, name: str, word: int | str) -> str:
        """Return the value of a word."""
        return self._word.format(name, word)

    def store(self, name: str, word: int | str, value: str) -> str:
        """Write a word."""
        return f"{self.load(name, word)} = {value};"

    def add(self, name: str, word: int | str, value: str) -> str:
        """Add to a word; ``value`` may say where what is there comes in, as {}."""
        to = self.load(name, word)
        return f"{to} = {value.format(to)};" if "{}" in value else f"{to} += {value};"

    def clear(self, name: str, word: str) -> str:
        """Zero a word, in all lanes."""
        return self.store(name, word, "S(0.0)")


class PackWords(PlaceWords):
    """Words of places in a library of one lane, where they may lie apart and lanes are calls.

    Results that several lanes add to are added to lane by lane, in the order of the calls: with whole vectors, of which
    one lane is kept.
    """

    def __init__(self, shape: Shape, arguments: int, backward: bool) -> None:
        """Keep the accesses; ``arguments``: the number of theirs; ``backward``: calls go from the last lane on."""
        self._lanes = shape.lanes
        names = [f"i{i}" for i in range(arguments)] + [f"o{i}" for i in range(len(shape.accesses) - arguments)]
        self._access = dict(zip(names, shape.accesses, strict=True))
        self._turn = range(shape.lanes)[:: -1 if backward else 1]

    @property
    def single(self) -> bool:
        """Whether it does one call."""
        return self._lanes == 1

    def pointers(self, name: str) -> list[str]:
        """Return the C expression of a place from the pairs of an entry."""
        if self._access[name].kind in (GATHER, GATHER_ALIASED):
            return [f"{name}_{lane}" for lane in range(self._lanes)]
        return [name]

    def load(self, name: str, word: int | str) -> str:
        """Return the value of a word."""
        kind, at = self._access[name].kind, self._words(name, word)
        if self.single:
            return at[0]
        if kind == BROADCAST:
            return f"ALL({at[0]})"
        if kind == INTERLEAVED:
            return f"*(const U *)&{at[0]}"
        return f"((V){{{', '.join(at)}}})"

    def store(self, name: str, word: int | str, value: str) -> str:
        """Write a word."""
        kind, at = self._access[name].kind, self._words(name, word)
        if self.single:
            return f"{at[0]} = {value};"
        if kind == INTERLEAVED:
            return f"*(U *)&{at[0]} = {value};"
        parts = " ".join(f"{at[lane]} = x[{lane}];" for lane in range(self._lanes))
        return f"{{ const V x = {value}; {parts} }}"

    def add(self, name: str, word: int | str, value: str) -> str:
        """Add to a word; ``value`` may say where what is there comes in, as {}."""
        kind, at = self._access[name].kind, self._words(name, word)
        if self.single:
            return super().add(name, word, value)
        sum_ = value if "{}" in value else f"{{}} + {value}"
        if kind == INTERLEAVED:
            to = f"*(U *)&{at[0]}"
            return f"{to} = {sum_.format(to)};"
        if kind == GATHER:
            return self.store(name, word, sum_.format(self.load(name, word)))
        parts = " ".join(f"x = {sum_.format(f'ALL({at[k]})')}; {at[k]} = x[{k}];" for k in self._turn)
        return f"{{ V x; {parts} }}"

    def clear(self, name: str, word: str) -> str:
        """Zero a word, in all lanes."""
        if self.single or self._access[name].kind == INTERLEAVED:
            return self.store(name, word, "S(0.0)")
        return f"{{ {' '.join(f'{at} = 0;' for at in dict.fromkeys(self._words(name, word)))} }}"

    def _words(self, name: str, word: int | str) -> list[str]:
        """Return the word of each lane; of lanes that are beside each other, or share a place, that of the first."""
        kind, steps = self._access[name]
        index = [word * step if isinstance(word, int) else f"{step} * {word}" for step in steps]
        pointers = self.pointers(name)
        apart = [f"{pointers[lane % len(pointers)]}[{index[lane]}]" for lane in range(len(steps))]
        return apart[:1] * self._lanes if kind in (BROADCAST, INTERLEAVED) else apart
