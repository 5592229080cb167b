"""An independent referee: which contacts there are on the path that checkers are told."""

from tauguard.contacts.referee.events import Event, Pair, events, pair_of
from tauguard.contacts.referee.judge import TOLERANCE, Referee, Verdicts

__all__ = ["TOLERANCE", "Event", "Pair", "Referee", "Verdicts", "events", "pair_of"]
