"""``tauguard simulate``: labelled episodes, as many as asked."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tauguard.envs import Episode

#: Loads of the CURA6-like arm that are gone through by default [g].
LOADS = (0.0, 1016.0, 4039.0)


def command(
    out: Path,
    episodes: int = 10,
    collisions: int = 8,
    free: int = 0,
    seconds: float = 20.0,
    speeds: tuple[float, ...] = (10.0, 30.0, 60.0),
    payloads_g: tuple[float, ...] | None = None,
    seed: int = 0,
    mismatch_seed: int | None = 0,
    checkers: tuple[str, ...] = (),
    robot: str = "cura6",
    objects: Path | None = None,
    workers: int | None = None,
    json: Path | None = None,
) -> None:
    """Simulate labelled episodes of the arm at work and write one MCAP each.

    A second run with the same flags continues where the first stopped.

    Args:
        out: folder of the recordings (made if it does not exist).
        episodes: how many.
        collisions: injected into each episode; 0 gives collision-free ones.
        free: collision-free episodes beside them, for thresholds.
        seconds: length of a collision-free episode (struck ones are as long as they need).
        speeds: percent of the maximum joint speed, cycled.
        payloads_g: grams at the flange that the observer does not know, cycled
            (default: 0, 1016 and 4039, less on an arm whose torque limits are below 64 N m).
        seed: of everything that is drawn.
        mismatch_seed: which arm: how its masses, gains and friction differ from the nominal ones;
            None simulates the nominal arm.
        checkers: contact checkers (mujoco, cloth, rigid) that watch every step; their contacts go
            into the recordings and the replay.
        robot: which arm, by name or file: see `tauguard robot`.
        objects: TOML file of things around the arm, see the page "Build a scene of your own".
        workers: processes (default: all processors).
        json: write what was simulated here as JSON.
    """
    from tauguard.datasets import free_episodes, struck_episodes, write_dataset
    from tauguard.datasets.plans import torque_scale
    from tauguard.models import Mismatch, load_objects
    from tauguard.report import write_json

    if episodes < 1:
        raise ValueError(f"--episodes {episodes}: expected 1 or more")
    if min(collisions, free) < 0:
        raise ValueError(f"--collisions {collisions}, --free {free}: expected 0 or more")
    if payloads_g is None:
        scale = torque_scale(robot)
        payloads_g = tuple(scale * load for load in LOADS)
    first = 10_000  # smaller seeds are the demo's, whose model may be judged on these episodes
    arm = None if mismatch_seed is None else Mismatch(seed=mismatch_seed)
    planned = (
        struck_episodes(first + seed, episodes, collisions, speeds, payloads_g, arm, robot)
        if collisions
        else free_episodes(first + seed, episodes, seconds, speeds, payloads_g, arm, robot=robot)
    )
    if free and collisions:
        planned += free_episodes(first + seed, free, seconds, speeds, payloads_g, arm, robot=robot)
    if objects is not None:
        around = load_objects(objects)
        planned = [replace(episode, objects=around) for episode in planned]
    paths = write_dataset(planned, out, workers, checkers)
    rows = [described(path, episode) for path, episode in zip(paths, planned, strict=True)]
    if json is not None:
        write_json(json, {"name": "simulate", "seed": seed, "rows": rows})


def described(path: Path, episode: Episode) -> dict[str, object]:
    """What one recording holds, printed as a line and given for JSON."""
    from tauguard.traces import read_mcap

    trace, _ = read_mcap(path)
    found = trace.truth.collisions if trace.truth else ()
    contacts = {one.checker: len(one) for one in trace.contacts}
    print(
        f"{path.name}  {episode.seconds:6.1f} s  {episode.speed:5.1f} %  "
        f"{episode.payload_g:6.0f} g  {len(found)} collisions"
        + "".join(f"  {name}: {count} contacts" for name, count in contacts.items())
    )
    return {
        "file": path.name,
        "seconds": episode.seconds,
        "speed": episode.speed,
        "payload_g": episode.payload_g,
        "collisions": len(found),
        **{f"contacts_{name}": count for name, count in contacts.items()},
        "peak_tau": max((c.peak_tau for c in found), default=0.0),
    }
