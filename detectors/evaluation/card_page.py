"""The threshold card: torques and forces that a detector finds, as text and as a picture."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tauguard.arrays import Array
from tauguard.detectors.evaluation.cross_validation import CrossValidatedLog
from tauguard.detectors.features.free_bound import ANYWHERE
from tauguard.detectors.features.motion_regimes import SEEN, unseen_text
from tauguard.findings import Findings
from tauguard.report import table
from tauguard.results import Result, Row, save_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHORTEST = 300.0  # least length of logs for which an alarm rate is printed [s]
SHORT = 1800.0  # length of logs below which the text asks for longer ones [s]
#: If the first time stamp is above this, time stamps are those of a clock [s].
CLOCK = 1e6
#: Largest number of alarms of a log whose times are listed.
LISTED = 6
#: For each column of table and picture: the field of the card, and the key of ``card.unseen``.
COLUMNS = {
    "standing": ("standing", "standing for 2 s"),
    "just stopped": ("stopped", "just stopped"),
    "moving": ("moving", ""),
    "starting": ("starting", "starting"),
}
#: The condition of each force at the tool.
TOOL = {
    "standing": "standing for some seconds, pushed within 0.1 s",
    "slowly": "standing for some seconds, pushed over 1 s",
    "stopped": "just stopped, or standing while static friction holds the push first",
    "moving": "moving",
}


#: Ratio of the upper threshold, at which a robot stops, to the lower one, which reports a contact.
UPPER = 1.5
#: Numbers of joints of the arms that libfranka supports, and of UR's arms.
FRANKA_JOINTS, UR_JOINTS = 7, 6


@dataclass(frozen=True, eq=False, repr=False)
class ThresholdCard(Result):
    """Estimates of the least torques and forces that a detector finds; no safety function."""

    joints: tuple[str, ...]
    standing: Array  #: torque that is found on a joint that has long been at rest [N m], (n,)
    stopped: Array  #: torque found on a joint that has just stopped [N m], (n,)
    moving: Array  #: torque found in motion; NaN: moves in no log [N m], (n,)
    starting: Array  #: torque found on a joint that starts; NaN: moves in no log [N m], (n,)
    tool: dict[str, tuple[float, float]]
    """Force at the last link's origin that is found in half, and in 95 %, of all poses and
    directions [N]; infinite: none. Keys: "standing" (pushed within 0.1 s), "slowly" (standing,
    pushed over 1 s), "stopped" (or held by static friction), "moving"."""
    moment: float  #: moment on the last link found in motion, in half of poses and directions [N m]
    seconds: float  #: total length of the logs [s]
    alarms: int  #: number of alarms in all logs, in cross-validation
    false_alarms_per_hour: dict[str, float]  #: value, low, high (95 %), if all of them are false
    logs: tuple[CrossValidatedLog, ...]  #: the logs with their alarms in cross-validation
    left_out: tuple[CrossValidatedLog, ...]  #: logs that stood out and were left out of training
    unseen: dict[str, tuple[str, ...]]  #: by regime of motion, the joints that no log shows in it
    replay: tuple[int, int]
    """Numbers of events in the logs with constant thresholds of the plain observer's residual:
    contacts with ``moving`` and ``starting``, collisions with :data:`UPPER` times these."""
    fast: Array  #: speeds in the logs, up to which ``moving`` holds [rad/s], shape (n,)
    twice: Array  #: as ``moving``, at twice these speeds and accelerations [N m], shape (n,)
    linear: tuple[str, ...] = ()  #: prismatic joints: N and m/s instead of N m and rad/s

    findings: Findings = field(default_factory=Findings)

    def rows(self) -> list[Row]:
        """One row per joint: the torque that is found in each state; None: not known."""
        return [
            {"joint": _labelled(self, joint)}
            | {f"{name} [N m]": _number(getattr(self, COLUMNS[name][0])[j]) for name in COLUMNS}
            for j, joint in enumerate(self.joints)
        ]

    def to_dict(self) -> dict[str, Any]:
        """The card as JSON values."""
        return {
            "torques_nm": {
                name: [_number(value) for value in getattr(self, level)]
                for name, (level, _) in COLUMNS.items()
            },
            "tool_n": {name: [_number(f) for f in forces] for name, forces in self.tool.items()},
            "seconds": self.seconds,
            "alarms": self.alarms,
            "false_alarms_per_hour": self.false_alarms_per_hour,
            "left_out": [log.name for log in self.left_out],
            "unseen": {name: list(joints) for name, joints in self.unseen.items()},
            "franka": self.franka,
            "ur": self.ur,
        }

    def __str__(self) -> str:
        """The card as one page of text."""
        return text(self)

    def __repr__(self) -> str:
        """One line."""
        return (
            f"ThresholdCard({len(self.joints)} joints, {self.seconds:.0f} s, {self.alarms} alarms)"
        )

    def draw(self, path: str | Path) -> None:
        """Draw :meth:`figure` (PNG)."""
        save_figure(self.figure(), path, 130)

    def figure(self) -> Figure:
        """The card as a picture."""
        return figure_of(self)

    @property
    def franka(self) -> dict[str, list[float]]:
        """Arguments of libfranka's ``setCollisionBehavior``.

        They are torques of 7 joints [N m], and forces and moments of three axes [N, N m]. Empty for
        an arm with another number of joints or a prismatic one, or if a number is unknown.
        """
        numbers = (*self.moving, *self.starting, self.tool["moving"][0], self.moment)
        if self.linear or len(self.joints) != FRANKA_JOINTS or not np.isfinite(numbers).all():
            return {}
        tool = np.repeat([self.tool["moving"][0], self.moment], 3)
        lower = {
            "torque_thresholds_acceleration": self.starting,
            "torque_thresholds_nominal": self.moving,
            "force_thresholds_acceleration": 1.5 * tool,
            "force_thresholds_nominal": tool,
        }
        both = {f"lower_{k}": v for k, v in lower.items()}
        both |= {f"upper_{k}": UPPER * v for k, v in lower.items()}
        return {name: values.tolist() for name, values in both.items()}

    @property
    def ur(self) -> dict[str, float]:
        """The tool force limit of UR's safety settings [N]; empty for another arm, or if unknown.

        UR's arms have six joints, none of them prismatic.
        """
        limit = UPPER * self.tool["moving"][1]
        known = np.isfinite([limit, *self.moving]).all()
        other = bool(self.linear) or len(self.joints) != UR_JOINTS
        return {"tool_force_limit_n": limit} if known and not other else {}


def _number(value: float) -> float | None:
    """A number of the card; None: not known, or no such force."""
    return float(value) if np.isfinite(value) else None


def text(card: ThresholdCard) -> str:
    """The card as one page of text."""
    rows = [
        {"found from [N m]": _labelled(card, joint)}
        | {name: _torque(card, name, j) for name in COLUMNS}
        for j, joint in enumerate(card.joints)
    ]
    return "\n".join([table(rows), *(line for part in _lines(card) for line in _wrapped(part))])


def _labelled(card: ThresholdCard, joint: str) -> str:
    """The joint's name, with the unit of a linear axis."""
    return f"{joint} [N]" if joint in card.linear else joint


