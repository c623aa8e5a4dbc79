"""The subcommands of `hqp-rp`, a module each. Each loads what it runs when it runs, and says what that lacks."""

from hqp_rp.core.extras import require

require("The command line hqp-rp", "tyro")
