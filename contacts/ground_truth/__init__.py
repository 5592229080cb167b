"""The ground truth of `compare`, on the same path as the checkers, by independent code."""

from tauguard.contacts.ground_truth.events import Event, Pair, events, pair_of
from tauguard.contacts.ground_truth.touches import TOLERANCE, GroundTruth, Touches

__all__ = ["TOLERANCE", "Event", "GroundTruth", "Pair", "Touches", "events", "pair_of"]
