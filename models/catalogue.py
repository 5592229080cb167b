"""Arms by name: where their models come from, and the download of one."""

from tauguard.extras import extra
from tauguard.findings import ArgumentError
from tauguard.models.arm import NAMED
from tauguard.models.known_robots import ROBOTS, menagerie_file


def named_arms() -> dict[str, str]:
    """The source of the model of each named arm, as text."""
    arms = dict.fromkeys(NAMED, "part of tauguard")
    for name, row in sorted(ROBOTS.items(), key=lambda item: item[1].own is None):
        menagerie = row.menagerie and f"mujoco-menagerie ({row.menagerie})"
        packages = [row.urdf and "example-robot-data", menagerie]
        arms[name] = (
            "from " + " or ".join(filter(None, packages))
            if row.own is None
            else "part of tauguard: published numbers, light shapes"
        )
    return arms


def download_arm(name: str) -> None:
    """Download the model of an arm through mujoco-menagerie.

    Raises:
        ArgumentError: not an arm of mujoco-menagerie, or that is not installed.
        FileError: it cannot be fetched.
    """
    row = ROBOTS.get(name)
    model = row.menagerie if row is not None else name
    if name in NAMED or model is None:
        raise ArgumentError(f"`download=True`: {name} is not in mujoco-menagerie")
    try:
        menagerie_file(model, download=True)
    except ModuleNotFoundError:
        text = f"`download=True` needs mujoco-menagerie: {extra('arms')}"
        raise ArgumentError(text) from None
