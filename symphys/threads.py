"""One thread for linear algebra: the matrices are small, and results must not depend on how many runs go at once."""

from __future__ import annotations

import os

VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")


def limit() -> None:
    """Ask for one thread, unless the environment says otherwise.

    Works for libraries that are loaded later, here and in processes started from here.
    """
    for name in VARIABLES:
        os.environ.setdefault(name, "1")
