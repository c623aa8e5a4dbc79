"""When something holds: the threshold of every criterion, and the word that algebra forces."""

from __future__ import annotations

FAILS = "does not hold"
"""The word that a counterexample or a refuted theorem forces."""

KEPT = 0.05 * 30.0
"""N: the force is kept when its RMS error in the last third of a run is at most 5 % of 30 N."""
GENTLE = 0.05 * 30.0
"""N: the overshoot of a contact that goes well."""
ALTERNATING = 0.1
"""The alternating force is tracked when the RMS error is at most this share of the RMS value of its alternating part."""
RESTS = 0.01 * 30.0
"""N: the force rests when it stays within 1 % of 30 N."""
IDEAL = 0.1
"""A response is the desired one when it is never farther from the ideal than this share of the ideal's largest value."""
BETTER, STRICTER, LOOSER = 0.95, 0.85, 0.983
"""One figure is better than another when it is at most 0.95 of it; three times that difference, and a third."""
BOUNDED = 10.0
"""Joint velocities are bounded near a singularity when they are at most ten times those at regular postures."""
ON_PATH = 5e-3
"""m: a tool is on its path when it is never farther from it."""
