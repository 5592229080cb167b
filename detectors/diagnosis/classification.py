"""The kind of event behind an alarm: transient contact, clamping, intended push or payload change.

Three questions, each with a measure that has a physical meaning:

* Does it last? A transient contact, such as an impact or a short push, is over at the end of the
window, when a clamping, a push or a payload is still there. The measure is the part of the residual
that is left at the end of the window, in the direction of its peak. The window ends 0.3 s after the
alarm (at 100 Hz: 0.5 s). ISO/TS 15066:2016 has limits for transient contact up to 0.5 s, then those
for quasi-static contact.
* Is it a load? An unknown payload pulls down at the flange: the fraction of the residual
  that one constant mass and first moment at the last link explain, over all joints and samples.
* Is it intended? A hand pushes more slowly than an arm runs into things (Golz et al. 2015,
Kouris et al. 2018 use the spectrum), and a clamping always acts against the arm's motion. The
measures are the rate at which the force rises, and the cosine between force and velocity of the
touched point.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors.diagnosis.post_alarm import PostAlarmWindow

#: The kinds of events. A payload change is no collision; a push is an intended contact.
KINDS = ("transient", "clamp", "push", "payload")
#: An event lasts if this fraction of its peak residual remains at the end of the window. The second
#: number is the width of the logistic function of the decision.
LASTS, LASTS_WIDTH = 0.5, 0.05
#: An event is a payload change if a payload explains this fraction of the residual. The second
#: number is the width of the logistic function of the decision.
LOAD, LOAD_WIDTH = 0.9, 0.01
#: Largest distance of a payload from the last joint [m], and largest mass of a payload [kg].
REACH, HEAVIEST = 0.5, 7.0
#: Length of the end of the window that decides whether an event lasts [s].
END = 0.03
#: The fraction that a payload explains is computed from samples later than SETTLING [s], and later
#: than SETTLING_LAGS time constants of the observer, after the alarm. Before, the arm still moves.
SETTLING, SETTLING_LAGS = 0.025, 3.0
#: Log odds that an event that lasts is an intended push: constant, change per decade of the rise
#: [N/s], change per unit of the cosine. Fitted by logistic regression to simulated clampings and
#: pushes, on arms and seeds that no study uses.
INTENT = (4.2, -1.2, 3.6)
#: Least duration of the rise of the force; shorter ones are set to it [s].
SHORTEST = 1e-3
#: Fractions of the peak between which the rise is measured.
RISE = (0.25, 0.75)


@dataclass(frozen=True)
class Signs:
    """Measures that determine the kind of an event."""

    lasting: float  #: residual at the end of the window along its peak, as a fraction of the peak
    load: float  #: fraction of the residual that a constant payload explains, 0 to 1
    mass: float  #: mass of that payload [kg]; negative if the arm put it down
    reach: float  #: distance of that payload from the last joint [m]
    rise: float  #: rate of the force between a quarter and three quarters of its peak [N/s]
    along: float  #: cosine between force and velocity of the touched point, -1 to 1
    speed: float  #: of the touched point before the alarm [m/s]

    def probabilities(self, load_known: bool = False) -> dict[str, float]:
        """Probability of each of :data:`KINDS`; that of "payload" is 0 if ``load_known``."""
        from scipy.special import expit

        lasts = float(expit((self.lasting - LASTS) / LASTS_WIDTH))
        possible = not load_known and self.reach <= REACH and abs(self.mass) <= HEAVIEST
        load = float(expit((self.load - LOAD) / LOAD_WIDTH)) if possible else 0.0
        odds = INTENT[0] + INTENT[1] * np.log10(max(self.rise, 1.0)) + INTENT[2] * self.along
        meant = float(expit(odds))
        pressing = lasts * (1 - load)
        fractions = (1 - lasts, pressing * (1 - meant), pressing * meant, lasts * load)
        return dict(zip(KINDS, fractions, strict=True))


def signs(after: PostAlarmWindow, force: Array, velocity: Array) -> Signs:
    """Compute the measures of an event from the samples around its alarm.

    Args:
        after: the residual around the alarm.
        force: peak force on the arm [N], shape (3,).
        velocity: velocity of the touched point before the alarm [m/s], shape (3,).
    """
    level = after.level
    highest = float(level.max())
    scaled = after.residual / after.deviation
    same_way = scaled @ scaled[int(level.argmax())] / highest**2
    fraction, mass, reach = load(after)
    size, speed = float(np.linalg.norm(force)), float(np.linalg.norm(velocity))
    along = float(force @ velocity) / (size * speed) if size * speed > 0 else 0.0
    first, second = (int(np.flatnonzero(level >= fraction * highest)[0]) for fraction in RISE)
    shortest = float(np.diff(after.t).min(initial=SHORTEST))
    rising = max(float(after.t[second] - after.t[first]), shortest)
    return Signs(
        float(same_way[after.t > after.t[-1] - END].mean()),
        fraction,
        mass,
        reach,
        (RISE[1] - RISE[0]) * size / rising,
        along,
        speed,
    )


def load(after: PostAlarmWindow) -> tuple[float, float, float]:
    """Fraction of the residual that a constant payload explains, its mass [kg] and distance [m].

    Weighted least squares for mass and first moment over the samples once a transient is over.
    """
    rows = after.t >= min(SETTLING + SETTLING_LAGS * after.lag, 0.5 * float(after.t[-1]))
    weight = 1 / after.deviation[rows]
    y = (after.residual[rows] * weight).ravel()
    columns = (after.payload[rows] * weight[:, :, None]).reshape(len(y), -1)
    found = np.linalg.lstsq(columns, y, rcond=None)[0]
    whole = float(y @ y)
    rest = y - columns @ found
    fraction = 1 - float(rest @ rest) / whole if whole > 0 else 0.0
    mass, moment = float(found[0]), float(np.linalg.norm(found[1:]))
    return fraction, mass, moment / abs(mass) if mass else np.inf
