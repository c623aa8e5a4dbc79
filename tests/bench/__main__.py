"""`python -m tests.bench`: the command of the benchmark, or a sentence on what it lacks."""

from __future__ import annotations

import sys

from hqp_rp.core.errors import MissingExtraError
from hqp_rp.core.extras import require_report


def main() -> int:
    """Run the benchmark; 2 where the packages for reports are not installed."""
    try:
        require_report("The benchmark")
    except MissingExtraError as error:
        print(f"python -m tests.bench: {error}", file=sys.stderr)
        return 2
    from tests.bench.command import main as command

    return command()


if __name__ == "__main__":
    sys.exit(main())
