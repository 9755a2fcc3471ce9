"""The examination of how far a gradient and a solution can be trusted, for ``check`` and for every solve.

Its numbers are explained in words by ``symphys.findings``.
"""

from symphys.verification.examination import examine, finer_values, survey
from symphys.verification.refinement import finer_errors

__all__ = ["examine", "finer_errors", "finer_values", "survey"]
