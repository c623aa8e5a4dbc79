"""The subcommand `hqp-rp claims`."""

from __future__ import annotations

import pathlib

from hqp_rp.core.errors import SettingError
from hqp_rp.core.extras import require_report
from hqp_rp.core.paths import user_path


def claims(
    output: pathlib.Path = pathlib.Path("report"),
    quick: bool = False,
    overwrite: bool = False,
    workers: int | None = None,
    films: bool = True,
) -> int:
    """Run the paper's force experiments with every kind of solver and write the verdict on each of its claims.

    Args:
        output: the folder to write: report.html, report.md, figures, films, and a row for each run as Parquet.
        quick: the short study of some three minutes; what it does not run it does not rule on.
        overwrite: replace the report of another run in that folder.
        workers: processes; one for each core when not given.
        films: render short films too, where a GL back end is there; the short study has none.
    """
    require_report("hqp-rp claims")
    from hqp_rp.compare.claims.report import study_claims

    if workers is not None and workers < 1:
        raise SettingError(f"workers is {workers!r}; it must be an integer of at least 1.")
    output = user_path(output)
    for sentence in study_claims(output, quick=quick, overwrite=overwrite, workers=workers, films=films, progress=True):
        print(sentence)
    print(f"The report: {output / 'report.md'}")
    return 0
