"""Compilers, the cache of compiled kernels, the processor's abilities."""
