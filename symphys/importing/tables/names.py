"""Names of a problem file for the parts of a model: identifiers, each of which is used once."""

from __future__ import annotations

import keyword
import re
from collections.abc import Iterable

LONGEST = 64
WORDS = (
    "sin cos tan asin acos atan atan2 sinh cosh tanh sqrt exp log abs sign min max clip hypot norm sumsqr sum mean dot "
    "cross rotate world ground gravity time pi alive"
)
TAKEN = (*keyword.kwlist, *WORDS.split())
"""Words that mean something in formulas or tables."""


class Names:
    """Gives every part a name of its own.

    Bodies, joints, surfaces, sites and sensors share one set of names in a problem file, but not in a model. A name
    that is taken gets the kind of the part behind it: ``knee_joint``.
    """

    def __init__(self) -> None:
        """Nothing is taken but words with a meaning."""
        self._taken = {word.casefold() for word in TAKEN}
        self.renamed: list[tuple[str, str]] = []

    def give(self, kind: str, wanted: str, fallback: str = "") -> str:
        """A name like the one that is wanted; ``fallback`` for a part without one."""
        base = re.sub(r"\W+", "_", wanted, flags=re.ASCII).strip("_")[: LONGEST - 8] or fallback or kind
        base = base if base[0].isascii() and base[0].isalpha() else f"{kind}_{base}"[: LONGEST - 8]
        found = next(name for name in self._offers(kind, base) if name.casefold() not in self._taken)
        self._taken.add(found.casefold())
        if wanted and found != wanted and kind != "group":
            self.renamed.append((f"{kind} {wanted}", found))
        return found

    def _offers(self, kind: str, base: str) -> Iterable[str]:
        yield base
        last = base.rpartition("_")[2]
        yield from (f"{base}_{kind}",) if last != kind else ()
        number = 2
        while True:
            yield f"{base}_{number}"
            number += 1
