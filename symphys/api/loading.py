"""``load``, and what names a problem; they live where problems are read."""

from symphys.problem.loading import Source, load

__all__ = ["Source", "load"]
