"""Samples from lines of text: what is read, what is a fault, what is refused."""

import os
from types import SimpleNamespace

import numpy as np
import pytest

from tauguard.live import LineStream, StreamClosed
from tests.live.peer import RATE, piped


def test_a_line_that_is_no_sample_is_a_fault_and_ends_nothing():
    text, into = piped()
    os.write(into, b"1,0,0,0\n1.008,0,oops\n1.016,0,0,0\n")
    os.close(into)
    with LineStream(text, ("a",), RATE) as stream:
        samples = [stream.read(1.0) for _ in range(3)]
    assert [sample.t for sample in samples] == pytest.approx([1, np.nan, 1.016], nan_ok=True)
    assert np.isnan(samples[1].q).all()
    (said,) = stream.events
    assert said.startswith("line 2: expected 4 numbers")
    text.close()


def test_a_first_line_that_is_no_sample_is_refused():
    text, into = piped()
    os.write(into, b"t,q1,qd1,i1\n")
    with LineStream(text, ("a",), RATE) as stream, pytest.raises(ValueError, match="line 1: exp"):
        stream.read(1.0)
    os.close(into)
    text.close()


def test_an_input_that_does_not_block_has_not_ended():
    """As a shell leaves it that shares its terminal: a read finds nothing although it was ready."""
    text, into = piped()
    os.set_blocking(text.fileno(), False)
    with LineStream(text, ("a",), RATE) as stream:
        stream._ready = SimpleNamespace(select=lambda timeout: [1], close=lambda: None)
        assert stream.read(0.01) is None
        os.write(into, b"1,2,3,4\n5,6,7,8.")
        assert stream.read(1.0).t == 1
        os.close(into)
        with pytest.raises(StreamClosed, match="the input has ended"):
            stream.read(1.0)
        assert stream.events == ["line 2 has no end and was left out"]
    text.close()
