"""The threshold card for a reader: in the terminal, and as a picture."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

from tauguard.whole_file import whole_file

if TYPE_CHECKING:
    from tauguard.detectors.evaluation.threshold_card import ThresholdCard

#: Logs shorter than this say nothing of alarms per hour, logs shorter than that hardly [s].
SHORTEST, SHORT = 300.0, 1800.0


def text(card: ThresholdCard) -> str:
    """One page."""
    from tauguard.report import table

    joints = zip(card.joints, card.standing, card.stopped, card.moving, card.starting, strict=True)
    rows = [
        {
            "found from [N m]": name,
            "standing": f"{standing:.1f}",
            "just stopped": f"{stopped:.1f}",
            "moving": f"{moving:.1f}",
            "starting": f"{starting:.1f}",
        }
        for name, standing, stopped, moving, starting in joints
    ]
    return "\n".join([table(rows), *(line for part in _lines(card) for line in _wrapped(part))])


def rate_text(high: float, seconds: float, said: str) -> str:
    """An upper bound of alarms per hour in the words ``said``, where a log is long enough for one.

    Args:
        high: the bound.
        seconds: that were watched.
        said: with {} for the number.
    """
    if seconds < SHORTEST:
        return f"; {seconds / 60:.1f} min are too short to say how many an hour"
    more = "; longer logs would say more" if seconds < SHORT else ""
    return said.format(f"{high:.0f}") + more


def _wrapped(line: str) -> list[str]:
    return textwrap.wrap(line, 96, subsequent_indent="  ")


def _lines(card: ThresholdCard) -> list[str]:
    rate = card.false_alarms_per_hour
    half, most = zip(*(card.tool[k] for k in ("standing", "moving")), strict=True)
    lines = [
        f"at the tool: {half[0]:.0f} N standing and {half[1]:.0f} N moving, in half of all poses "
        f"and directions; {most[0]:.0f} N and {most[1]:.0f} N in 95 % of them",
        "all of contacts that last 0.1 s and more: an alarm needs 24 ms above a bound at rest and "
        "40 ms in motion, so a shorter blow has to be harder",
        f"false alarms: {card.alarms} in {card.seconds / 60:.1f} min, each part under "
        "calibration and bounds from the others"
        + rate_text(
            rate["high"], card.seconds, ", so at most {} per hour (95 %) on motion like this"
        ),
    ]
    if card.unseen:
        parts = "; ".join(
            f"{name}: {'all joints' if len(joints) == len(card.joints) else ', '.join(joints)}"
            for name, joints in card.unseen.items()
        )
        lines.append(f"not in the logs, bounded by prior knowledge of other arms: {parts}")

    def numbers(values: list[float]) -> str:
        return "{" + ", ".join(f"{value:.1f}" for value in values) + "}"

    order = [
        f"{level}_{what}_thresholds_{phase}"
        for what in ("torque", "force")
        for phase in ("acceleration", "nominal")
        for level in ("lower", "upper")
    ]
    if franka := card.franka:
        lines.append("as Franka's setCollisionBehavior takes them (7 joints; x, y, z, R, P, Y):")
        lines += [f"  {name} {numbers(franka[name])}" for name in order]
    else:
        lines.append(
            f"as UR's safety settings: tool force limit {card.ur['tool_force_limit_n']:.0f} N "
            f"(Franka's setCollisionBehavior is for 7 joints, this arm has {len(card.joints)})"
        )
    lines.append("These are estimates from logs; they replace no safety function.")
    return lines


def draw(target: Path, card: ThresholdCard) -> None:
    """The card as a picture (PNG)."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    import numpy as np

    lines = [line for part in _lines(card) for line in _wrapped(part)]
    sizes = (4.6, 0.3 + 0.17 * len(lines))
    figure, (bars, words) = plt.subplots(
        2, 1, figsize=(9, sum(sizes)), height_ratios=sizes, layout="constrained"
    )
    levels = {
        "standing": card.standing,
        "moving": card.moving,
        "just stopped": card.stopped,
        "starting": card.starting,
    }
    place = np.arange(len(card.joints))
    for k, (name, values) in enumerate(levels.items()):
        drawn = bars.bar(place + 0.2 * (k - 1.5), values, 0.2, label=name)
        bars.bar_label(drawn, fmt="%.1f", fontsize=6, padding=1)
    bars.set_xticks(place, card.joints, rotation=20, ha="right")
    bars.set_ylabel("torque that is found [N m]")
    bars.spines[["top", "right"]].set_visible(False)
    bars.legend(frameon=False)
    bars.set_title("Threshold card: what the free-motion detector finds", loc="left")
    words.axis("off")
    words.text(0, 1, "\n".join(lines), va="top", fontsize=8.5, family="monospace")
    with whole_file(target) as stream:
        figure.savefig(stream, dpi=130, format=target.suffix[1:] or "png")
    plt.close(figure)