def _torque(card: ThresholdCard, name: str, j: int) -> str:
    """A joint's torque as text: "-" if unknown, in brackets if it comes from other arms.

    It comes from other arms if no log shows the regime, or the joint in motion while others move.
    """
    level, regime = COLUMNS[name]
    value, moving = getattr(card, level)[j], card.moving
    if value != value:
        return "-"
    shown = card.joints[j] not in card.unseen.get(regime, ())
    shown &= moving[j] == moving[j] or not (moving == moving).any()
    return f"{value:.1f}" if shown else f"({value:.1f})"


def printed_from(begin: float) -> float:
    """The offset that is subtracted from a log's times in printed text [s].

    It is the first time stamp ``begin`` if that is a clock's, as in ROS logs, else 0. Times in
    files are not changed.
    """
    return begin if begin > CLOCK else 0.0


def rate_text(high: float, seconds: float, said: str) -> str:
    """An upper bound of alarms per hour as text, if the log is long enough.

    Args:
        high: the upper bound.
        seconds: watched time [s].
        said: the text, with {} for the number.
    """
    if seconds < SHORTEST:
        return f"; {seconds / 60:.1f} min are too short to say how many an hour"
    more = "; longer logs would give a better bound" if seconds < SHORT else ""
    return said.format(f"{high:.0f}") + more


def _wrapped(line: str) -> list[str]:
    return textwrap.wrap(line, 96, subsequent_indent="  ")


def _lines(card: ThresholdCard) -> list[str]:
    assumed = any(_torque(card, "standing", j)[0] == "(" for j in range(len(card.joints)))
    bracketed = any(
        _torque(card, name, j)[0] == "(" for name in COLUMNS for j in range(len(card.joints))
    )
    lines = [
        "force found at the tool: in half (in 95 %) of all poses and directions"
        + ("; standing: if the torques in brackets hold" if assumed else ""),
        *(
            f"  {half.rjust(4)} ({most})".ljust(18) + f" {said}"
            for name, said in TOOL.items()
            for half, most in [map(_newton, card.tool[name])]
        ),
        "a contact has to last 0.1 s: an alarm needs 24 ms above a bound at rest and 40 ms in "
        "motion, so a shorter contact has to be harder",
        _alarms(card),
    ]
    limits, torques = [], []
    for linear, per_second, unit in ((False, "rad/s", "N m"), (True, "m/s", "N")):
        speeds = zip(card.joints, card.fast, card.twice, strict=True)
        own = [s for s in speeds if (s[0] in card.linear) == linear and 0 < s[1] < ANYWHERE]
        if own:
            limits.append(", ".join(f"{j} {v:.2g}" for j, v, _ in own) + f" {per_second}")
            torques.append(", ".join(f"{m:.0f}" for _, _, m in own) + f" {unit}")
    if limits:
        lines.insert(
            -1,
            f"moving: up to the speeds and accelerations of the logs ({', '.join(limits)}); at "
            f"twice these from {', '.join(torques)}",
        )
    if card.left_out:
        names = ", ".join(f"{log.name} ({times(log)})" for log in card.left_out)
        lines.append(f"not learned from, since its alarms stand out: {names}")
    if card.unseen:
        parts = unseen_text(tuple(card.unseen.items()), len(card.joints))
        lines.append(
            f"the logs show less than {SEEN:g} s of these, so no torque is stated"
            + (", or one from other arms in brackets" if bracketed else "")
            + f": {parts}"
        )

    lines += _settings(card)
    contacts, collisions = card.replay
    lines.append(
        "the columns moving and starting as constant thresholds, as a robot has them, would have "
        f"raised {contacts} contact{'' if contacts == 1 else 's'} in these logs, {collisions} of "
        f"them also if {UPPER:g} times as high"
    )
    lines.append("These are estimates from logs; they replace no safety function.")
    return lines


