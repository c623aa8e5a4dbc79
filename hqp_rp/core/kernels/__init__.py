"""Compiled kernels of the closed forms (numba, cached), written to be read beside their equations."""
