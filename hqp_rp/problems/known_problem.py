"""A problem with its exact answer, and the plain .npz file that holds both."""

from __future__ import annotations

import dataclasses
import json
from typing import TYPE_CHECKING, Any

import numpy as np

from hqp_rp.core.errors import FileError
from hqp_rp.core.io import PathLike, arrays_of, load_problem
from hqp_rp.core.paths import user_path
from hqp_rp.core.problem import FloatArray, Problem

if TYPE_CHECKING:
    from hqp_rp.core.truth import Truth


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class KnownAnswer:
    """A right answer of a problem.

    Attributes:
        x: (n,) the lexicographic least-norm optimum, each entry the float nearest to the exact number.
        residuals: (p,) ||violation of level k||_2 at the exact optimum.
        ranks: (p,) rank that each level adds to the ones before it; with inequality or hard rows, of the rows that bind.
    """

    x: FloatArray
    residuals: FloatArray
    ranks: tuple[int, ...]


@dataclasses.dataclass(frozen=True, slots=True, eq=False)
class KnownProblem:
    """A problem of the set.

    Attributes:
        name: "family/label". family: what it is an example of.
        problem: the problem.
        exact: its answer, ranks decided exactly; None when no x meets the hard rows.
        rule: its answer where singular values of A_k Z up to 1e-12 ||A_k||_2 count as zero, when that is another one
            (else None). The problem then is ambiguous: a solver that gives either is right.
        reason: why it is ambiguous, in a sentence; empty when it is not.
        distance: how far the problem is from what makes it hard, in the unit that `made` states; None where that has no
            meaning.
        seed, made: its seed, and a sentence on how it is made.
        proof: a sentence on how its answer was found and proven.
        set_version: the version of the set that it came with.
    """

    name: str
    family: str
    problem: Problem
    exact: KnownAnswer | None
    rule: KnownAnswer | None
    reason: str
    distance: float | None
    seed: int
    made: str
    proof: str
    set_version: str

    @property
    def feasible(self) -> bool:
        """False when the hard rows contradict each other: the right answer is to say so."""
        return self.exact is not None

    @property
    def ambiguous(self) -> bool:
        """Whether there are two right answers, one by each rank rule."""
        return self.rule is not None

    @property
    def answers(self) -> tuple[KnownAnswer, ...]:
        """The right answers: none, one, or (exact, rule)."""
        return tuple(answer for answer in (self.exact, self.rule) if answer is not None)

    def truth(self, rank_rule: str = "exact") -> Truth:
        """The answer as `hqp_rp.distance(problem, x, reference=...)` takes it.

        `rank_rule` is "exact" or "library"; the two differ on ambiguous problems only.
        """
        from hqp_rp.core.errors import unknown_name
        from hqp_rp.core.truth import Truth

        if rank_rule not in ("exact", "library"):
            raise unknown_name("rank rule", rank_rule, ("exact", "library"))
        answer = self.rule if rank_rule == "library" and self.rule is not None else self.exact
        method = f"hqp_rp.problems {self.set_version}"
        if answer is None:
            p = self.problem.p
            return Truth(None, np.full(p, np.nan), (0,) * p, False, "", method)
        return Truth(answer.x, answer.residuals, answer.ranks, self.ambiguous, self.reason, method)

    def __repr__(self) -> str:
        marks = ("" if self.feasible else ", infeasible") + (", ambiguous" if self.ambiguous else "")
        return f"KnownProblem({self.name!r}, {self.problem!r}{marks})"


def to_arrays(known: KnownProblem) -> dict[str, Any]:
    """The arrays of a known problem's file: those of `hqp_rp.save_problem`, and the answers beside them."""
    problem, p = known.problem, known.problem.p
    exact = known.exact
    if exact is None:
        exact = KnownAnswer(np.full(problem.n, np.nan), np.full(p, np.nan), (0,) * p)
    arrays = arrays_of(problem) | {
        "metadata": np.array(json.dumps({"problem_set": known.set_version, "name": known.name})),
        "set_version": np.array(known.set_version),
        "name": np.array(known.name),
        "family": np.array(known.family),
        "seed": np.array(known.seed),
        "made": np.array(known.made),
        "proof": np.array(known.proof),
        "distance": np.array(np.nan if known.distance is None else known.distance),
        "feasible": np.array(known.feasible),
        "ambiguous": np.array(known.ambiguous),
        "reason": np.array(known.reason),
        "x": exact.x,
        "residuals": exact.residuals,
        "ranks": np.array(exact.ranks, dtype=np.int64),
    }
    if known.rule is not None:
        arrays |= {
            "x_rule": known.rule.x,
            "residuals_rule": known.rule.residuals,
            "ranks_rule": np.array(known.rule.ranks, dtype=np.int64),
        }
    return arrays


def load_known(path: PathLike) -> KnownProblem:
    """The problem in a file of the set. Raises `FileError`, which names the file, when it is none."""
    source = user_path(path)
    problem = load_problem(source)
    with np.load(source, allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    try:
        distance = float(arrays["distance"])
        known = KnownProblem(
            name=str(arrays["name"]),
            family=str(arrays["family"]),
            problem=problem,
            exact=_answer(arrays, "") if bool(arrays["feasible"]) else None,
            rule=_answer(arrays, "_rule") if bool(arrays["ambiguous"]) else None,
            reason=str(arrays["reason"]),
            distance=None if np.isnan(distance) else distance,
            seed=int(arrays["seed"]),
            made=str(arrays["made"]),
            proof=str(arrays["proof"]),
            set_version=str(arrays["set_version"]),
        )
    except KeyError as error:
        raise FileError(
            f"{source}: a problem without the array {error.args[0]!r}; not a file of the problem set."
        ) from None
    return known


def _answer(arrays: dict[str, Any], suffix: str) -> KnownAnswer:
    x, residuals = arrays["x" + suffix], arrays["residuals" + suffix]
    x.flags.writeable = residuals.flags.writeable = False
    return KnownAnswer(x, residuals, tuple(int(rank) for rank in arrays["ranks" + suffix]))
