"""``tauguard generate``: a labelled dataset from its description."""

import signal
from pathlib import Path
from typing import Annotated

import tyro

from tauguard.findings import ArgumentError


def command(
    config: Annotated[str, tyro.conf.Positional],
    out: Path,
    workers: int | None = None,
    ray: str | None = None,
    quick: bool = False,
) -> None:
    """Simulate a described dataset and write it as Parquet with a manifest.

    After an interruption the same command continues. It also repairs damaged shards. The bytes are
    the same for any number of workers.

    Args:
        config: a TOML file, or a description in the package: tauguard-collisions-v2,
            tauguard-collisions-v1, cura6-twin.
        out: folder of the dataset, new, empty or with a part of this dataset.
        workers: processes (default: all processors).
        ray: address of a Ray cluster that simulates instead; "local" starts one on this machine.
        quick: simulate only the first episodes of every split; the configuration states how many.
    """
    import time

    from tauguard.datasets import Terminated, generate_dataset, load_configuration

    if workers is not None and workers < 1:
        raise ArgumentError(f"--workers {workers}: expected 1 or more")
    if ray is not None and workers is not None:
        raise ArgumentError("give either --workers (this machine) or --ray (a cluster)")
    configuration = load_configuration(config)
    if quick:
        configuration = configuration.quick()
    began = time.perf_counter()
    try:
        done = generate_dataset(configuration, out, workers, ray)
    except KeyboardInterrupt as stop:
        number = signal.SIGTERM if isinstance(stop, Terminated) else signal.SIGINT
        import sys

        print(
            f"tauguard generate: stopped; the same command continues {out}",
            file=sys.stderr,
        )
        raise SystemExit(128 + number) from None
    wall = time.perf_counter() - began
    print(
        f"{out}: {configuration.name}, {configuration.hours:.4g} h in {done.episodes} episodes; "
        f"{done.made} shards made, {done.kept} kept"
    )
    if done.seconds:
        print(f"{done.seconds / 3600:.3g} h simulated in {wall:.0f} s: {done.seconds / wall:.0f} x")
