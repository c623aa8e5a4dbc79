"""Three levels, method by method."""

from __future__ import annotations

import numpy as np

from hqp_rp.compare.claims.experiments import CONFLICT, WIPE
from hqp_rp.compare.claims.judges.study import Study, force_error
from hqp_rp.compare.claims.methods import DLS, FIXED
from hqp_rp.compare.figures.chart import Dots
from hqp_rp.compare.report.sentences import Sentences

say = Sentences(__file__)


def three_levels(study: Study) -> Dots:
    """Force and second level of three, at regular postures, by method."""
    methods = (*(label for label in FIXED if study.pick(WIPE, label).height), DLS)
    values, columns = [], []
    for experiment in (WIPE, CONFLICT):
        for what, scale, words in (("rms", 1.0, "RMS error of F_x (N)"), ("position", 1e3, "second level (mm)")):
            own = {}
            for label in methods:
                rows = study.pick(experiment, label)
                figures = force_error(rows) if what == "rms" else rows["position"].to_numpy()
                own[label] = np.maximum(scale * figures, 1e-2)
            values.append(own)
            columns.append(f"{experiment}: {words}")
    return Dots(
        "three-levels",
        say("three_levels_title"),
        say("three_levels_caption"),
        "N, or mm",
        tuple(columns),
        (("", methods),),
        tuple(values),
        absent="ended early",
        log_x=True,
    )
