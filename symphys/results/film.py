"""film.npz: motions along a solve, from the guess to the solution, coarse enough to be played in a page."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from symphys.records import dataclass
from symphys.results.drawable import drawable
from symphys.results.text_files import ReportError, read_archive
from symphys.types import Array, Ints

NUMBERS = 60_000
"""Numbers that the motions of a film have together, at most about."""
LEAST_FRAMES, MOST_FRAMES = 12, 120
LEAST_MOTIONS, MOST_MOTIONS = 8, 60


@dataclass(frozen=True)
class FilmMotions:
    """Exact motions of iterations.

    Attributes:
        rows: (K,) the rows of trace.csv that they are of.
        time: (K, F) [s] of the frames.
        position: (K, F, B, 3) [m].
        orientation: (K, F, B, 4) unit quaternions w x y z.
    """

    rows: Ints
    time: Array
    position: Array
    orientation: Array

    def thinned(self, motions: int, frames: int) -> FilmMotions:
        """Return an even choice of at most so many motions and frames."""
        rows, shown = (
            np.linspace(0, have - 1, min(have, most)).round().astype(int)
            for have, most in zip(self.time.shape, (motions, frames), strict=True)
        )
        parts = (each[rows][:, shown] for each in (self.time, self.position, self.orientation))
        return FilmMotions(self.rows[rows], *parts)

    def arrays(self) -> dict[str, Array]:
        """Return what is stored, in single precision."""
        whole = {"time": self.time, "position": self.position, "orientation": self.orientation}
        with np.errstate(over="ignore", invalid="ignore"):  # a motion that blows up is left out when it is read
            return {"rows": self.rows.astype(float), **{name: each.astype(np.float32) for name, each in whole.items()}}


def film_size(bodies: int, motions: int, steps: int) -> tuple[int, int]:
    """Return how many motions of how many frames a film has."""
    count = min(motions, MOST_MOTIONS, max(NUMBERS // (LEAST_FRAMES * 7 * bodies), LEAST_MOTIONS))
    frames = int(np.clip(NUMBERS // (7 * bodies * max(count, 1)), LEAST_FRAMES, MOST_FRAMES))
    return count, min(frames, steps + 1)


def read_film(path: Path) -> FilmMotions | None:
    """Read a film; None where there is none, or none that can be played."""
    try:
        arrays = read_archive(path)
        rows, time, position, orientation = (arrays[name] for name in ("rows", "time", "position", "orientation"))
    except (ReportError, KeyError):
        return None
    count, frames = time.shape if time.ndim == 2 else (0, 0)
    bodies = position.shape[2] if position.ndim == 4 else 0
    sized = (count, frames, bodies)
    if rows.shape != (count,) or not all(sized) or position.shape != (*sized, 3) or orientation.shape != (*sized, 4):
        return None
    whole = [np.asarray(each, float) for each in (time, position, orientation)]
    sound = np.all([np.isfinite(drawable(each)).reshape(count, -1).all(axis=1) for each in whole], axis=0)
    return FilmMotions(rows.astype(int)[sound], *(each[sound] for each in whole)) if sound.any() else None
