"""The pages as a whole: every one is reached from README.md, every link resolves, every public name has its page."""

from __future__ import annotations

import ast
import importlib
import re
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import matplotlib.image
import pytest

import hqp_rp
import hqp_rp.control
import hqp_rp.robot

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
EVERY = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *PAGES]
FENCED = re.compile(r"^(```+)[^\n]*\n.*?^\1[ \t]*$", re.MULTILINE | re.DOTALL)
CODE = re.compile(r"`[^`\n]*`")
LINK = re.compile(r"!?\[(?:[^\[\]]|\[[^\]]*\])*\]\(([^()\s]+)(?:\s+\"[^\"]*\")?\)")
HEADING = re.compile(r"^#+ +(.+?) *$", re.MULTILINE)


def links_of(text: str) -> list[str]:
    """The targets of a page's links and pictures, those in code left out."""
    return LINK.findall(CODE.sub("`code`", FENCED.sub("", text)))


def anchors_of(text: str) -> set[str]:
    """The anchors that GitHub and MyST make of the headings."""
    titles = [re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", title) for title in HEADING.findall(FENCED.sub("", text))]
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def relative_links(page: Path) -> Iterator[tuple[str, Path, str]]:
    """(as written, file or folder, anchor) of the links that stay in the repository."""
    for link in links_of(page.read_text(encoding="utf-8")):
        if not re.match(r"[a-z]+:", link):
            place, _, anchor = link.partition("#")
            yield link, (page.parent / place).resolve() if place else page, anchor


@pytest.mark.parametrize("page", EVERY, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_relative_link_resolves(page: Path) -> None:
    for link, place, anchor in relative_links(page):
        assert place.exists(), f"{link} leads nowhere"
        if anchor and place.suffix == ".md":
            assert anchor in anchors_of(place.read_text(encoding="utf-8")), f"{link}: no such heading"


def test_every_page_is_reached_from_the_readme() -> None:
    reached, ahead = set(), [ROOT / "README.md"]
    while ahead:
        page = ahead.pop()
        if page in reached:
            continue
        reached.add(page)
        for _, place, _ in relative_links(page):
            # A link to a folder shows its README.md.
            found = place / "README.md" if place.is_dir() else place
            if found.suffix == ".md" and found.exists():
                ahead.append(found)
    lost = [page.relative_to(ROOT).as_posix() for page in PAGES if page not in reached]
    assert not lost, f"no way leads from README.md to {lost}; add a line to docs/index.md or docs/reports/README.md"
    assert len(PAGES) > 40


def test_links_in_code_are_no_links() -> None:
    text = "[a](b.md) `[c](d.md)`\n\n```python\nx = y[0](z)\n```\n![p](q.png) [w `x`](e.md#f)"
    assert links_of(text) == ["b.md", "q.png", "e.md#f"]


def test_anchors_are_those_of_the_headings() -> None:
    assert anchors_of("# One `two`, three\n\n```\n# none\n```\n## (4) x") == {"one-two-three", "4-x"}


# --- the reference ---------------------------------------------------------------------------------------------------


@pytest.fixture
def extension(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(DOCS / "_ext"))
    for name in ("subjects", "docstrings"):
        monkeypatch.delitem(sys.modules, name, raising=False)


@pytest.mark.usefixtures("extension")
def test_every_public_name_has_its_page() -> None:
    exported = importlib.import_module("subjects").exported()
    shown = {path.rpartition(".")[2] for path in exported}
    for package in (hqp_rp, hqp_rp.control, hqp_rp.robot):
        assert not set(package.__all__) - shown - {"problems"}
    for name, kind in hqp_rp.all_solvers().items():
        assert kind.__name__ in shown, name
    assert exported["hqp_rp.PositionTask"] == "tasks"
    assert exported["hqp_rp.solvers.null_space.NullSpace"] == "solvers"
    pages = {page.stem for page in (DOCS / "reference").glob("*.md")} - {"index"}
    assert set(exported.values()) == pages
    for page in pages:
        assert f"```{{public-names}} {page}\n" in (DOCS / "reference" / f"{page}.md").read_text(encoding="utf-8")


@pytest.mark.usefixtures("extension")
def test_a_name_of_an_unknown_module_is_an_error() -> None:
    stray = type("Stray", (), {"__module__": "hqp_rp.nowhere"})
    with pytest.raises(LookupError, match="Stray of nowhere belongs to no subject"):
        importlib.import_module("subjects").subject_of("Stray", stray)


@pytest.mark.usefixtures("extension")
@pytest.mark.parametrize(
    ("plain", "marked"),
    [
        ("|x| * A_ and `J v`", r"\|x\| \* A\_ and ``J v``"),
        ("see `Stack` or `Other`s", "see :py:obj:`Stack <hqp_rp.Stack>` or ``Other``\\ s"),
        ("``kept``", "``kept``"),
    ],
)
def test_docstrings_are_text_with_code(plain: str, marked: str) -> None:
    as_rst = importlib.import_module("docstrings").as_rst
    assert as_rst([plain], {"Stack": "hqp_rp.Stack"}) == [marked]


@pytest.mark.usefixtures("extension")
def test_formulas_of_a_docstring_are_left_alone() -> None:
    as_rst = importlib.import_module("docstrings").as_rst
    lines = ["Minimizes", "", "    |A x| * 2", "", "with `A`.", "", "Args:", "    a: |b|"]
    assert as_rst(lines, {}) == [
        *("Minimizes", "", "::", "", "    |A x| * 2", "", "with ``A``.", "", "Args:", r"    a: \|b\|")
    ]


@pytest.mark.usefixtures("extension")
def test_a_list_of_names_under_a_sentence_is_a_list() -> None:
    as_rst = importlib.import_module("docstrings").as_rst
    lines = ["It declares:", "    name: one", "        more", "    a, b: two", "", "Args:", "    x: y"]
    assert as_rst(lines, {}) == ["It declares:", "", "- name: one", "  more", "- a, b: two", "", "Args:", "    x: y"]


# --- pictures --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["arm_with_limits", "through_a_singularity", "force_on_a_wall", "humanoid"])
def test_a_tutorial_picture_is_drawn_from_its_page(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(DOCS / "figures"))
    tutorials = importlib.import_module("tutorials")
    monkeypatch.setattr(tutorials, "OUT", tmp_path)
    {picture.__name__: picture for picture in tutorials.PICTURES}[name]()
    drawn, kept = (matplotlib.image.imread(folder / f"{name}.png") for folder in (tmp_path, DOCS / "figures"))
    # Fonts and rounding noise differ between machines: the same size, and the same picture on the whole.
    assert drawn.shape == kept.shape
    assert abs(float(drawn.mean()) - float(kept.mean())) < 0.02
    assert f"../figures/{name}.png" in (DOCS / "tutorials" / f"{name}.md").read_text(encoding="utf-8")


# --- code that is not Python -----------------------------------------------------------------------------------------


def test_cpp_of_the_pages_stands_in_the_example_that_make_core_runs() -> None:
    example = (ROOT / "hqp_rp" / "core" / "native" / "examples" / "control_loop.cpp").read_text(encoding="utf-8")
    known = {line.strip() for line in example.splitlines()}
    blocks = re.findall(
        r"^```cpp\n(.*?)^```", (DOCS / "tutorials" / "khz_loop.md").read_text(encoding="utf-8"), re.M | re.S
    )
    lines = [line.strip().removeprefix("hqp::Outcome ") for block in blocks for line in block.splitlines()]
    assert len(lines) > 10
    assert not set(lines) - known - {line.removeprefix("hqp::Outcome ") for line in known}


def test_a_reference_page_says_that_it_is_a_frame() -> None:
    for page in sorted((DOCS / "reference").glob("*.md")):
        text = page.read_text(encoding="utf-8")
        if "```{public-names}" in text:
            assert "\n% Seen as markdown, this page is an empty frame: `make docs` fills it" in text, page.name


def test_no_address_of_the_project_is_made_up() -> None:
    """There is none yet: docs/contributing.md says what is to be filled in when there is one."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert "urls" not in project
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert not re.search(r"^\s*(url|repository\S*):", citation, re.MULTILINE)
    for page in (ROOT / "README.md", ROOT / "CONTRIBUTING.md"):
        outside = [link for link in links_of(page.read_text(encoding="utf-8")) if re.match(r"[a-z]+:", link)]
        assert outside == [], f"{page.name} links to {outside}"


def test_docstrings_name_pages_by_their_title() -> None:
    """Whoever has the wheel alone has no folder docs."""
    for folder in ("hqp_rp", "solvers", "scenarios"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            if "compare" in path.parts or path.name == "make.py":
                continue  # these say how what stands in the repository is remade
            tree = ast.parse(path.read_text(encoding="utf-8"))
            for node in ast.walk(tree):
                if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
                    told = ast.get_docstring(node) or ""
                    assert not re.search(r"docs/\w+\.md", told), f"{path}: {told.splitlines()[0]}"
