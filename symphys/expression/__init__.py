"""The formula language of problem files: parsed, never executed as a program.

A formula is a number or a column vector. It is made of

- numbers (``1.5``, ``2e-3``), ``pi``, names (``time``) and names with one dot (``ball.velocity``)
- ``+ - * / **``; a number combines with every component of a vector, vectors of equal length component by component
- components ``ball.position[2]``, ``ball.position[-1]`` and ranges ``ball.position[0:2]``, from 0 as in Python
- vectors ``[1, 2, 3]``; a list joins what it holds: ``[ball.position[0:2], 0.5]`` has three components
- calls of the functions in ``FUNCTIONS``
- of a whole motion: ``start.NAME``, ``end.NAME``, ``integral(...)``, ``average(...)``

There are no comparisons, keywords, strings, attributes of values or anything else.
"""

from symphys.expression.columns import FormulaError
from symphys.expression.formula import Formula, MotionPart
from symphys.expression.functions import CONSTANTS, FUNCTIONS, OVER_TIME
from symphys.expression.parse import parse

__all__ = ["CONSTANTS", "FUNCTIONS", "OVER_TIME", "Formula", "FormulaError", "MotionPart", "parse"]
