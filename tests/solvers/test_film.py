"""Points along a solve are an even choice of its iterations, and their motions are those of the exact rollout."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import symphys
from symphys.results.film import FilmMotions, film_size, read_film
from symphys.results.trajectories import read_trajectory
from symphys.solvers.core.film import MOST_POINTS, FilmRecorder


@pytest.mark.parametrize("iterations", [1, 2, 59, 60, 61, 119, 1000, 12345])
def test_the_choice_is_even_and_has_both_ends(iterations: int) -> None:
    film = FilmRecorder()
    for row in range(iterations):
        film.add(row, np.array([float(row)]))
    rows = [point.row for point in film.points]
    assert rows[0] == 0 and rows[-1] == iterations - 1 and len(rows) <= MOST_POINTS + 1
    assert len(rows) >= min(iterations, MOST_POINTS // 2)
    assert len(set(np.diff(rows[:-1]))) <= 1 and rows == sorted(set(rows))
    assert all(point.z == [point.row] for point in film.points)


def test_a_film_ends_with_the_motion_of_the_result(tmp_path: Path) -> None:
    solution = symphys.solve("ball_throw", "least_squares", folder=tmp_path)
    film, motion = read_film(solution.folder / "film.npz"), read_trajectory(solution.folder / "trajectory.npz")
    guess = read_trajectory(solution.folder / "guess.npz")
    assert film is not None and film.rows[0] == 0 and film.rows.max() < solution.trace.rows
    for k, whole in ((0, guess), (-1, motion)):
        at = np.searchsorted(whole.time, film.time[k] - 1e-6)
        np.testing.assert_allclose(film.position[k], whole.position[at], atol=1e-4)
        np.testing.assert_allclose(film.orientation[k], whole.orientation[at], atol=1e-4)


def test_films_are_bounded() -> None:
    for bodies in (1, 2, 17, 60):
        motions, frames = film_size(bodies, 60, 1000)
        assert 2 <= motions <= 60 and 12 <= frames <= 120
        assert motions * frames * bodies * 7 <= 61_000 or motions == 8
    assert film_size(1, 3, 10) == (3, 11)


def test_a_damaged_film_is_none(tmp_path: Path) -> None:
    good = FilmMotions(np.arange(2), np.zeros((2, 3)), np.zeros((2, 3, 1, 3)), np.zeros((2, 3, 1, 4)))
    arrays = good.arrays()
    np.savez(tmp_path / "film.npz", **arrays)
    assert read_film(tmp_path / "film.npz") is not None
    far = FilmMotions(good.rows, good.time, np.full((2, 3, 1, 3), 1e300), good.orientation).arrays()
    np.savez(tmp_path / "film.npz", **far)
    assert read_film(tmp_path / "film.npz") is None
    arrays["position"] = np.full((2, 3, 1, 3), np.nan)
    np.savez(tmp_path / "film.npz", **arrays)
    assert read_film(tmp_path / "film.npz") is None
    np.savez(tmp_path / "film.npz", **(arrays | {"time": np.zeros(3)}))
    assert read_film(tmp_path / "film.npz") is None
    (tmp_path / "film.npz").write_bytes(b"no archive")
    assert read_film(tmp_path / "film.npz") is None
    assert read_film(tmp_path / "nothing.npz") is None
