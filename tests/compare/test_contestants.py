"""The default line-up, and solvers with settings as one word."""

from __future__ import annotations

import dataclasses
from typing import ClassVar

import pytest

import hqp_rp.core.solver as solver_module
from hqp_rp import (
    ConstantDamping,
    HqpError,
    ManipulabilityDamping,
    NoDamping,
    NumericalFiltering,
    SettingError,
    Truncation,
    UnknownNameError,
    VariableDamping,
    all_solvers,
    get_solver,
)
from hqp_rp.compare.contestants import Contestant, choose_contestants, default_contestants, variants
from hqp_rp.compare.settings_text import parse_contestant
from hqp_rp.core.variant import DAMPED, EXACT, GROUPS, SOFT, LineUp, Variant
from tests.compare.small import Fixed


def test_every_solver_takes_part_once_for_each_label() -> None:
    found = default_contestants()
    assert {contestant.name for contestant in found} == set(all_solvers())
    labels = [contestant.label for contestant in found]
    assert len(set(labels)) == len(labels)
    assert len({repr(contestant.solver) for contestant in found}) == len(found)
    assert [GROUPS.index(contestant.group) for contestant in found] == sorted(
        GROUPS.index(contestant.group) for contestant in found
    )


def test_labels_can_stand_in_a_sentence() -> None:
    assert all("," not in contestant.label for contestant in default_contestants())


@pytest.mark.parametrize(
    ("text", "settings"),
    [
        ("reverse_priority", {}),
        ("reverse_priority:", {}),
        ("reverse_priority:damping=constant(0.2)", {"damping": ConstantDamping(0.2)}),
        (
            "reverse_priority: damping = constant(factor=0.2) , form=projector",
            {"damping": ConstantDamping(0.2), "form": "projector"},
        ),
        ("null_space:damping=variable(delta=0.1, maximum=0.2)", {"damping": VariableDamping(0.1, 0.2)}),
        (
            "null_space:damping=variable(0.1,0.2),rank_tolerance=1e-10",
            {"damping": VariableDamping(0.1, 0.2), "rank_tolerance": 1e-10},
        ),
        ("null_space:damping=truncation(0.01)", {"damping": Truncation(0.01)}),
        ("damped_least_squares:damping=none", {"damping": NoDamping()}),
        ("qp_cascade:backend=osqp,polish=false,max_iterations=50", {"backend": "osqp", "polish": False, "max_iterations": 50}),
    ],
)  # fmt: skip
def test_settings_are_read(text: str, settings: dict[str, object]) -> None:
    name = text.partition(":")[0]
    assert parse_contestant(text) == get_solver(name, **settings)


def test_a_policy_is_read_as_it_is_printed() -> None:
    for damping in (
        NoDamping(),
        ConstantDamping(0.25),
        VariableDamping(0.5, 0.125),
        Truncation(0.0625),
        ManipulabilityDamping(0.5, 0.25),
        NumericalFiltering(0.5, 0.25),
    ):
        assert parse_contestant(f"null_space:damping={damping!r}") == get_solver("null_space", damping=damping)


def test_a_list_is_read() -> None:
    solver = parse_contestant("damped_least_squares:damping=constant(1),weight=[1.0, 2.0, 4.0]")
    assert repr(solver) == repr(get_solver("damped_least_squares", damping=ConstantDamping(1), weight=[1.0, 2.0, 4.0]))


@pytest.mark.parametrize(
    ("text", "kind", "words"),
    [
        ("null_spce", UnknownNameError, "Did you mean 'null_space'?"),
        ("null_spce:variant=basis", UnknownNameError, "Did you mean 'null_space'?"),
        ("null_space:dampin=none", SettingError, "Did you mean 'damping'?"),
        ("null_space:damping", SettingError, "write null_space:damping=VALUE"),
        ("null_space:damping=", SettingError, "has no value"),
        ("null_space:damping=constan(1)", UnknownNameError, "Did you mean 'constant'?"),
        ("null_space:damping=constant(1", SettingError, "brackets do not match"),
        ("null_space:damping=constant)", SettingError, "brackets do not match"),
        ("null_space:damping=constant()", SettingError, "constant needs factor"),
        ("null_space:damping=constant(x)", SettingError, "factor must be a number, not 'x'"),
        ("null_space:damping=constant(1,2)", SettingError, "takes 1 number(s)"),
        ("null_space:damping=constant(-1)", SettingError, ">= 0"),
        ("null_space:damping=constant(size=1)", SettingError, "Valid: factor"),
        ("null_space:rank_tolerance=big", SettingError, "must be a number"),
        ("null_space:rank_tolerance=[1]", SettingError, "must be a number"),
        ("null_space:rank_tolerance=2", SettingError, "[0, 1)"),
        ("null_space:variant=base", UnknownNameError, "basis"),
        ("null_space:variant=basis,variant=projector", SettingError, "given twice"),
        ("qp_cascade:polish=perhaps", SettingError, "true or false"),
        ("qp_cascade:max_iterations=1.5", SettingError, "must be an integer"),
        ("qp_cascade:backend=none_such", SettingError, "none_such"),
    ],
)  # fmt: skip
def test_wrong_settings_are_named(text: str, kind: type[HqpError], words: str) -> None:
    with pytest.raises(kind) as caught:
        choose_contestants([text])
    assert words in str(caught.value)