def _settings(card: ThresholdCard) -> list[str]:
    """Lines with the settings of a robot's controller that are like the card."""

    def numbers(values: list[float]) -> str:
        return "{" + ", ".join(f"{value:.1f}" for value in values) + "}"

    order = [
        f"{level}_{what}_thresholds_{phase}"
        for what in ("torque", "force")
        for phase in ("acceleration", "nominal")
        for level in ("lower", "upper")
    ]
    if franka := card.franka:
        return [
            "for a Franka arm, as setCollisionBehavior takes them (7 joints; x, y, z, R, P, Y):",
            *(f"  {name} {numbers(franka[name])}" for name in order),
        ]
    if card.ur:
        limit = card.ur["tool_force_limit_n"]
        return [f"for a UR arm, in its safety settings: tool force limit {limit:.0f} N"]
    if all(value == value for value in card.moving):
        return []
    return ["no thresholds for a robot's settings: some joints move in none of the logs"]


def _newton(force: float) -> str:
    """A force as text; "none" if none is found in enough poses and directions."""
    if not force < float("inf"):
        return "none"
    return f"{force:.0f} N" if force >= 10 else f"{force:.1f} N"


def _alarms(card: ThresholdCard) -> str:
    """Number of alarms in the training logs, and names of logs with alarms."""
    high = card.false_alarms_per_hour["high"]
    said = f"alarms in these logs: {card.alarms} in {card.seconds / 60:.1f} min, each "
    said += "log" if len(card.logs) > 1 else "part"
    said += " with calibration and bounds from the others"
    if own := [f"{log.name} ({times(log)})" for log in card.logs if log.alarms]:
        said += f": {', '.join(own)}; where something touched the arm, leave that log out"
    return said + rate_text(
        high, card.seconds, "; at most {} false alarms per hour (95 %) on motion like this"
    )


def times(log: CrossValidatedLog) -> str:
    """Number and times of the alarms of a log: "3 alarms at 1.2, 3.4, 5.6 s"."""
    since = printed_from(log.begin)
    starts = [f"{alarm.start - since:.1f}" for alarm in log.alarms]
    shown = ", ".join(starts[:LISTED]) + (" ..." if len(starts) > LISTED else "")
    after = " after its first sample" if since else ""
    return f"{len(starts)} alarm{'' if len(starts) == 1 else 's'} at {shown} s{after}"


def figure_of(card: ThresholdCard) -> Figure:
    """The card as a picture."""
    from matplotlib.figure import Figure

    lines = [line for part in _lines(card) for line in _wrapped(part)]
    sizes = (4.6, 0.3 + 0.17 * len(lines))
    figure = Figure(figsize=(9, sum(sizes)), layout="constrained")
    bars, words = figure.subplots(2, 1, height_ratios=sizes)
    place = np.arange(len(card.joints))
    for k, (name, (level, _)) in enumerate(COLUMNS.items()):
        drawn = bars.bar(place + 0.2 * (k - 1.5), getattr(card, level), 0.2, label=name)
        said = [_torque(card, name, j) for j in place.tolist()]
        bars.bar_label(drawn, said, fontsize=6, padding=1)
        for bar, one in zip(drawn, said, strict=True):
            bar.set_alpha(0.3 if one[0] == "(" else 1.0)  # not from these logs
    names = [_labelled(card, joint) for joint in card.joints]
    bars.set_xticks(place, names, rotation=20, ha="right")
    bars.set_ylabel("torque that is found [N m]")
    bars.spines[["top", "right"]].set_visible(False)
    bars.legend(frameon=False)
    bars.set_title("Threshold card: what the free-motion detector finds", loc="left")
    words.axis("off")
    words.text(0, 1, "\n".join(lines), va="top", fontsize=8.5, family="monospace")
    return figure
