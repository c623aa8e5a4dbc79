"""How notebooks show things: tables that say what the object says, in HTML that is well formed, with a user's words escaped."""

from __future__ import annotations

from html.parser import HTMLParser

import numpy as np

import hqp_rp
from hqp_rp.core.damping import ConstantDamping
from hqp_rp.core.html import table
from hqp_rp.core.solution import Solution, Status


class Read(HTMLParser):
    """The cells of the tables of a page, row by row, and all its words; fails on a tag that is not closed in its order."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.rows: list[list[str]] = []
        self.words = ""
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag: str, attrs: object) -> None:
        assert tag in {"div", "b", "table", "thead", "tbody", "tr", "th", "td"}
        self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words += data
        if self.open[-1] in ("td", "th"):
            self.rows[-1][-1] += data


def problem() -> hqp_rp.Problem:
    return hqp_rp.Problem(
        [
            hqp_rp.Level.equality([[1.0, 0.0, 0.0]], [0.5], name="first <b>"),
            hqp_rp.Level(
                [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [2.0, 1.0], [2.0, 3.0], name="second", damping=ConstantDamping(0.1)
            ),
        ],
        hqp_rp.Level(np.eye(3), [-1.0] * 3, [1.0] * 3, name="velocity"),
    )


def test_a_problem_shows_its_levels_with_their_kinds_of_rows() -> None:
    read = Read(problem()._repr_html_())
    assert read.words.startswith("Problem: 3 unknowns, 2 levels")
    assert read.rows[1:] == [
        ["hard", "velocity", "3", "0", "3", ""],
        ["1", "first <b>", "1", "1", "0", ""],
        ["2", "second", "2", "1", "1", "constant(0.1)"],
    ]
    assert "first <b>" not in problem()._repr_html_()
    weighted = hqp_rp.Problem([hqp_rp.Level.equality(np.eye(2), [1.0, 2.0])], metric=[1.0, 2.0])
    assert "2 unknowns, 1 levels, with a metric" in Read(weighted._repr_html_()).words


def test_a_solution_shows_its_status_and_what_each_level_got() -> None:
    stated = problem()
    solution = hqp_rp.solve(stated, "hierarchical_active_set")
    read = Read(solution._repr_html_())
    assert read.words.startswith(f"SOLVED: {Status.SOLVED.value}")
    for row, level in zip(read.rows[1:], solution.levels, strict=True):
        assert row[1] == level.name
        assert float(row[2]) == float(f"{level.residual:.3g}")
        assert row[3] == f"{level.rank} of {len(level.violation)}"
        assert float(row[4]) == float(f"{level.sigma_min:.3g}")
        assert row[5] == level.singularity.name
    assert "second[1] at its lower bound" in read.words
    assert "x = [0.5, " in read.words


def test_a_solution_without_an_answer_shows_why() -> None:
    refused = hqp_rp.solve(problem(), "pseudo_inverse")
    read = Read(refused._repr_html_())
    assert read.words.startswith(f"REFUSED: {Status.REFUSED.value} {refused.message}")
    assert not read.rows
    infinite = Solution(problem(), np.array([np.inf, 0.0, 0.0]), Status.NOT_FINITE)
    assert Read(infinite._repr_html_()).words == f"NOT_FINITE: {Status.NOT_FINITE.value}"


def test_a_certificate_shows_its_verdict_and_what_could_be_avoided() -> None:
    stated = hqp_rp.Problem(
        [hqp_rp.Level.equality([[1.0, 0.0]], [1.0], name="one"), hqp_rp.Level.equality(np.eye(2), [3.0, 2.0])]
    )
    for x in ([1.0, 2.0], [1.0, 1.0]):
        verdict = hqp_rp.certify(stated, x)
        read = Read(verdict._repr_html_())
        assert read.words.startswith(verdict.sentence)
        assert [row[1] for row in read.rows[1:]] == ["one", "level 2"]
        assert [float(row[3]) for row in read.rows[1:]] == [float(f"{level.excess:.3g}") for level in verdict.levels]


def test_a_stack_shows_what_its_levels_hold() -> None:
    stack = hqp_rp.Stack(
        [[hqp_rp.PositionTask("tool", [0.0, 0.0, 0.0]), hqp_rp.PostureTask(np.zeros(2), name="<i>")]],
        [hqp_rp.JointLimit()],
        damping=ConstantDamping(0.1),
        metric="inertia",
    )
    read = Read(stack._repr_html_())
    assert read.words.startswith("Stack, metric 'inertia'")
    assert read.rows[1:] == [
        ["hard", "limits", "JointLimit joint limits", ""],
        ["1", "tool position + <i>", "PositionTask tool position, PostureTask <i>", "constant(0.1)"],
    ]


def test_a_long_table_is_cut_and_says_so() -> None:
    read = Read(table("many", ("i", "x"), [(i, 1.0 / 3.0) for i in range(40)], "below"))
    assert len(read.rows) == 1 + 30
    assert read.rows[1] == ["0", "0.333"]
    assert "and 10 more" in read.words
    long = hqp_rp.solve(hqp_rp.Problem([hqp_rp.Level.equality(np.eye(20), np.ones(20))]), "null_space")
    assert "... 20 numbers]" in Read(long._repr_html_()).words
