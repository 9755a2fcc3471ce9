"""Jacobians of programs without a loop: values of several points in lanes, then rows of one point in lanes."""

from symphys.codegen.slopes.kernel import SlopeKernel, compile_slopes

__all__ = ["SlopeKernel", "compile_slopes"]
