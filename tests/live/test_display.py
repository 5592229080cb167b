"""What is shown runs behind the detector and never holds it up."""

import threading
import time

import numpy as np
import pytest

from tauguard.detectors.alarms.monitor import Answer
from tauguard.live import Sample
from tauguard.live.display import BackgroundDisplay


def given(k, state="free"):
    zero = np.zeros(2)
    return Sample(float(k), zero, zero, zero, 0), Answer(state, False, 0.0, "")


def test_everything_is_shown_in_order_when_there_is_time():
    seen = []
    with BackgroundDisplay(lambda sample, answer: seen.append(sample.t)) as view:
        for k in range(50):
            view.put(*given(k))
    assert seen == list(range(50))
    assert view.dropped == 0


def test_a_terminal_that_hangs_holds_up_nothing_and_what_is_dropped_is_counted():
    hangs, seen = threading.Event(), []

    def show(sample, answer):
        hangs.wait()
        seen.append(answer.state)

    with BackgroundDisplay(show, waiting=10) as view:
        began = time.monotonic()
        for k in range(1000):
            view.put(*given(k))
        view.put(*given(1000, "fault"))
        assert time.monotonic() - began < 1.0
        assert 980 <= view.dropped <= 991
        hangs.set()
    assert seen[-1] == "fault"  # a change of state is kept


def test_a_display_that_fails_is_an_error_and_not_a_screen_that_stands_still():
    def show(sample, answer):
        raise BrokenPipeError("nobody reads")

    def put(view):
        for k in range(1000):
            view.put(*given(k))
            time.sleep(0.001)

    with BackgroundDisplay(show) as view, pytest.raises(BrokenPipeError, match="nobody reads"):
        put(view)
