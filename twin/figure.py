"""A figure that compares a twin with its arm."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tauguard.twin.judge import Likeness

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def figure_of(joints: tuple[str, ...], likeness: Likeness) -> Figure:
    """The verdict, residuals of the first held-out log, and spectra of all logs.

    Args:
        joints: names.
        likeness: from :func:`tauguard.twin.compare`.
    """
    from matplotlib.figure import Figure
    from scipy.signal import welch

    kinds = {"real": likeness.real_residuals, "twin": likeness.twin_residuals}
    t, n = likeness.times[0], len(joints)
    rate = 1 / float(np.median(np.diff(t)))
    figure = Figure(figsize=(11, 1.6 * n + 1), layout="constrained")
    axes = figure.subplots(n, 2, squeeze=False, sharex="col")
    for (kind, logs), colour in zip(kinds.items(), ("0.2", "tab:orange"), strict=True):
        every = np.concatenate(logs)
        for j, (name, row) in enumerate(zip(joints, axes, strict=True)):
            row[0].plot(t - t[0], logs[0][:, j], color=colour, lw=0.6, label=kind)
            row[0].set_ylabel(f"{name}\n[N m]", fontsize=7)
            hertz, power = welch(every[:, j], rate, nperseg=min(512, len(every)))
            row[1].loglog(hertz[1:], power[1:], color=colour, lw=0.8)
    for j, row in enumerate(axes):
        row[0].set_title(_ratios(likeness, j), fontsize=8, loc="left")
    axes[0, 0].legend(fontsize=7, loc="upper right")
    axes[-1, 0].set_xlabel("time in the first held-out log [s]")
    axes[-1, 1].set_xlabel("frequency [Hz]")
    axes[0, 1].set_title("power of the residual [(N m)$^2$/Hz]", fontsize=8)
    figure.suptitle(verdict(likeness), fontsize=9)
    return figure


def verdict(likeness: Likeness) -> str:
    """Areas under the curves of the classifiers and numbers of alarms, in two lines."""
    moving, standing = (
        "too short" if np.isnan(area[0]) else f"{area[0]:.2f}"
        for area in (likeness.moving_auc, likeness.standing_auc)
    )
    arm, twin = likeness.alarms
    return (
        f"Area under the curve of a classifier that tells twin from arm (.5: it cannot): moving "
        f"{moving}, standing {standing}\nAlarms of free-motion in {likeness.seconds:.0f} s: "
        f"{arm} on the arm, {twin} on the twin"
    )


def _ratios(likeness: Likeness, joint: int) -> str:
    """Ratios of simulated to real residuals of one joint, as text."""
    parts = {
        "rms": likeness.rms,
        "peaks": likeness.peaks,
        "standing rms": likeness.standing_rms,
    }
    shown = [f"{k} {v[joint]:.2f}" for k, v in parts.items() if not np.isnan(v[joint])]
    return f"twin over real: {', '.join(shown)}" if shown else "hardly moves"
