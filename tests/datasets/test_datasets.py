"""Datasets on disk: the same bytes whoever computes them, and nothing half-written."""

import errno
import json
import math
import os
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from tauguard.atomic_write import atomic_file
from tauguard.datasets import columns_of_shards, inspection
from tauguard.datasets.configuration import load_configuration
from tauguard.datasets.dataset_folder import HEAD, claimed, lines, read_head
from tauguard.datasets.generation import generate_dataset
from tauguard.datasets.reader import read
from tauguard.datasets.shard import simulated
from tauguard.datasets.workers import WorkerDied, in_processes

from .conftest import contents


def generate(*arguments, **options):
    command = [sys.executable, "-c", "from tauguard.cli import main; main()", "generate"]
    return subprocess.Popen(
        [*command, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        **options,
    )


def wait_for(condition, seconds=240):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.005)


def test_every_episode_is_there_once_with_its_labels(tiny, tiny_toml):
    every = list(lines(tiny))
    assert [(x["split"], x["number"]) for x in every] == [
        ("train", 0), ("train", 1), ("train", 2), ("test", 0), ("test", 1)
    ]  # fmt: skip
    assert inspection.verified(tiny) == []
    report = inspection.report(tiny)
    assert report["leaks"] == report["missing"] == []
    table = pq.read_table(tiny / "data" / "train-000000.parquet")
    assert table.num_rows == 2 * 3300
    struck = np.flatnonzero(table["collision"].to_numpy() >= 0)
    pushed = np.flatnonzero(table["contact_force"].to_numpy() > 0)
    assert set(pushed) <= set(struck)


def test_what_is_read_is_what_was_simulated(tiny, tiny_toml):
    line = next(x for x in lines(tiny) if x["collisions"])
    _, same = inspection.simulated_again(tiny, line)
    assert same
    trace = next(t for t in read(tiny) if t.meta["key"] == line["key"])
    configuration = load_configuration(tiny_toml)
    split = next(s for s in configuration.splits if s.name == line["split"])
    from tauguard.datasets.schedule import planned

    whole, _ = simulated(planned(configuration, split, line["number"]), with_residual=False)
    np.testing.assert_allclose(trace.current, whole.current[::2], atol=4e-5)
    np.testing.assert_allclose(trace.q, whole.q[::2], atol=3e-7)
    np.testing.assert_allclose(trace.truth.tau_ext, whole.truth.tau_ext[::2], rtol=1e-6, atol=1e-9)
    for a, b in zip(trace.truth.collisions, whole.truth.collisions, strict=True):
        assert (a.kind, a.onset, a.end, a.link, a.peak_tau) == (
            b.kind, b.onset, b.end, b.link, b.peak_tau
        )  # fmt: skip


def test_two_workers_killed_and_one_that_goes_on_give_the_same_bytes(tiny, tiny_toml, tmp_path):
    folder = tmp_path / "killed"
    process = generate(tiny_toml, "--out", folder, "--workers", 2)
    wait_for(lambda: list(folder.glob("data/*.parquet")) or process.poll() is not None)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    generate_dataset(load_configuration(tiny_toml), folder, workers=1)
    assert contents(folder) == contents(tiny)


def test_a_stopped_run_ends_at_once_with_one_line(tiny_toml, tmp_path):
    # Ctrl-C, dead workers and full disks in number: `pytest -m slow -k interrupted`.
    folder, number = tmp_path / "stopped", signal.SIGTERM
    process = generate(tiny_toml, "--out", folder, "--workers", 2)
    wait_for(lambda: (folder / HEAD).exists())
    began = time.monotonic()
    os.kill(process.pid, number)
    out, err = process.communicate(timeout=60)
    assert time.monotonic() - began < 5
    assert process.returncode == 128 + number, err
    assert err.count("\n") == 1, err
    assert "the same command continues" in err
    assert out == ""
    assert not list(folder.rglob(".*"))


