"""The library's docstrings, plain text with code in single backticks, as reStructuredText."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

_CODE = re.compile(r"(``[^`]+``|`[^`\n]+`)")
_ITEM = re.compile(r" +[a-z_]\w*(, \w+)*: ")
_SECTION = re.compile(r"^(Args|Settings|Attributes|Raises|Returns|Yields|Note|Example|Examples):$")


def as_rst(lines: list[str], short: dict[str, str]) -> list[str]:
    """The lines of a docstring as reStructuredText: code becomes literals or links, and nothing else is markup."""
    return list(_blocks(_bulleted(lines), lambda line: _inline(line, short)))


def has_sections(lines: list[str]) -> bool:
    """Whether one of them opens a section such as "Args:"."""
    return any(_SECTION.match(line) for line in lines)


def _bulleted(lines: list[str]) -> list[str]:
    """Lines such as "name: what it is", indented under a sentence that ends in a colon, as a list."""
    found: list[str] = []
    depth = 0
    for i, line in enumerate(lines):
        here = len(line) - len(line.lstrip())
        head = i and lines[i - 1].endswith(":") and not lines[i - 1].endswith("::") and lines[i - 1][:1].strip()
        if head and here and _ITEM.match(line) and not _SECTION.match(lines[i - 1]):
            depth = here
            found.append("")
        elif not line.strip() or here < depth:
            depth = 0
        if depth:
            found.append(f"- {line.strip()}" if here == depth else f"  {line.strip()}")
        else:
            found.append(line)
    return found


def _blocks(lines: list[str], inline: Callable[[str], str]) -> Iterator[str]:
    literal: int | None = None
    section = False
    before = ""
    for line in lines:
        depth = len(line) - len(line.lstrip())
        if literal is not None and (not line.strip() or depth > literal):
            yield line
            continue
        literal = None
        if line.strip() and depth == 0:
            section = bool(_SECTION.match(line))
        if line.rstrip().endswith("::"):
            literal = depth
            yield inline(line)
            continue
        if not section and line.strip() and depth > 0 and not before.strip():
            # A formula or a drawing on lines of its own.
            yield "::"
            yield ""
            yield line
            literal = depth - 1
            continue
        before = line
        yield inline(line)


def _inline(line: str, short: dict[str, str]) -> str:
    def code(text: str) -> str:
        inner = text.strip("`")
        name = inner.removeprefix("hqp_rp.").removesuffix("()")
        if name in short:
            return f":py:obj:`{inner} <{short[name]}>`"
        return f"``{inner}``"

    parts = _CODE.split(line)
    for i, part in enumerate(parts):
        if i % 2:
            parts[i] = code(part)
            if i + 1 < len(parts) and parts[i + 1][:1].isalnum():
                parts[i] += "\\ "
        else:
            plain = re.sub(r"([\\*|])", r"\\\1", part)
            parts[i] = re.sub(r"(?<=\w)_(?!\w)", r"\\_", plain)
    return "".join(parts)
