"""The part of an examination that every run has: whether the motion is one that physics allows."""

from __future__ import annotations

from typing import Any

import numpy as np

from symphys.transcription import Record, Transcription
from symphys.verification.balance import balance
from symphys.verification.contacts import contacts
from symphys.verification.tunnelling import tunnelling


@np.errstate(invalid="ignore", over="ignore", divide="ignore")  # numbers that are not finite are reported as such
def survey(transcription: Transcription, record: Record) -> dict[str, Any]:
    """Energy and momentum, contacts, and tunnelling; it takes little beside a solve.

    Each module says what its numbers are.
    """
    rollout = transcription.rollout
    return {**balance(rollout, record), **contacts(rollout, record), **tunnelling(rollout, record)}
