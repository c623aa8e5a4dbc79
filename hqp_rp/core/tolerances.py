"""Every tolerance of the Python side of core and solvers, with its meaning and unit; the native core has its own header."""

from __future__ import annotations

RANK = 1e-12
"""The rank rule: a singular value of A_k restricted to the remaining null space counts as zero when <= this * ||A_k||_2."""

SOLVED = 1e-9
"""What `SOLVED` promises unless a solver declares another: avoidable residual over ||A_k|| ||x|| + ||b_k||."""

CERTIFIED = 1e-9
"""Default of `certify`: what a relative excess may be; also how near to its bound, relative, a row counts as active."""

STEP_COST = 1e-5
"""What a move d costs in the certificate beside what it removes from a level: this times ||A_k|| ||d||."""

UNEVEN = 100.0
"""Rows of a level whose lengths are further apart are judged in parts too, the short ones in their own size ..."""

FAR_TARGETS = 1e6
"""... and so are rows of which ||a_i|| ||x|| + |bound_i| are further apart than this."""

BAND = 0.1
"""Each such part holds rows no larger than this times those of the part before."""

SHORT_NORMAL = 1e-9
"""An active row's normal, of length one, of which no more than this is free: levels judged before hold it already."""

MULTIPLIER = 1e-9
"""A multiplier counts as positive above this part of the largest."""

ACTIVE = 1e-9
"""A row counts as active, or as violated, within or beyond this part of ||a_i|| ||x|| + |bound_i|."""

CONTRADICTION = 1e-9
"""Hard rows contradict each other where every x misses one by more than this part of the size of x and the bounds."""

FARKAS_WEIGHT = 1e-9
"""Weights of a proof of contradiction below this part of the largest are rounding error."""

FARKAS_ROUNDING = 1e-12
"""What rounding may contribute to the margin of such a proof, as a part of what it adds up."""

FARKAS_REACH = 1e3
"""A proof of contradiction holds for every y within this many times the size of x and the bounds."""

EXACT_MULTIPLIERS = 1e-12
"""Non-negative least squares are done where what is left is this part of the right-hand side ..."""

PULL = 1e-13
"""... or where no column pulls by more than this part of it."""

TALL_RANK = 1e-14
"""The rank of one least-squares problem of weighted levels, as a part of its largest singular value."""

UNILATERAL_ROUNDING = 1e-15
"""A hard row that an answer misses by this much, relative, is met."""

SATURATED = 1e-12
"""An unknown this near to its bound, relative, is saturated."""

NEAR_ZERO = 1e-12
"""An x shorter than this part of what a problem's bounds could ask of it is judged as one at zero: see `certify`."""

PULLS_CANCEL = 1e-9
"""Rows whose pulls add up to no more than this part of them leave x between them; others pull in vain."""

REACHED = 1e-12
"""A row of a damped level that misses its bound by more than this part of ||a_i|| ||x|| + |bound_i| keeps the value it has."""

ROUNDED = 2.0**-48
"""What rounding may leave of a coordinate of a point that was reached, as a part of ||x||."""

TRUNCATED = 1e3
"""Truncation at a level: how strongly a direction at or below the threshold is damped, as a multiple of ||A_k||."""

NEARLY_FREE = 1e-4
"""Judging a truncated level: a move costs this part of one in a direction that its policy damps, until no bias is left."""

STANDSTILL = 1e-13
"""Judging a damped level: a step of less than this part of what it starts from is rounding error."""

MEETS = 1e-6
"""Rows without one limit count as feasible where a point misses none of them by more than this part of its size and bound."""
