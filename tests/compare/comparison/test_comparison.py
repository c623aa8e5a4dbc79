"""The whole comparison on small scenarios: resuming, wrong input, and what the report holds."""

from __future__ import annotations

import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path

import polars as pl
import pytest

import hqp_rp.compare.comparison.comparison as comparison_module
import hqp_rp.compare.measure.units as run_module
from hqp_rp import FileError, HqpError, MissingExtraError, SettingError, Solver, Status, UnknownNameError
from hqp_rp.compare import Comparison, Contestant, compare
from hqp_rp.compare.measure.units import Unit
from hqp_rp.core.variant import DAMPED, EXACT
from hqp_rp.scenarios.scenario import Step
from tests.compare.small import Closing, Fixed, Moving

LINE_UP = [
    "null_space:variant=basis",
    "reverse_priority",
    Contestant("stuck", Fixed(), DAMPED),
    Contestant("refuses", Fixed(x=None, status=Status.REFUSED, message="Fixed takes no such problem."), EXACT),
]


def small(output: Path | None = None, *, seeds: int = 2, overwrite: bool = False) -> Comparison:
    return compare([Closing(), Moving()], LINE_UP, seeds=seeds, output=output, workers=1, overwrite=overwrite)


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[Comparison, Path]:
    folder = tmp_path_factory.mktemp("report") / "out"
    return small(folder), folder


def test_every_unit_is_there(written: tuple[Comparison, Path]) -> None:
    found, _ = written
    runs = found.runs.select("scenario", "contestant", "seed").unique()
    assert runs.height == 2 * 7 * 2
    answered = found.steps.filter(pl.col("contestant") != "refuses")
    assert answered.height == 2 * 6 * 2 * 4
    assert found.steps.filter(pl.col("contestant") == "refuses").height == 2 * 2


def test_the_frames_and_the_files_are_the_same(written: tuple[Comparison, Path]) -> None:
    found, folder = written
    for name in ("steps", "levels", "measured", "runs"):
        assert pl.read_parquet(folder / "results" / f"{name}.parquet").equals(getattr(found, name))


def test_figures_come_from_the_data(written: tuple[Comparison, Path]) -> None:
    found, _ = written
    case = next(case for case in found.cases if type(case.scenario) is Closing)
    outcomes = {outcome.label: outcome for outcome in case.outcomes}
    assert outcomes["null space"].parted is False
    assert outcomes["null space"].keeps(1)
    assert outcomes["stuck"].parts_at == 1.0
    assert not outcomes["stuck"].keeps(1)  # with seed 1 level 1 asks for x_1 = 2
    assert outcomes["stuck"].excess == (1.0, 1.0)
    assert outcomes["refuses"].refused == "Fixed takes no such problem."
    assert outcomes["refuses"].distance is None
    assert case.far_norm == pytest.approx(2.0 * 2.0**0.5)


def test_markdown_has_its_parts_in_order(written: tuple[Comparison, Path]) -> None:
    _, folder = written
    text = (folder / "report.md").read_text()
    headings = re.findall(r"^## (.*)$", text, flags=re.MULTILINE)
    assert headings == [
        "The answer",
        "What this cannot tell",
        "Figures",
        "What the paper on reverse priority claims",
        "What hangs on a threshold",
        "Tables",
        "Times",
        "Settings",
    ]
    assert "Does the test's own question appear?" in text
    assert "- closing: Two unknowns only." in text
    assert "Fixed takes no such problem." in text
    assert "NullSpace(damping=none, rank_tolerance=1e-12, variant='basis')" in text
    assert "exact rational arithmetic" in text
    assert "| numpy |" in text
    pictures = re.findall(r"!\[.*?\]\((.*?)\)", text)
    assert len(pictures) == 6
    for picture in pictures:
        assert (folder / picture).read_bytes().startswith(b"\x89PNG")


def test_markdown_tables_are_well_formed(written: tuple[Comparison, Path]) -> None:
    _, folder = written
    lines = (folder / "report.md").read_text().splitlines()
    widths = [line.replace("\\|", "").count("|") for line in lines]
    heads = [i for i, line in enumerate(lines) if line.startswith("| --- |")]
    assert len(heads) >= 6
    for i in heads:
        assert widths[i - 1] == widths[i] == widths[i + 1]
        assert lines[i - 2] == ""


def test_times_stand_in_their_own_section_only(written: tuple[Comparison, Path], tmp_path: Path) -> None:
    _, folder = written
    small(tmp_path / "again")

    def without_times(path: Path) -> list[str]:
        return re.sub(r"## Times.*?## Settings", "", (path / "report.md").read_text(), flags=re.DOTALL).splitlines()

    assert without_times(tmp_path / "again") == without_times(folder)


