"""Motions under a policy, all steps in one call, are those of single steps."""

from __future__ import annotations

import numpy as np
import pytest

import symphys
from symphys.codegen.runtime import thread_pool
from symphys.solvers.ddp.backward_pass import Bounds, backward_pass
from symphys.solvers.ddp.forward_pass import affine, forward_pass
from symphys.solvers.ddp.knots import PaddedKnots, knot_steps
from symphys.transcription import transcribe


@pytest.mark.slow
@pytest.mark.parametrize(("name", "room"), [("fastest_move", 0.02), ("pendulum", 0.02), ("cost_of_transport", 1e-4)])
def test_motions_under_a_policy_are_those_of_single_steps(
    name: str, room: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With knots that act in several steps, a duration that varies, sums, and bounds that hold some knots."""
    shooting = transcribe(symphys.load(name), threads=1).shooting
    assert shooting.staged is not None
    staged, z = shooting.staged(), shooting.start(3)
    motion, knots, size = staged.roll_out(z, 0.0), knot_steps(staged), len(z)
    scale = shooting.stacked("scale")
    costs = staged.expand(motion, np.zeros(len(staged.lower)), 2 * staged.penalties)
    free = Bounds(np.full(size, -np.inf), np.full(size, np.inf), scale)
    policy = backward_pass(staged.linearize_from_end(motion), costs, knots, staged.statics, free, 1.0)
    assert policy is not None
    padded = PaddedKnots.of(knots, z - room * scale, z + np.linspace(0.5, 1.5, size) * room * scale)
    lengths = np.array([1.0, 0.25, 1e-3])
    found = forward_pass(staged, motion, policy, padded, lengths)
    assert staged.follow(affine(motion, policy, padded), z, found.z, lengths, 0.0) is not None
    assert np.any(found.z == padded.upper[:-1]) and np.any(found.z != padded.lower[:-1])
    monkeypatch.setattr(staged, "follow", lambda *_: None)
    wanted = forward_pass(staged, motion, policy, padded, lengths)
    for one, other in zip(found[:3], wanted[:3], strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9)


def test_the_slopes_from_the_end_are_those_of_all_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """In runs, with one thread and with two, where runs are worth their while."""
    monkeypatch.setattr(thread_pool, "MIN_PART", 1e-12)
    for threads in (1, 2):
        shooting = transcribe(symphys.load("fastest_move"), threads=threads).shooting
        assert shooting.staged is not None
        staged = shooting.staged()
        motion = staged.roll_out(shooting.start(1), 0.0)
        whole, runs = staged.linearize(motion), [*staged.linearize_from_end(motion)][::-1]
        assert len(runs) > 1
        for name in ("a", "b", "c"):
            np.testing.assert_array_equal(np.concatenate([getattr(run, name) for run in runs]), getattr(whole, name))
