"""Every command answers damaged input with an answer or one line and exit code 2."""

import json
import shutil

import numpy as np
import pytest

from slow.damaged import damage
from tauguard.cli import main
from tauguard.datasets.configuration import load_configuration
from tauguard.datasets.generation import generate_dataset
from tauguard.replay import write_rrd
from tauguard.traces import read_mcap, write_mcap
from tests.detectors.synthetic_arm import GAIN, XML, record

COLUMNS = {"t": 0, "q": [1, 2, 3], "qd": [4, 5, 6], "current": [7, 8, 9]}
TINY = """
name = "tiny"
seed = 7
rate = 250
episodes_per_shard = 1
[episodes]
seconds = 6.6
arms = ["cura6"]
speeds = [50]
payloads_g = [0]
[[splits]]
name = "train"
episodes = 2
individuals = [0]
[[splits]]
name = "test"
episodes = 1
individuals = [10]
"""


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("simulate --out new --speeds", "expected at least one number after each"),
        ("simulate --out new --payloads-g", "expected at least one number after each"),
        ("simulate --out new --workers 0", "--workers 0: expected 1 or more"),
        ("simulate --out new --mismatch-seed -3", "--mismatch-seed -3: expected 0 or more"),
        ("simulate --out new --arm-joints a,b", "leave `joints` out"),
        ("simulate --out new --collisions 0 --seconds 1e-9", "expected two steps"),
        ("simulate --out new --payloads-g 1e12", "expected 0 to 1,000,000 grams"),
        ("watch Reach-v0 --set table=1", "table 1: expected a tauguard.models.Table or None"),
        ("simulate --out log.csv --episodes 1", "expected a folder, or a new name"),
        ("train --traces new --model .", "--model .: is a folder"),
        ("train --traces new --detector os:path", "cannot be made without arguments"),
        ("robot cura6 --try --episodes -1", "--episodes -1: expected 1 or more"),
        ("robot cura6 --try --seed -1", "--seed -1: expected 0 or more"),
        ("demo --out new --seed -1", "--seed -1: expected 0 or more"),
        ("watch Reach-v0 --seed -1", "--seed -1: expected 0 or more"),
        ("play-ur log.csv --columns auto --port 70000", "--port 70000: expected 0 to 65535"),
        ("play-ur log.csv --columns auto --fault frozen@90", "--fault frozen@ 90: expected 0 to 1"),
        ("replay new --web --port -1", "--port -1: expected 0 to 65535"),
        ("listen --stdin --model m --robot cura6 --seconds nan", "--seconds nan: expected 0"),
        ("listen --stdin --model m --robot cura6 --reconnect nan", "--reconnect nan: expected 0"),
        ("listen --ur h --model m --robot cura6 --port 99999", "--port 99999: expected 1 to"),
        ("video a.mcap --rate 0", "--rate 0: expected 1 to 1000"),
        ("video a.mcap --slower nan", "--slower nan: expected"),
        ("video a.mcap --seconds nan", "--seconds nan: expected 0 or more"),
        ("video a.mcap --out none/a.gif", "the folder none does not exist"),
        ("replay /dev/zero", "a device; expected a file"),
        ("detect /dev/zero --robot cura6", "a device; expected a file"),
        ("evaluate --traces new --model /dev/zero", "a device; expected a file"),
    ],
)
def test_a_number_or_file_that_no_command_can_use_is_named(
    tmp_path, monkeypatch, capsys, line, said
):
    monkeypatch.chdir(tmp_path)
    table = np.column_stack([np.linspace(0, 1, 501), *[np.zeros(501)] * 18])
    names = ["t", *(f"{what}_{i}" for what in ("q", "qd", "current") for i in range(1, 7))]
    np.savetxt("log.csv", table, delimiter=",", header=",".join(names), comments="")
    (tmp_path / "mcap").mkdir()
    assert run(line.split()[0], tmp_path / "mcap", *line.split()[1:]) == 2
    assert said in capsys.readouterr().err


@pytest.fixture(scope="module")
def intact(tmp_path_factory):
    """A folder with a small file of every kind that commands take."""
    folder = tmp_path_factory.mktemp("intact")
    (folder / "arm.xml").write_text(XML)
    (folder / "columns.json").write_text(json.dumps(COLUMNS))
    (folder / "tiny.toml").write_text(TINY)
    for seed in range(2):
        trace = record(seed)
        table = np.column_stack([trace.t, trace.q, trace.qd, trace.current])
        np.savetxt(folder / f"log{seed}.csv", table, delimiter=",", fmt="%.9g")
    generate_dataset(load_configuration(folder / "tiny.toml"), folder / "dataset", workers=1)
    free = ("--free", "log0.csv", "log1.csv", *FREE, *GAINS, "--model", "free.model")
    traces = ("--traces", "mcap", "--model", "a.model", "--detector", "residual-thresholds")
    struck = ("--out", "mcap", "--episodes", "3", "--collisions", "1", "--workers", "1")
    for command, flags in (("train", free), ("simulate", struck), ("train", traces)):
        assert run(command, folder, *flags) == 0
    for number, path in enumerate(sorted((folder / "mcap").glob("*.mcap"))):
        path.rename(path.with_name(f"{number}.mcap"))
    trace = read_mcap(folder / "mcap" / "0.mcap")
    detection = trace.detection
    short = folder / "short.mcap"
    write_mcap(short, trace, detection)
    write_rrd(folder / "short.rrd", trace, detection)
    return folder