def test_a_dead_worker_is_noticed():
    with pytest.raises(WorkerDied, match="exit code 3"):
        list(in_processes(os._exit, [3, 3], 2))


def test_no_worker_hears_ctrl_c_not_even_the_first():
    # In a new process: its first worker begins multiprocessing's resource tracker.
    code = (
        "import functools, signal; from tauguard.datasets.workers import in_processes\n"
        "mask = functools.partial(signal.pthread_sigmask, signal.SIG_BLOCK)\n"
        "print([signal.SIGINT in blocked for blocked in in_processes(mask, [[], []], 2)])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.stdout == "[True, True]\n", done.stderr


def test_results_of_workers_are_complete_and_errors_come_through():
    squares = [float(n * n) for n in range(9)]
    assert sorted(in_processes(math.sqrt, squares, 2)) == list(range(9))
    with pytest.raises(ValueError, match=r"math domain error|nonnegative"):
        list(in_processes(math.sqrt, [1.0, -1.0, 4.0], 2))


def test_workers_load_no_opengl(monkeypatch):
    """GLFW's check of its version, one more process, would report a stop as a broken pipe."""
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    loaded = "__import__('mujoco') and 'glfw' in __import__('sys').modules"
    assert list(in_processes(eval, [loaded] * 2, 2)) == [False, False]
    assert "MUJOCO_GL" not in os.environ


def test_a_damaged_shard_is_found_named_and_made_again_alone(tiny, tiny_toml, tmp_path):
    folder = tmp_path / "damaged"
    shutil.copytree(tiny, folder)
    victim = folder / "data" / "train-000001.parquet"
    data = bytearray(victim.read_bytes())
    data[len(data) // 2] ^= 1
    victim.write_bytes(data)
    others = {p: p.stat().st_mtime_ns for p in folder.rglob("*.parquet") if p != victim}
    ((name, wrong),) = inspection.verified(folder)
    assert name == "data/train-000001.parquet"
    assert "damaged" in wrong
    with pytest.raises(ValueError, match=r"train-000001\.parquet: damaged"):
        list(read(folder))
    done = generate_dataset(load_configuration(tiny_toml), folder, workers=1)
    assert (done.made, done.kept) == (1, 2)
    assert contents(folder) == contents(tiny)
    assert others == {p: p.stat().st_mtime_ns for p in others}


@pytest.mark.parametrize("damage", ["cut", "gone", "manifest cut", "manifest gone"])
def test_any_damage_is_mended(tiny, tiny_toml, tmp_path, damage):
    folder = tmp_path / "damaged"
    shutil.copytree(tiny, folder)
    name = "manifest/test-000000.jsonl" if "manifest" in damage else "data/test-000000.parquet"
    victim = folder / name
    if "gone" in damage:
        victim.unlink()
    else:
        victim.write_bytes(victim.read_bytes()[: victim.stat().st_size // 2])
    assert [name for name, _ in inspection.verified(folder)] == ["data/test-000000.parquet"]
    generate_dataset(load_configuration(tiny_toml), folder, workers=1)
    assert contents(folder) == contents(tiny)


def test_a_folder_of_something_else_is_left_as_it_is(tiny, tiny_toml, tmp_path):
    before = contents(tiny)
    with pytest.raises(ValueError, match="holds another dataset"):
        generate_dataset(load_configuration(tiny_toml).quick(), tiny, workers=1)
    assert contents(tiny) == before
    (tmp_path / "holiday.jpg").write_bytes(b"1")
    with pytest.raises(ValueError, match="not empty, and no dataset"):
        generate_dataset(load_configuration(tiny_toml), tmp_path, workers=1)
    assert contents(tmp_path) == {"holiday.jpg": b"1"}


def test_a_newer_format_is_refused_with_its_number(tiny, tiny_toml, tmp_path):
    folder = tmp_path / "newer"
    shutil.copytree(tiny, folder)
    head = json.loads((folder / HEAD).read_text())
    (folder / HEAD).write_text(json.dumps({**head, "format": 99}))
    before = contents(folder)
    for attempt in (
        read_head,
        lambda f: list(read(f)),
        lambda f: generate_dataset(load_configuration(tiny_toml), f),
    ):
        with pytest.raises(ValueError, match="format 99; this tauguard reads up to 2"):
            attempt(folder)
    assert contents(folder) == before


@pytest.mark.parametrize("episodes", [0, 5])
def test_a_head_with_another_number_of_episodes_is_damaged(tiny, tmp_path, episodes):
    """It would be read as a dataset without them, or as one that is not complete."""
    head = json.loads((tiny / HEAD).read_text())
    head["configuration"]["splits"][0]["episodes"] = episodes
    (tmp_path / HEAD).write_text(json.dumps(head))
    with pytest.raises(ValueError, match="damaged"):
        next(read(tmp_path))


def test_the_quick_part_is_the_beginning_of_the_whole(tiny, tiny_toml, tmp_path):
    generate_dataset(load_configuration(tiny_toml).quick(), tmp_path / "quick", workers=1)
    name = "data/train-000000.parquet"
    assert contents(tmp_path / "quick")[name] == contents(tiny)[name]


def test_a_full_disk_leaves_no_part_and_the_old_file(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"old")

    def fill():
        with atomic_file(path) as stream:
            stream.write(b"new")
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with pytest.raises(OSError, match=r"No space left on device: '.*/a'"):
        fill()
    assert contents(tmp_path) == {"a": b"old"}


def test_two_runs_do_not_write_one_folder(tiny, tiny_toml):
    configuration = load_configuration(tiny_toml)
    with (
        claimed(tiny, configuration),
        pytest.raises(OSError, match="another process is generating"),
    ):
        generate_dataset(configuration, tiny, workers=1)


def test_a_damaged_arm_is_named_and_written_again(tiny, tiny_toml, tmp_path):
    folder = tmp_path / "damaged"
    shutil.copytree(tiny, folder)
    arm = folder / "arms" / "cura6.xml"
    arm.write_text(arm.read_text().replace("mass", "Mass", 1))
    assert [name for name, _ in inspection.verified(folder)] == ["arms/cura6"]
    with pytest.raises(ValueError, match=r"cura6\.xml: missing or damaged"):
        list(read(folder))
    generate_dataset(load_configuration(tiny_toml), folder, workers=1)
    assert contents(folder) == contents(tiny)


@pytest.mark.parametrize("gaps", [False, True])
@pytest.mark.parametrize("kind", [pa.float32(), pa.float64(), pa.int8(), pa.int32()])
def test_a_column_is_what_pyarrow_makes_of_its_values(kind, gaps):
    values = np.arange(21).astype(kind.to_pandas_dtype())
    if pa.types.is_floating(kind):
        values[[0, 7, 8, 20]] = np.nan
    made = columns_of_shards._column(values[::-1], kind, gaps)
    made.validate(full=True)
    expected = pa.array(values[::-1].copy(), kind, from_pandas=gaps)
    assert made.null_count == expected.null_count
    assert made.is_null(nan_is_null=True).equals(expected.is_null(nan_is_null=True))
    assert made.drop_null().to_numpy().tobytes() == expected.drop_null().to_numpy().tobytes()


def test_generating_leaves_libraries_unloaded_that_cost_more_than_an_episode(tiny_toml, tmp_path):
    code = (
        "import sys; from pathlib import Path\n"
        "from tauguard.datasets.configuration import load_configuration\n"
        "from tauguard.datasets.generation import generate_dataset\n"
        f"tiny = load_configuration({str(tiny_toml)!r})\n"
        f"generate_dataset(tiny, Path({str(tmp_path / 'made')!r}), workers=1)\n"
        "print([m for m in ('sklearn', 'pandas', 'scipy', 'rerun') if m in sys.modules])"
    )
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout.splitlines()[-1] == "[]"
