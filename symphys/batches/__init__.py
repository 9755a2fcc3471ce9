"""Batches: many runs, in any number of processes and commands."""

from symphys.batches.batch import BatchResult, Preview, previews, run_batch
from symphys.batches.engines import ENGINES
from symphys.batches.following import run_on
from symphys.batches.ledger import Observer
from symphys.batches.limits import BatchLimits

__all__ = ["ENGINES", "BatchLimits", "BatchResult", "Observer", "Preview", "previews", "run_batch", "run_on"]