def test_a_name_picks_all_variants_and_settings_pick_one() -> None:
    assert choose_contestants(["null_space"]) == variants("null_space")
    (one,) = choose_contestants(["null_space:rank_tolerance=1e-9"])
    assert one.label == "null_space:rank_tolerance=1e-9"
    assert one.solver == get_solver("null_space", rank_tolerance=1e-9)


def test_settings_of_a_known_variant_are_that_variant() -> None:
    (one,) = choose_contestants(["null_space:variant=projector"])
    assert one in variants("null_space")
    assert choose_contestants([get_solver("null_space"), "null_space:variant=basis"]) == (variants("null_space")[0],)


def test_groups_follow_what_a_solver_declares() -> None:
    plain, damped, soft = choose_contestants(
        ["null_space:rank_tolerance=1e-9", "null_space:damping=constant(3)", "pseudo_inverse:rank_tolerance=1e-9"]
    )
    assert [plain.group, damped.group, soft.group] == [EXACT, DAMPED, SOFT]


def test_one_label_for_two_solvers_is_an_error() -> None:
    with pytest.raises(SettingError, match="a label of its own"):
        choose_contestants([Contestant("a", Fixed(), GROUPS[0]), Contestant("a", Fixed(x=None), GROUPS[0])])


@pytest.mark.parametrize("wrong", [[], "null_space", [3], [Contestant("a", Fixed(), "best")]])
def test_no_line_up(wrong: list[str]) -> None:
    with pytest.raises(HqpError):
        choose_contestants(wrong)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Declared(Fixed):
    """Declares two variants, and is the same as others where there are no limits."""

    name: ClassVar[str] = "declared"
    variants: ClassVar[LineUp] = LineUp(
        (Variant("second", {"x": (1.0,)}, SOFT, "b"), Variant("first", {}, EXACT, "a")), place=1, only_with="limits"
    )


class Heir(Declared):
    """Declares nothing itself."""

    name: ClassVar[str] = "heir"


def test_a_solver_declares_its_variants_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(solver_module, "_registry", lambda: {"heir": Heir, "declared": Declared, "fixed": Fixed})
    labels = [contestant.label for contestant in default_contestants()]
    assert set(labels) == {"first", "second", "heir", "fixed"}
    assert labels.index("first") == 0  # by group, then by place
    assert [contestant.label for contestant in variants("declared")] == ["second", "first"]
    (second, _) = variants("declared")
    assert (second.group, second.why, second.solver) == (SOFT, "b", Declared(x=(1.0,)))
    assert {contestant.label for contestant in default_contestants(limits=False)} == {"heir", "fixed"}
    assert len(default_contestants(torques=False, transitions=False)) == 4


def test_two_solvers_of_one_label_are_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    twin = type("Twin", (Declared,), {"name": "twin", "variants": LineUp((Variant("first", {}, EXACT, ""),))})
    monkeypatch.setattr(solver_module, "_registry", lambda: {"declared": Declared, "twin": twin})
    with pytest.raises(SettingError, match="labelled 'first'"):
        default_contestants()


def test_variants_that_are_no_line_up_are_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    wrong = type("Wrong", (Fixed,), {"name": "wrong", "variants": ("first",)})
    monkeypatch.setattr(solver_module, "_registry", lambda: {"wrong": wrong})
    with pytest.raises(SettingError, match=r"Wrong.variants is \('first',\); declare a hqp_rp.core.variant.LineUp"):
        variants("wrong")
