"""Compiled kernels of all tests go into a cache of the checkout."""

from __future__ import annotations

import os
from pathlib import Path

os.environ.setdefault("SYMPHYS_CACHE", str(Path(__file__).parents[1] / "build" / "kernels"))
