"""What names of geoms, bodies and groups mean, and which of their pairs are measured: the same for every library."""

from __future__ import annotations

import collections
import dataclasses
import fnmatch
import itertools
from collections.abc import Iterable, Mapping, Sequence

from hqp_rp.core.errors import RobotError, unknown_name
from hqp_rp.robot.distance import Side

_WORLD = 0


@dataclasses.dataclass(frozen=True)
class Geoms:
    """The geoms of a model, numbered from 0.

    Attributes:
        shown: what each geom is called in reports and errors.
        names: name -> geom; a geom may have none, or several.
        bodies: name -> the geoms that the body stands for: those that collide, or all of them where none does.
        standing: whether a geom is among those that its body stands for.
        rigid: the rigid body that each geom is fixed on; 0 is the world, everything fixed to it included.
        parent: the rigid body that this one hangs on by its joint; None where neighbours are not left out.
        excluded: pairs (smaller, larger) of geoms that the model excludes from collision.
        planes: the geoms that are unbounded planes.
        refused: geom -> why its library measures no distance from it.
    """

    shown: Sequence[str]
    names: Mapping[str, int]
    bodies: Mapping[str, tuple[int, ...]]
    standing: Sequence[bool]
    rigid: Sequence[int]
    parent: Sequence[int | None]
    excluded: frozenset[tuple[int, int]] = frozenset()
    planes: frozenset[int] = frozenset()
    refused: Mapping[int, str] = dataclasses.field(default_factory=dict)


def standing_geoms(body: Sequence[int], collides: Sequence[bool]) -> list[bool]:
    """Whether each geom collides, or is on a body none of whose geoms does."""
    colliding = {b for b, does in zip(body, collides, strict=True) if does}
    return [does or b not in colliding for b, does in zip(body, collides, strict=True)]


def pairs_of(geoms: Geoms, pairs: Iterable[tuple[Side, Side]]) -> tuple[tuple[int, int], ...]:
    """The pairs of geoms that `pairs` stand for, each once, in the order given.

    A side is the name of a geom, or of a body, which stands for its geoms; a pattern such as "left_*" (wildcards *, ?, [...]),
    which stands for the geoms and bodies of such names; or a sequence of these. "geom:NAME" and "body:NAME" say which of the
    two is meant. Every geom of one side is measured against every geom of the other, but for what MuJoCo's own collision
    filter leaves out: geoms on one rigid body, geoms of a body and of the one that its joint hangs on (unless that is fixed to
    the world), and pairs that the model excludes. A pair ("a", "b") of two names of geoms is measured in any case.

    Raises:
        RobotError: an unknown or ambiguous name, a pattern that nothing matches, a body without geoms; two geoms named one by
            one that are on one rigid body; geoms whose distance is not computed; nothing left.
    """
    pairs = list(pairs)
    found: dict[tuple[int, int], None] = {}
    left_out: collections.Counter[str] = collections.Counter()
    for a, b in pairs:
        one_by_one = _is_geom(geoms, a) and _is_geom(geoms, b)
        for first, second in itertools.product(_side(geoms, a), _side(geoms, b)):
            reason = "" if one_by_one else _left_out(geoms, first, second)
            if reason:
                left_out[reason] += 1
            elif (second, first) not in found:
                _require_distance(geoms, first, second)
                found[first, second] = None
    if pairs and not found:
        reasons = ", ".join(f"{count} {reason}" for reason, count in left_out.items())
        raise RobotError(
            f"Distances: no pair of geoms is left of {_shown_pairs(pairs)} ({reasons}); name other bodies, or two geoms one by "
            "one, as ('a', 'b'), to measure what the model would leave out."
        )
    return tuple(found)


def _left_out(geoms: Geoms, a: int, b: int) -> str:
    """Why the pair is left out where no side names it, or nothing."""
    first, second = geoms.rigid[a], geoms.rigid[b]
    if first == second:
        return "on one rigid body"
    if _WORLD not in (first, second) and (geoms.parent[a] == second or geoms.parent[b] == first):
        return "on a body and its parent"
    return "excluded by the model" if (min(a, b), max(a, b)) in geoms.excluded else ""


def _require_distance(geoms: Geoms, a: int, b: int) -> None:
    shown = f"Distances: the pair {geoms.shown[a]!r}, {geoms.shown[b]!r}"
    planes = a in geoms.planes and b in geoms.planes
    if planes or a in geoms.refused or b in geoms.refused:
        what = "two planes" if planes else geoms.refused.get(a) or geoms.refused[b]
        raise RobotError(
            f"{shown} has {what}, whose distance is not computed; use a box or a mesh with volume instead."
        )
    if geoms.rigid[a] == geoms.rigid[b]:
        raise RobotError(f"{shown} is fixed on one rigid body, so that its distance never changes; leave it out.")


def _is_geom(geoms: Geoms, side: Side) -> bool:
    """Whether the side is the name of a single geom, not of a group."""
    return isinstance(side, str) and (side in geoms.names or side.removeprefix("geom:") in geoms.names)


def _side(geoms: Geoms, side: Side) -> list[int]:
    names = [side] if isinstance(side, str) else list(side)
    return list(dict.fromkeys(geom for name in names for geom in _named(geoms, name)))


def _named(geoms: Geoms, name: str) -> Sequence[int]:
    """The geoms that a name or a pattern stands for."""
    kind, _, bare = str(name).partition(":")
    as_geom = geoms.names.get(name, geoms.names.get(bare) if kind == "geom" else None)
    body = geoms.bodies.get(name, geoms.bodies.get(bare) if kind == "body" else None)
    if as_geom is None and body is None:
        if any(sign in name for sign in "*?["):
            return _matching(geoms, name)
        valid = (*geoms.names, *(f"body:{other}" if other in geoms.names else other for other in geoms.bodies))
        raise RobotError(f"Distances: {unknown_name('geom or body', name, valid)}")
    if body is None:
        return [] if as_geom is None else [as_geom]
    if as_geom is not None and (as_geom,) != body:
        raise RobotError(
            f"Distances: {name!r} is both a geom and a body with other geoms: write 'geom:{name}' or 'body:{name}'."
        )
    if not body:
        raise RobotError(f"Distances: the body {name!r} has no geom to measure from; name another body or a geom.")
    return body


def _matching(geoms: Geoms, pattern: str) -> Sequence[int]:
    """Of the geoms and bodies that match, the geoms that bodies stand for."""
    kind, colon, bare = pattern.partition(":")
    kind, bare = (kind, bare) if colon and kind in ("geom", "body") else ("", pattern)
    found: dict[int, None] = {}
    if kind != "body":
        found |= {i: None for name, i in geoms.names.items() if geoms.standing[i] and fnmatch.fnmatchcase(name, bare)}
    if kind != "geom":
        own = (own for name, own in geoms.bodies.items() if fnmatch.fnmatchcase(name, bare))
        found |= dict.fromkeys(itertools.chain.from_iterable(own))
    if not found:
        bodies = ", ".join(name for name, own in geoms.bodies.items() if own)
        raise RobotError(
            f"Distances: no geom, and no body that has one, matches {pattern!r}; the bodies are {bodies or 'none'}."
        )
    return list(found)


def _shown_pairs(pairs: Sequence[tuple[Side, Side]]) -> str:
    shown = ", ".join(repr(tuple(pair)) for pair in pairs[:3])
    return f"[{shown}{', ...' if len(pairs) > 3 else ''}]"
