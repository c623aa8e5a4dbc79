"""A solution as a figure: its bars are its numbers."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.patches import Rectangle

import hqp_rp


def bars(axis: object) -> list[Rectangle]:
    return [patch for patch in axis.patches if isinstance(patch, Rectangle)]  # type: ignore[attr-defined]


def test_the_bars_are_residual_sigma_and_x() -> None:
    A = np.array([[1.0, 0.0, 0.0], [1.0, 1e-6, 0.0]])
    rows = [(A[:1], 1.0, "one"), (A[1:], 3.0, "two"), (A[:1], 3.0, "three")]
    problem = hqp_rp.Problem([hqp_rp.Level.equality(row, [b], name=name) for row, b, name in rows])
    solution = hqp_rp.solve(problem, "null_space")
    residual, sigma, x = solution.plot().axes
    assert solution.x is not None
    np.testing.assert_allclose([bar.get_height() for bar in bars(x)], solution.x)
    shown = [max(level.sigma_min, 1e-17) for level in solution.levels]
    np.testing.assert_allclose([bar.get_width() for bar in bars(sigma)], shown)
    assert bars(residual)[2].get_width() == pytest.approx(2.0)
    assert residual.get_xscale() == sigma.get_xscale() == "log"
    labels = [label.get_text() for label in residual.get_yticklabels()]
    assert labels == ["1 one\nrank 1 of 1", "2 two\nrank 1 of 1", "3 three\nrank 0 of 1"]
    low, high = sigma.get_xlim()
    assert low < 1e-6 < 1.0 < high
    assert "|x| = " in x.get_title()


def test_a_solution_that_misses_nothing_is_drawn_too() -> None:
    figure = hqp_rp.solve(hqp_rp.Problem([hqp_rp.Level.equality(np.eye(2), [0.0, 0.0])]), "null_space").plot()
    assert len(figure.axes) == 3
    figure.canvas.draw()


def test_without_an_answer_there_is_no_figure() -> None:
    hard = hqp_rp.Level(np.eye(1), [0.0], [1.0])
    refused = hqp_rp.solve(hqp_rp.Problem([hqp_rp.Level.equality([[1.0]], [1.0])], hard), "pseudo_inverse")
    with pytest.raises(ValueError, match="There is no x to judge"):
        refused.plot()
