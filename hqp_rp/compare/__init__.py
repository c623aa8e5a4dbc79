"""Solvers side by side on scenarios: runs, metrics, figures, the written report and the command line."""
