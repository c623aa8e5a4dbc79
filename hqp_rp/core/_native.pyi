"""
The native core of hqp_rp: closed forms, active set, saturation, rows of tasks and batches, compiled from C++.
"""



class Problem:
    """The native half of `hqp_rp.Problem`: its arrays, and a view of them."""

    def __init__(self, matrix: object, lower: object, upper: object, offsets: object, names: object, hard_rows: int, hard: object | None, is_equality: bool) -> None:
        """
        Takes arrays as they are, hard rows on top of the levels' rows (hard_rows of them) or apart (hard, a Level). TypeError and ValueError for arrays that do not fit.
        """

    @property
    def n(self) -> int:
        """Number of unknowns."""

    @property
    def p(self) -> int:
        """Number of levels."""

    @property
    def rows(self) -> int:
        """Rows of all levels, M."""

    @property
    def hard_rows(self) -> int:
        """How many rows are hard."""

    @property
    def is_equality(self) -> bool:
        """Whether every row of every level is an equality."""

    @property
    def names(self) -> object:
        """One name for each level."""

    @property
    def given(self) -> object:
        """The matrix as it was given, with hard rows on top where `on_top`."""

    @property
    def given_lower(self) -> object: ...

    @property
    def given_upper(self) -> object: ...

    @property
    def given_offsets(self) -> object: ...

    @property
    def given_hard(self) -> object:
        """The hard rows that were given apart, or None."""

    @property
    def on_top(self) -> bool:
        """Whether hard rows stand on top of the levels' rows in `given`."""

    @property
    def kept(self) -> object:
        """What Python made of it once."""

    @kept.setter
    def kept(self, value: object | None) -> None: ...

class Solution:
    """The native half of `hqp_rp.Solution`."""

    def __init__(self, problem: object, x: object | None, status: object, iterations: int = 0, message: object = '', secondary: object | None = None) -> None: ...

    @property
    def problem(self) -> object: ...

    @problem.setter
    def problem(self, arg: object, /) -> None: ...

    @property
    def x(self) -> object: ...

    @x.setter
    def x(self, value: object | None) -> None: ...

    @property
    def status(self) -> object: ...

    @status.setter
    def status(self, arg: object, /) -> None: ...

    @property
    def iterations(self) -> int: ...

    @iterations.setter
    def iterations(self, arg: int, /) -> None: ...

    @property
    def message(self) -> object: ...

    @message.setter
    def message(self, arg: object, /) -> None: ...

    @property
    def secondary(self) -> object: ...

    @secondary.setter
    def secondary(self, value: object | None) -> None: ...

    @property
    def held(self) -> object: ...

    @held.setter
    def held(self, value: object | None) -> None: ...

    @property
    def kept(self) -> object: ...

    @kept.setter
    def kept(self, value: object | None) -> None: ...

def register_solution(solution: object, statuses: tuple) -> None:
    """
    Say which class solvers return, and the members of `Status` in their order.
    """

def instruction_set() -> str:
    """For which instruction set the kernels in use were compiled."""

def workspace_allocations() -> int:
    """
    How many blocks of memory this thread's workspace has allocated so far.
    """

class ClosedForm:
    """A closed form on equality levels, with its settings."""

    def solve(self, problem: object, secondary: object | None) -> object:
        """
        Its Solution; None for a problem with hard or two-sided rows. secondary: (n,) float64, or None.
        """

def null_space(rank_tolerance: float, kind: int, first: float, second: float) -> ClosedForm:
    """Null-space priority (9)-(11) as an orthogonal cascade."""
