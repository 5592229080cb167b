"""True contacts for `compare`, found by independent code on the same path as the checkers use."""

from tauguard.contacts.ground_truth.events import Event, Pair, events, pair_of
from tauguard.contacts.ground_truth.touches import TOLERANCE, GroundTruth, Touches

__all__ = ["TOLERANCE", "Event", "GroundTruth", "Pair", "Touches", "events", "pair_of"]
