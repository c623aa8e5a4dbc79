"""The part of the benchmark's report that comes first: how many times faster ours are than the peers, group by group."""

from __future__ import annotations

from hqp_rp.compare.figures.chart import Bars
from hqp_rp.compare.report.report import Section, Table
from hqp_rp.compare.report.sentences import Sentences
from tests.bench.accuracy import ACCEPTED, Accuracy
from tests.bench.measure import HEADLINE, Measured, Result, Row
from tests.bench.steps import STEP_FAMILIES
from tests.bench.timing import ratio

say = Sentences(__file__)

_KINDS = ("hqp_rp, certified", "peer, certified", "not certified")

_GROUPS = (
    ("ratios_7", "7 joints", ("7_3-3", "7_1-5", "7_6-1-7", "7_3-3-7")),
    ("ratios_limits", "Hard rows", ("7_limits", "7_limits_path", *(f"humanoid_{n}" for n in ("20", "40", "60", "40_path")))),
    ("ratios_large", "Many unknowns", ("30", "100")),
    ("ratios_steps", "A whole control step", STEP_FAMILIES),
)  # fmt: skip
"""Name of the figure, title, families."""


def ratios_section(measured: Measured) -> Section:
    """A section for each group of families that was measured: its figure, then a table for each family."""
    results = {result.name: result for result in measured.results}
    groups = []
    for name, title, families in _GROUPS:
        own = [results[family] for family in families if family in results]
        if own:
            chart = _bars(name, title, own)
            tables = tuple(_ratios(result) for result in own)
            groups.append(Section(title, charts=() if chart is None else (chart,), tables=tables))
    return Section("Ratios", (say("ratios_say"),), sections=tuple(groups))


def _ratios(result: Result) -> Table:
    peers = [row for row in result.rows if row.peer]
    ours = [row for row in result.rows if not row.peer and (row.label in HEADLINE or "mink" in row.label)]
    rows = tuple(
        (own.label, *(f"{ratio(own.timing, peer.timing).value:.3g}" for peer in peers))
        for own in ours
        if own.accuracy.ok
    )
    left = [own.label for own in ours if not own.accuracy.ok]
    inaccurate = [(peer.label, *_fault(peer.accuracy)) for peer in peers if not peer.accuracy.ok]
    caption = say("left_out", ours=left, peers=inaccurate)
    return Table(result.title, ("times faster than", *(peer.label for peer in peers)), rows, caption)


def _fault(accuracy: Accuracy) -> tuple[int, int, float | None]:
    """(how many answers are missing, of how many, how far off the others are); None where these are not to blame."""
    missing = accuracy.asked - accuracy.answered
    return missing, accuracy.asked, accuracy.error if accuracy.error > ACCEPTED or not missing else None


def _bars(name: str, title: str, results: list[Result]) -> Bars | None:
    groups = []
    for result in results:
        own = fastest(result, peer=False)
        if own is None:
            continue
        rows = sorted(result.rows, key=lambda row: row.timing.median)
        bars = tuple(
            (row.label, row.timing.median / own.timing.median, int(row.peer) if row.accuracy.ok else 2) for row in rows
        )
        groups.append((say("bars_of", title=result.title, label=own.label, us=own.timing.median * 1e6), bars))
    return Bars(name, title, say("bars_show"), "times slower (log)", tuple(groups), _KINDS) if groups else None


def fastest(result: Result, *, peer: bool) -> Row | None:
    """The fastest one that was certified on every instance: ours, or a peer."""
    rows = [row for row in result.rows if row.peer == peer and row.accuracy.ok]
    return min(rows, key=lambda row: row.timing.median, default=None)
