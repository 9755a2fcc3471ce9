"""How far a gradient and a solution through contact can be trusted: one examination, for ``check`` and for every solve.

Its numbers are explained in words by ``symphys.findings``.
"""

from symphys.verification.examination import examine, survey

__all__ = ["examine", "survey"]
