"""The benchmark: our solvers beside what a user would pick instead, timed in turns, with a history of ratios.

What flows: `entrants` (who) meet `families` of problems and `steps` of a control loop (what); `timing` takes turns and
ratios, `accuracy` judges every answer. `remote`, `remote_steps` and `peer_worker` time peers in environments of their own.
`native_loop` compiles loops without Python; with it `floor`, `lexls` and `native_qps`, then `allocations` and `step_parts`,
gathered by `inside`, look into a call; `extra` looks at growth and start-up. `measure` does all that is asked for, `history`
keeps ratios, `record` holds it, `inside_report`, `ratios_report` and `report` tell it in the words of `sentences.j2`,
and `bench` is the whole, `command` its command line.
"""

from __future__ import annotations

import pathlib

ROOT = pathlib.Path(__file__).parents[2]
"""The folder in which `python -m tests.bench...` finds this package."""
