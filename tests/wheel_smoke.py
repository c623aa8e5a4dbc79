"""What a wheel must do in an empty environment with numpy alone: every light solver answers, and the answers are certified."""

import numpy as np

import hqp_rp

rng = np.random.default_rng(0)
levels = [hqp_rp.Level.equality(rng.standard_normal((3, 7)), rng.standard_normal(3)) for _ in range(2)]
free, boxed = hqp_rp.Problem(levels), hqp_rp.Problem(levels, hard=hqp_rp.Level(np.eye(7), -0.4, 0.4))
for name in ("null_space", "reverse_priority", "hierarchical_active_set"):
    solution = hqp_rp.solve(free, name)
    assert hqp_rp.certify(free, solution.x).ok, name
assert hqp_rp.certify(boxed, hqp_rp.solve(boxed, "hierarchical_active_set").x).ok
assert hqp_rp.solve(boxed, "saturation_null_space").status.ok
assert hqp_rp.solve_batch(free.matrix[None], free.lower[None], None, free.offsets, solver="null_space").solved.all()
print(f"hqp_rp {hqp_rp.__version__} works.")
