"""Samples of a robot as it runs: where they come from, and a server to test against."""

from tauguard.datasets.live.lines import LineSource
from tauguard.datasets.live.played import PlayedSource
from tauguard.datasets.live.sample import LiveSource, Sample, SourceClosed
from tauguard.datasets.live.ur import UrSource
from tauguard.datasets.live.ur_server import UrServer

__all__ = [
    "LineSource",
    "LiveSource",
    "PlayedSource",
    "Sample",
    "SourceClosed",
    "UrServer",
    "UrSource",
]
