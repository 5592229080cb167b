"""``inspect --verify`` sees a flipped bit in every file of a dataset."""

import os
import shutil

import numpy as np
import pytest

from tauguard.cli import main
from tauguard.datasets import inspection
from tauguard.datasets.configuration import load_configuration
from tauguard.datasets.dataset_folder import SUMS
from tauguard.datasets.generation import generate_dataset

from .conftest import contents

FILES = {
    "dataset.json",
    "README.md",
    "croissant.json",
    SUMS,
    "arms/cura6.xml",
    "arms/cura6-small.xml",
    *(f"manifest/{name}-00000{k}.jsonl" for name, k in (("train", 0), ("train", 1), ("test", 0))),
    *(f"data/{name}-00000{k}.parquet" for name, k in (("train", 0), ("train", 1), ("test", 0))),
}


@pytest.fixture
def copy(tiny, tmp_path):
    return shutil.copytree(tiny, tmp_path / "copy")


def seen(folder):
    """What verification says, an error included."""
    try:
        return [name for name, _ in inspection.verified(folder)]
    except ValueError as error:
        return [str(error)]


def test_these_are_all_files(tiny):
    assert set(contents(tiny)) == FILES
    assert inspection.verified(tiny) == inspection.unchecked(tiny) == []


@pytest.mark.parametrize("name", sorted(FILES))
def test_a_flipped_bit_is_seen_in_every_file(copy, name):
    path = copy / name
    data = path.read_bytes()
    rng = np.random.default_rng(len(name))
    text = not name.startswith("data")
    # Line ends and blanks are where a lenient reader forgives; then bits from everywhere.
    ends = [k for k in range(len(data)) if data[k] in b"\r\n \t"] if text else []
    some = ends[-3:] + [int(k) for k in rng.permutation(ends)[:5]]
    bits = [8 * k + bit for k in some for bit in range(8)]
    bits += [int(b) for b in rng.integers(0, 8 * len(data), 60)] + [0, 8 * len(data) - 1]
    missed = []
    for bit in bits:
        damaged = bytearray(data)
        damaged[bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)
        if not seen(copy):
            missed.append(bit)
    assert not missed


@pytest.mark.parametrize("name", sorted(FILES))
def test_the_command_says_so_with_exit_code_2_and_generating_mends_it(
    copy, tiny, tiny_toml, capsys, name
):
    path = copy / name
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 4
    path.write_bytes(data)
    with pytest.raises(SystemExit) as stop:
        main(["inspect", str(copy), "--verify"])
    assert stop.value.code == 2
    said = capsys.readouterr()
    number = path.name.removesuffix(".jsonl") if "manifest" in name else path.stem
    assert number in said.out + said.err or path.name in said.out + said.err
    if name != "dataset.json":  # which says what the folder is
        generate_dataset(load_configuration(tiny_toml), copy, workers=1)
        assert contents(copy) == contents(tiny)


def test_a_dataset_of_an_earlier_version_says_what_is_not_checked(copy, tiny, tiny_toml, capsys):
    (copy / SUMS).unlink()
    main(["inspect", str(copy), "--verify"])
    out = capsys.readouterr().out
    for name in ("dataset.json", "README.md", "croissant.json"):
        assert f"{name}: not checked" in out
    assert "every file is intact" not in out
    generate_dataset(load_configuration(tiny_toml), copy, workers=1)
    assert contents(copy) == contents(tiny)


def test_sha256sum_reads_the_checksums(tiny):
    import hashlib

    for line in (tiny / SUMS).read_text().splitlines():
        digest, name = line.split("  ")
        assert hashlib.sha256((tiny / name).read_bytes()).hexdigest() == digest


@pytest.mark.parametrize(
    "name", ["data/train-000002.parquet", "manifest/x.jsonl", "data/old/a", "arms/ur5.xml"]
)
def test_a_file_among_the_shards_that_is_none_is_named(copy, capsys, name):
    (copy / name).parent.mkdir(exist_ok=True)
    (copy / name).write_bytes((copy / "data/train-000000.parquet").read_bytes())
    (copy / "notes.txt").write_text("a user's own")
    with pytest.raises(SystemExit) as stop:
        main(["inspect", str(copy), "--verify"])
    assert stop.value.code == 2
    top = "/".join(name.split("/")[:2])
    assert f"DAMAGED: {top}: no file of this dataset" in capsys.readouterr().out


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes")
def test_a_pipe_in_the_place_of_an_arm_blocks_nothing(copy):
    (copy / "arms/cura6.xml").unlink()
    os.mkfifo(copy / "arms/cura6.xml")
    assert any("missing or damaged" in said for _, said in inspection.verified(copy))
