"""A page to play with: drag a target, switch the solver while it runs, see what each level pays, record it."""

from hqp_rp.core.extras import require

require("hqp_rp.compare.play", "mujoco")