@pytest.fixture
def no_drawing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Everything but the drawing, which takes most of the time."""
    monkeypatch.setattr(comparison_module, "write_report", lambda report, folder, workers: [])


class Links(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.found: list[tuple[str, str, str]] = []
        self.scripts = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.scripts += tag == "script"
        self.found += [(tag, name, value or "") for name, value in attrs if name in ("src", "href", "srcset", "data")]
        assert tag not in ("link", "iframe", "img", "object", "embed")


def test_the_page_loads_nothing_from_outside(written: tuple[Comparison, Path]) -> None:
    _, folder = written
    page = (folder / "report.html").read_text()
    links = Links()
    links.feed(page)
    assert links.scripts >= 7  # plotly.js once, and each figure's own
    assert links.found == []
    assert "@import" not in page.partition("<script>")[0]
    assert page.count("plotly.js v") == 1
    assert page.count("Plotly.newPlot(") >= 6
    assert "Fixed takes no such problem." in page
    for sentence in written[0].answer:
        assert sentence.replace("'", "&#39;").replace("<", "&lt;") in re.sub(
            r'<span class="n">(.*?)</span>', r"\1", page
        )


@pytest.mark.usefixtures("no_drawing")
def test_a_stopped_run_goes_on_and_gives_the_same_rows(
    written: tuple[Comparison, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, _ = written
    done: list[str] = []
    honest = run_module.run_unit

    def interrupted(unit: Unit) -> pl.DataFrame:
        if len(done) == 5:
            raise KeyboardInterrupt
        done.append(unit.key)
        return honest(unit)

    monkeypatch.setattr(run_module, "run_unit", interrupted)
    with pytest.raises(KeyboardInterrupt):
        small(tmp_path)
    assert len(list((tmp_path / "parts").iterdir())) == 5
    assert not (tmp_path / "results").exists()

    def counted(unit: Unit) -> pl.DataFrame:
        done.append(unit.key)
        return honest(unit)

    monkeypatch.setattr(run_module, "run_unit", counted)
    resumed = small(tmp_path)
    assert len(done) == len(set(done)) == 28
    for name in ("steps", "levels", "measured"):
        ours, theirs = getattr(resumed, name), getattr(whole, name)
        assert ours.drop("solve_time", strict=False).equals(theirs.drop("solve_time", strict=False))

    done.clear()
    small(tmp_path)
    assert done == []


def test_worker_processes_give_the_same_rows(tmp_path: Path) -> None:
    chosen = ["near_singular_family"]
    solvers = ["null_space:variant=basis", "singularity_robust"]
    one = compare(chosen, solvers, quick=True, workers=1)
    two = compare(chosen, solvers, quick=True, workers=2)
    assert one.steps.drop("solve_time").equals(two.steps.drop("solve_time"))
    assert one.levels.equals(two.levels)


@pytest.mark.usefixtures("no_drawing")
def test_another_run_is_refused_unless_it_may_be_overwritten(tmp_path: Path) -> None:
    small(tmp_path, seeds=1)
    with pytest.raises(FileError, match="it differs in seeds"):
        small(tmp_path, seeds=2)
    assert small(tmp_path, seeds=2, overwrite=True).seeds == 2


def test_an_error_in_a_scenario_is_not_hidden(tmp_path: Path) -> None:
    class Broken(Closing):
        def steps(self, solver: Solver, seed: int) -> Iterator[Step]:
            raise RuntimeError("the arm broke")
            yield

    with pytest.raises(RuntimeError, match="the arm broke"):
        compare([Broken()], ["pseudo_inverse"], workers=1, output=tmp_path)


def test_nobody_answers() -> None:
    found = compare([Closing()], [LINE_UP[3]], seeds=1, workers=1)
    assert found.answer == ("No solver returned an answer that could be measured.",)
    assert [chart.name for chart in found.report().charts()] == ["closing-parting"]


@pytest.mark.parametrize(
    ("arguments", "kind", "words"),
    [
        ({"scenarios": ["near_singular"]}, UnknownNameError, "near_singular_family"),
        ({"scenarios": []}, SettingError, "empty list"),
        ({"scenarios": "near_singular_family"}, SettingError, "give a list"),
        ({"scenarios": [Closing(), Closing(count=3)]}, SettingError, "twice with different settings"),
        ({"solvers": ["nul_space"]}, UnknownNameError, "null_space"),
        ({"solvers": []}, SettingError, "give a list"),
        ({"seeds": 0}, SettingError, "seeds is 0"),
        ({"seeds": True}, SettingError, "seeds is True"),
        ({"seeds": 1.5}, SettingError, "seeds is 1.5"),
        ({"workers": 0}, SettingError, "workers is 0"),
    ],
)
def test_wrong_input_is_named(arguments: dict[str, object], kind: type[HqpError], words: str) -> None:
    merged: dict[str, object] = {"scenarios": [Closing()], "solvers": ["pseudo_inverse"], **arguments}
    with pytest.raises(kind) as caught:
        compare(**merged)  # type: ignore[arg-type]
    assert words in str(caught.value)


class Needy(Closing):
    name = "needy"

    def check(self) -> None:
        raise MissingExtraError("needy needs a robot; pip install robot.")


def test_a_scenario_without_its_package_is_left_out_and_named(monkeypatch: pytest.MonkeyPatch) -> None:
    registry = {"closing": Closing, "needy": Needy}
    monkeypatch.setattr(comparison_module, "all_scenarios", lambda: registry)
    monkeypatch.setattr(comparison_module, "get_scenario", lambda item: registry[item]())
    found = compare(None, ["pseudo_inverse"], quick=True, workers=1)
    assert found.left_out == ("needy was left out: needy needs a robot; pip install robot.",)
    limits = next(section for section in found.report().sections if section.title == "What this cannot tell")
    assert found.left_out[0] in limits.sentences
    named = compare(["closing", "needy"], ["pseudo_inverse"], quick=True, workers=1)
    assert named.left_out == found.left_out
    with pytest.raises(MissingExtraError):
        compare(["needy"], ["pseudo_inverse"], workers=1)
    registry.pop("closing")
    with pytest.raises(MissingExtraError, match="needy was left out"):
        compare(None, ["pseudo_inverse"], workers=1)


def test_quick_is_shorter() -> None:
    found = compare([Closing()], ["pseudo_inverse"], quick=True, workers=1)
    assert found.seeds == 1
    assert found.steps.height == 2
