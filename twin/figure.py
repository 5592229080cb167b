"""A figure that compares a twin with its arm."""

from pathlib import Path

import numpy as np

from tauguard.twin.judge import Likeness


def draw(path: Path, joints: tuple[str, ...], likeness: Likeness) -> None:
    """Residuals of the first held-out log, and all their spectra.

    Args:
        path: PNG.
        joints: names.
        likeness: from :func:`tauguard.twin.compare`.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from scipy.signal import welch

    kinds = {"real": likeness.real_residuals, "twin": likeness.twin_residuals}
    figure, axes = plt.subplots(len(joints), 2, figsize=(11, 1.6 * len(joints)), squeeze=False)
    for (kind, logs), colour in zip(kinds.items(), ("0.2", "tab:orange"), strict=True):
        every = np.concatenate(logs)
        for j, (name, row) in enumerate(zip(joints, axes, strict=True)):
            row[0].plot(logs[0][:, j], color=colour, lw=0.6, label=kind)
            row[0].set_ylabel(f"{name}\n[N m]", fontsize=7)
            cycles, power = welch(every[:, j], nperseg=min(512, len(every)))
            row[1].loglog(cycles[1:], power[1:], color=colour, lw=0.8)
    axes[0, 0].legend(fontsize=7)
    axes[-1, 0].set_xlabel("sample of the first held-out log")
    axes[-1, 1].set_xlabel("cycles a sample")
    axes[0, 0].set_title("unexplained residual", fontsize=8)
    axes[0, 1].set_title("its power", fontsize=8)
    figure.tight_layout()
    figure.savefig(path, dpi=90)
    plt.close(figure)
