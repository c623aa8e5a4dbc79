"""Work shared among threads: every item once, errors told."""

import numpy as np
import pytest

from hqp_rp.core.errors import SettingError
from hqp_rp.core.threads import in_shares


@pytest.mark.parametrize("threads", [None, 1, 2, 5])
@pytest.mark.parametrize("count", [0, 1, 3, 100])
def test_every_item_is_worked_on(count, threads):
    out = np.zeros(count)

    def work(span):
        out[span] = np.arange(count)[span] + 1.0  # the first item may be done twice

    in_shares(work, count, threads)
    np.testing.assert_array_equal(out, np.arange(count) + 1.0)


def test_an_error_in_a_thread_is_raised():
    def work(span):
        if span.stop > 5:
            raise ValueError("no")

    with pytest.raises(ValueError, match="no"):
        in_shares(work, 9, 3)


@pytest.mark.parametrize("threads", [0, -1, 1.5])
def test_misuse(threads):
    with pytest.raises(SettingError, match=r"threads is .*; it must be None or an integer of at least 1"):
        in_shares(lambda span: None, 3, threads)


def test_few_items_take_few_threads():
    for count, shares in ((0, 0), (1, 1), (19, 1), (20, 2), (1000, 3)):
        spans = []
        in_shares(spans.append, count, 3, least=10)
        assert len(spans) == shares
