"""What a report says, kept apart from what it computes: named sentences in a template beside the code that fills them."""

from __future__ import annotations

import functools
import pathlib
from typing import Any

from hqp_rp.compare.report.words import counted, number, share
from hqp_rp.core.extras import require
from hqp_rp.core.words import listing


class Sentences:
    """The sentences of one template: `say("advised", found=labels)` gives the sentence of that name, filled.

    The template holds one Jinja macro for each sentence and nothing else; its arguments are figures and names, never
    ready English. Filters spell them as every report does: `number`, `share`, `counted("step")`, `listing`, and
    `verb("stays", "stay")` agrees with how many names there are. In a loop, `loop | between` stands behind each item: a
    comma, "and" before the last one, nothing behind it; `loop | between("; ")` has that mark instead. A macro whose name
    begins with _ is a part of others, and no sentence. Line breaks of the template are single spaces in the sentence. An
    unknown sentence or an argument that is missing or too many is an error.
    """

    def __init__(self, file: str, name: str = "sentences.j2") -> None:
        """The template `name` in the folder of the module `file`, pass `__file__`; read when a sentence is asked for."""
        self.path = pathlib.Path(file).parent / name

    def __call__(self, sentence: str, /, **figures: Any) -> str:
        """The sentence; `KeyError` for a name that the template lacks, `TypeError` for other arguments than it takes."""
        macros = _macros(self.path)
        if sentence not in macros:
            raise KeyError(f"{self.path.name} of {self.path.parent.name} has no {sentence!r}; it has {sorted(macros)}")
        macro = macros[sentence]
        missing = set(macro.arguments) - set(figures)
        if missing:
            raise TypeError(f"the sentence {sentence!r} also takes {sorted(missing)}")
        return " ".join(macro(**figures).split())

    def names(self) -> frozenset[str]:
        """Every sentence of the template."""
        return frozenset(_macros(self.path))


@functools.cache
def _macros(path: pathlib.Path) -> dict[str, Any]:
    require("a report's sentences", "jinja2")
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(path.parent),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "number": number, "share": share, "counted": counted, "listing": listing, "verb": _verb, "between": _between,
    }  # fmt: skip
    module = environment.get_template(path.name).make_module()
    return {name: macro for name, macro in vars(module).items() if isinstance(macro, jinja2.runtime.Macro)}


def _verb(names: Any, one: str, many: str) -> str:
    """The form of a verb for so many names, or for a count."""
    count = names if isinstance(names, int) else len(names)
    return one if count == 1 else many


def _between(loop: Any, mark: str = "") -> str:
    """What stands between this item of a loop and the next: `mark`, or without one what `listing` has there."""
    if loop.last:
        return ""
    return mark or (" and " if loop.revindex == 2 else ", ")
