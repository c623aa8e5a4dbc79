"""Settings that must be in the environment before anything else is imported."""

import os
import sys
from pathlib import Path

# numba writes the index of a kernel's cache and the machine code one after the other, without a lock: two processes
# that compile one kernel for different argument types at the same time may leave an index that names the other one's
# code. So every pytest-xdist worker keeps a cache of its own.
_worker = os.environ.get("PYTEST_XDIST_WORKER")
if _worker is not None:
    assert "numba" not in sys.modules, "numba has read its settings before the worker's own cache was set"
    os.environ["NUMBA_CACHE_DIR"] = str(Path(__file__).parents[1] / ".pytest_cache" / "numba" / _worker)

import hypothesis  # noqa: E402

# The first call of a kernel compiles it: how long an example takes says nothing.
hypothesis.settings.register_profile("compiled", deadline=None)
hypothesis.settings.load_profile("compiled")
