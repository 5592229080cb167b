"""``tauguard simulate``: simulate labelled episodes and record them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from tauguard.findings import ArgumentError

if TYPE_CHECKING:
    from tauguard.envs import Episode

#: Default payloads of the CURA6-like arm, taken in turn [g].
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
    arm_joints: str | None = None,
    objects: Path | None = None,
    workers: int | None = None,
    json: Path | None = None,
) -> None:
    """Simulate labelled episodes of a moving arm and write one MCAP file per episode.

    A second run with the same flags continues where the first run stopped.

    Args:
        out: folder for the recordings; it is created if it does not exist.
        episodes: number of episodes.
        collisions: number of collisions in each episode; 0 makes every episode collision-free.
        free: number of additional collision-free episodes, from which thresholds can be set.
        seconds: length of a collision-free episode [s]; an episode with collisions is as long
            as its collisions require.
        speeds: joint speeds in percent of the maximum; the episodes take them in turn.
        payloads_g: payloads at the flange [g] that the observer does not know; the episodes take
            them in turn. The default is 0, 1016 and 4039, scaled down for an arm whose torque
            limits are below 64 N m.
        seed: seed of the random motions and collisions.
        mismatch_seed: seed of the differences between the simulated arm and its nominal model in
            masses, gains and friction; None simulates the nominal arm.
        checkers: contact checkers (mujoco, cloth, rigid) to run at every step; the recordings and
            the replay show the contacts that they report.
        robot: name or file of the arm; see `tauguard robot`.
        arm_joints: for a file with several chains, the arm's joints: names separated by commas, or
            FIRST..LAST.
        objects: TOML file that describes the objects around the arm; the page "Build a scene of
            your own" explains its format.
        workers: number of processes; the default is one for each processor.
        json: file for a summary of the simulated episodes, in JSON.
    """
    from tauguard.cli import expect
    from tauguard.datasets import free_episodes, struck_episodes, torque_scale, write_dataset
    from tauguard.models import Mismatch, load_objects
    from tauguard.report import write_json

    if episodes < 1:
        raise ArgumentError(f"--episodes {episodes}: expected 1 or more")
    if min(collisions, free) < 0:
        raise ArgumentError(f"--collisions {collisions}, --free {free}: expected 0 or more")
    expect("--workers", 1 if workers is None else workers, 1)
    expect("--mismatch-seed", mismatch_seed or 0, 0)
    if not speeds or payloads_g == ():
        raise ArgumentError("--speeds and --payloads-g: expected at least one number after each")
    robot = robot if arm_joints is None else f"{robot}#{arm_joints}"
    if payloads_g is None:
        scale = torque_scale(robot)
        payloads_g = tuple(scale * load for load in LOADS)
    first = 10_000  # the demo uses smaller seeds; its model may be evaluated on these episodes
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
    """Print the content of one recording as a line, and return it as JSON values."""
    from tauguard.traces import read_mcap

    trace = read_mcap(path)
    found = trace.truth.collisions if trace.truth else ()
    contacts = {one.checker: len(one) for one in trace.contacts}
    planned, missed = len(episode.collisions), trace.meta.get("missed", "").splitlines()
    print(
        f"{path.name}  {episode.seconds:6.1f} s  {episode.speed:5.1f} %  "
        f"{episode.payload_g:6.0f} g  {len(found)} of {planned} planned collisions"
        + "".join(f"  {name}: {count} contacts" for name, count in contacts.items())
        + "".join(f"\n    not {why}" for why in missed)
    )
    return {
        "file": path.name,
        "seconds": episode.seconds,
        "speed": episode.speed,
        "payload_g": episode.payload_g,
        "planned": planned,
        "collisions": len(found),
        "missed": missed,
        **{f"contacts_{name}": count for name, count in contacts.items()},
        "peak_tau": max((c.peak_tau for c in found), default=0.0),
    }
