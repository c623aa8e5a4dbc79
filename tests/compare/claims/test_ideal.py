"""The law alone against a wall: known rest, known peak, and a delay margin that the delayed loop confirms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hqp_rp.compare.claims.ideal import delay_margin, ideal_contact


def test_it_comes_to_rest_with_the_force_and_peaks_where_the_closed_form_does() -> None:
    """Touching from the start it is a linear oscillator under a step: peak F (1 + exp(-pi zeta / sqrt(1 - zeta^2)))."""
    M, B, K = 15.0, 600.0, 1e5
    time, force = ideal_contact(M, B, K, 30.0, 0.0, 2.0)
    zeta = B / (2.0 * math.sqrt(M * K))
    assert force.max() == pytest.approx(30.0 * (1.0 + math.exp(-math.pi * zeta / math.sqrt(1.0 - zeta**2))), rel=1e-3)
    assert force[-1] == pytest.approx(30.0, rel=1e-3)
    assert time[np.argmax(force)] == pytest.approx(math.pi / (math.sqrt(K / M) * math.sqrt(1.0 - zeta**2)), rel=1e-2)


@pytest.mark.parametrize(("M", "B", "K"), [(15.0, 150.0, 1e5), (15.0, 2449.0, 1e5), (15.0, 150.0, 1e3)])
def test_the_delayed_loop_is_stable_below_the_margin_and_not_above(M: float, B: float, K: float) -> None:
    margin, step = delay_margin(M, B, K), 2e-5
    late = []
    for delay in (0.9 * margin, 1.1 * margin):
        count, lag = round(300.0 * margin / step), round(delay / step)
        x = np.zeros(count + 1)
        v = 0.0
        x[0] = 1.0
        for k in range(count):
            v += step * (-B * v - K * (x[k - lag] if k >= lag else 1.0)) / M
            x[k + 1] = x[k] + step * v
        half = count // 2
        late.append(np.abs(x[half + half // 2 :]).max() / np.abs(x[half // 2 : half]).max())
    assert late[0] < 1.0 < late[1]


def test_the_margin_of_the_papers_numbers() -> None:
    assert delay_margin(15.0, 150.0, 1e5) == pytest.approx(1.5e-3, rel=0.01)