#: Files and folders that commands make.
MADE = {"new", "new.model", "new.xml", "mcap", "free.model", "a.model"}
#: Without these a folder is another one, or not complete yet: no error.
OPTIONAL = ("mcap/1.mcap", "dataset/SHA256SUMS", "dataset/manifest/train-000000.jsonl")


def run(command, folder, *flags):
    """Run a command on the folder's files; its exit code."""
    there = {path.name for path in folder.iterdir()} | MADE
    arguments = [str(folder / flag) if flag in there else flag for flag in flags]
    try:
        main([command, *arguments])
    except SystemExit as stop:
        return stop.code or 0
    return 0


FREE = ("--robot", "arm.xml", "--columns", "columns.json")
GAINS = ("--gains", *(str(g) for g in GAIN))
#: Command, its flags, and the files of it that are damaged in turn.
COMMANDS = [
    ("detect", ("log1.csv", *FREE, "--model", "free.model"), ("log1.csv", "arm.xml", "free.model")),
    ("detect", ("log1.csv", *FREE, *GAINS), ("log1.csv", "arm.xml", "columns.json")),
    ("calibrate", ("log0.csv", "log1.csv", *FREE, *GAINS, "--out", "new.xml"),
     ("log1.csv", "arm.xml", "columns.json")),
    ("train", ("--free", "log0.csv", "log1.csv", *FREE, *GAINS, "--model", "new.model"),
     ("log0.csv", "arm.xml", "columns.json")),
    ("train", ("--traces", "mcap", "--detector", "residual-thresholds", "--model", "new.model"),
     ("mcap/1.mcap",)),
    ("train", ("--traces", "dataset", "--detector", "residual-thresholds", "--model", "new.model"),
     ("dataset/dataset.json", "dataset/data/train-000001.parquet",
      "dataset/manifest/train-000001.jsonl", "dataset/arms/cura6.xml")),
    ("evaluate", ("--traces", "mcap", "--model", "a.model"),
     ("mcap/1.mcap", "a.model")),
    ("evaluate", ("--data", "dataset", "--model", "a.model"),
     ("dataset/dataset.json", "dataset/data/test-000000.parquet", "a.model")),
    ("generate", ("tiny.toml", "--out", "new", "--quick", "--workers", "1"), ("tiny.toml",)),
    ("inspect", ("dataset", "--verify"), ("dataset/dataset.json", "dataset/README.md",
     "dataset/SHA256SUMS", "dataset/data/test-000000.parquet",
     "dataset/manifest/train-000000.jsonl", "dataset/arms/cura6.xml")),
    ("inspect", ("dataset",), ("dataset/dataset.json", "dataset/manifest/train-000000.jsonl")),
    ("inspect", ("dataset", "--episode", "train/0"),
     ("dataset/dataset.json", "dataset/data/train-000000.parquet",
      "dataset/manifest/train-000000.jsonl")),
    ("export", ("dataset", "--out", "new"),
     ("dataset/dataset.json", "dataset/data/train-000001.parquet", "dataset/arms/cura6.xml")),
    ("robot", ("arm.xml",), ("arm.xml",)),
    ("replay", ("short.mcap", "--out", "new"), ("short.mcap",)),
    ("replay", ("short.mcap", "--out", "new", "--robot", "arm.xml"), ("arm.xml",)),
    ("play-ur", ("log1.csv", "--columns", "columns.json", "--port", "0"),
     ("log1.csv", "columns.json")),
    ("listen", ("--play", "log1.csv", *FREE, "--model", "free.model", "--seconds", "0.1"),
     ("log1.csv", "arm.xml", "free.model", "columns.json")),
]  # fmt: skip
CASES = [(c, flags, name) for c, flags, names in COMMANDS for name in names]


def worst(data):
    """Damages that no reader may take for an answer."""
    yield b""
    yield data[: len(data) // 2]
    yield b"\x00\xff\xfe" * 400


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(("command", "flags", "name"), CASES, ids=[f"{c} {n}" for c, _, n in CASES])
def test_damaged_input_is_exit_code_2(intact, tmp_path, capsys, command, flags, name):
    folder = shutil.copytree(intact, tmp_path / "files")
    path = folder / name
    data = path.read_bytes()
    rng = np.random.default_rng(len(command) + len(name))
    for certain, damaged in (
        *((True, d) for d in worst(data)),
        *((False, damage(data, rng)) for _ in range(1)),
    ):
        path.write_bytes(damaged)
        for made in ("new", "new.model", "new.xml"):
            place = folder / made
            shutil.rmtree(place) if place.is_dir() else place.unlink(missing_ok=True)
        capsys.readouterr()
        code = run(command, folder, *flags)
        said = capsys.readouterr().err.splitlines()
        cut_table = name.endswith(".csv") and damaged and data.startswith(damaged)
        if certain and not cut_table:
            assert code == 2, damaged[:60]
        assert code in (0, 2), said
        lines = [line for line in said if line.startswith(f"tauguard {command}")]
        assert "Traceback" not in " ".join(said)
        assert not code or len(lines) == 1 or command == "inspect", said
    path.unlink()
    path.mkdir()
    assert run(command, folder, *flags) == 2 or "manifest" in name
    path.rmdir()
    assert run(command, folder, *flags) in ((0, 2) if name in OPTIONAL else (2,))
