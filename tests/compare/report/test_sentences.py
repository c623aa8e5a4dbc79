"""Sentences from templates: filled, spelled, and refused when a name or a figure is wrong."""

from __future__ import annotations

import ast
import pathlib
import re

import pytest

import hqp_rp.compare
from hqp_rp.compare.report.sentences import Sentences, _macros

COMPARE = pathlib.Path(hqp_rp.compare.__file__).parent
TEMPLATE = """\
{# comments say why #}
{% macro stays(found, distance) %}
Accuracy: {{ found | listing }} {{ found | verb("stays", "stay") }}
within {{ distance | number }} of {{ "optimum" }}{% if found | length > 2 %}, all of them{% endif %}.
{% endmacro %}
{% macro lost(steps, part) %}Lost on {{ steps | counted("step") }}, {{ part | share }} <of all>.{% endmacro %}
{% macro _named(found) %}
{% for label, value in found %}{{ label }} ({{ value | number }}){{ loop | between }}{% endfor %}
{% endmacro %}
{% macro worst(found) %}
Worst: {{ _named(found) }};
{% for label, value in found %}
{{ value | number }} is {{ label }}
{{- loop | between("; ") }}
{%- endfor %}.
{% endmacro %}
"""


@pytest.fixture
def say(tmp_path: pathlib.Path) -> Sentences:
    (tmp_path / "sentences.j2").write_text(TEMPLATE)
    return Sentences(str(tmp_path / "module.py"))


def test_a_sentence_is_one_line_with_figures_as_reports_spell_them(say: Sentences) -> None:
    assert say("stays", found=["a"], distance=1.234e-7) == "Accuracy: a stays within 1.2e-07 of optimum."
    assert (
        say("stays", found=["a", "b", "c"], distance=0.5)
        == "Accuracy: a, b and c stay within 0.5 of optimum, all of them."
    )
    assert say("lost", steps=1, part=0.25) == "Lost on 1 step, 25.0 % <of all>."


def test_names_with_figures_are_listed_as_names_are(say: Sentences) -> None:
    found = [("a", 1.0), ("b", 0.125), ("c", 1e-9)]
    assert [say("worst", found=found[:count]) for count in (1, 2, 3)] == [
        "Worst: a (1); 1 is a.",
        "Worst: a (1) and b (0.12); 1 is a; 0.12 is b.",
        "Worst: a (1), b (0.12) and c (1e-09); 1 is a; 0.12 is b; 1e-09 is c.",
    ]
    assert say.names() == {"stays", "lost", "worst"}


def test_an_unknown_sentence_is_refused(say: Sentences) -> None:
    with pytest.raises(KeyError, match=r"has no 'gone'; it has \['lost', 'stays', 'worst'\]"):
        say("gone")


def test_a_missing_figure_is_refused(say: Sentences) -> None:
    with pytest.raises(TypeError, match="'lost' also takes"):
        say("lost", steps=1)


def test_a_figure_too_many_is_refused(say: Sentences) -> None:
    with pytest.raises(TypeError, match="takes no keyword argument"):
        say("lost", steps=1, part=0.5, more=2)


def test_code_and_template_name_the_same_sentences() -> None:
    """What the code beside a template asks for is there, and nothing is there that nobody asks for."""
    for template in sorted(COMPARE.rglob("sentences.j2")):
        sources = "".join(path.read_text() for path in sorted(template.parent.glob("*.py")))
        asked = set(re.findall(r"\bsay\(\s*\"(\w+)\"", sources))
        there = {name for name in Sentences(str(template)).names() if not name.startswith("_")}
        assert asked == there, (
            f"{template.parent.name}: unasked {sorted(there - asked)}, unwritten {sorted(asked - there)}"
        )


def asked_for(module: pathlib.Path) -> list[tuple[str, frozenset[str | None]]]:
    """(sentence, names of its figures) of every `say("sentence", figure=...)` of a module; None stands for **figures."""
    calls = [node for node in ast.walk(ast.parse(module.read_text())) if isinstance(node, ast.Call)]
    said = [call for call in calls if isinstance(call.func, ast.Name) and call.func.id == "say"]
    return [(ast.literal_eval(call.args[0]), frozenset(item.arg for item in call.keywords)) for call in said]


FOLDERS = sorted({path.parent.relative_to(COMPARE).as_posix() for path in COMPARE.rglob("*sentences.j2")})


@pytest.mark.parametrize("folder", FOLDERS)
def test_every_sentence_is_given_the_figures_that_it_takes(folder: str) -> None:
    """Also those that are said rarely, and in no test."""
    templates = [_macros(path) for path in (COMPARE / folder).glob("*sentences.j2")]
    takes = {(name, frozenset(macro.arguments)) for macros in templates for name, macro in macros.items()}
    asked = [one for module in sorted((COMPARE / folder).glob("*.py")) for one in asked_for(module)]
    assert asked
    assert [one for one in asked if None not in one[1] and one not in takes] == []
