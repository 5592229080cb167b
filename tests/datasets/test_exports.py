"""Exports and descriptions, read by the libraries they are for."""

import json
import sys
import types
import warnings

import numpy as np
import pyarrow.parquet as pq
import pytest

from tauguard.datasets.card import shards
from tauguard.datasets.configuration import load_configuration
from tauguard.datasets.dataset_folder import CARD, CROISSANT, lines
from tauguard.datasets.exports.lerobot import combined, moments, write_lerobot
from tauguard.datasets.exports.minari import write_minari
from tauguard.datasets.reader import read
from tauguard.datasets.shard import digest


def test_lerobot_layout_and_statistics(tiny, tmp_path):
    # LeRobot itself cannot be installed beside tauguard: what its loader asks for is checked here.
    traces = list(read(tiny))
    assert write_lerobot(traces, tmp_path / "out", 500, "cura6") == 5
    info = json.loads((tmp_path / "out/meta/info.json").read_text())
    assert info["codebase_version"] == "v3.0"
    assert info["total_frames"] == sum(len(t.t) for t in traces)
    data = pq.read_table(tmp_path / "out/data/chunk-000/file-000.parquet")
    assert set(data.column_names) == set(info["features"])
    np.testing.assert_array_equal(data["index"].to_numpy(), np.arange(info["total_frames"]))
    episodes = pq.read_table(tmp_path / "out/meta/episodes/chunk-000/file-000.parquet").to_pylist()
    state = np.stack(data["observation.state"].to_numpy())
    for line, trace in zip(episodes, traces, strict=True):
        rows = slice(line["dataset_from_index"], line["dataset_to_index"])
        np.testing.assert_allclose(state[rows, :6], trace.q, atol=1e-6)
    stats = json.loads((tmp_path / "out/meta/stats.json").read_text())["observation.state"]
    np.testing.assert_allclose(stats["mean"], state.mean(axis=0, dtype=float), atol=1e-5)
    np.testing.assert_allclose(stats["std"], state.std(axis=0, dtype=float), atol=1e-5)
    pandas = pytest.importorskip("pandas")
    tasks = pandas.read_parquet(tmp_path / "out/meta/tasks.parquet")
    assert tasks["task_index"].tolist() == [0]
    assert isinstance(tasks.index[0], str)
    with pytest.raises(ValueError, match="not empty"):
        write_lerobot(traces, tmp_path / "out", 500, "cura6")


def test_moments_of_parts_are_those_of_the_whole():
    values = np.random.default_rng(3).normal(5, 2, (1000, 3))
    parts = combined([moments(values[a:b]) for a, b in ((0, 10), (10, 700), (700, 1000))])
    for name in ("min", "max", "mean", "std"):
        np.testing.assert_allclose(parts[name], getattr(values, name)(axis=0), rtol=1e-12)
    assert parts["count"] == 1000


def test_minari_reads_what_was_written(tiny, tmp_path, monkeypatch):
    minari = pytest.importorskip("minari")
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    traces = list(read(tiny, ["test"]))
    assert write_minari(traces, "tauguard/tiny-v0", 500) == 2
    dataset = minari.load_dataset("tauguard/tiny-v0")
    for episode, trace in zip(dataset.iterate_episodes(), traces, strict=True):
        np.testing.assert_allclose(episode.observations[:, :6], trace.q, atol=1e-6)
        np.testing.assert_allclose(episode.infos["tau_ext"], trace.truth.tau_ext, rtol=1e-6)
    with pytest.raises(ValueError, match="has a dataset of that name"):
        write_minari(traces, "tauguard/tiny-v0", 500)


def test_of_minari_s_warnings_only_what_is_not_given_is_hidden(tiny, monkeypatch):
    def create(*_, **__):
        for text in (
            "`author_email` is set to None. For longevity",
            "`eval_env` is set to None. If another",
            "env_spec is None, no environment",
            "the disk is nearly full",
        ):
            warnings.warn(text, UserWarning, stacklevel=2)
        return types.SimpleNamespace(update_dataset_from_buffer=lambda _: None)

    fake = types.ModuleType("minari")
    fake.list_local_datasets, fake.create_dataset_from_buffers = dict, create
    collector = types.ModuleType("minari.data_collector")
    collector.EpisodeBuffer = types.SimpleNamespace
    monkeypatch.setitem(sys.modules, "minari", fake)
    monkeypatch.setitem(sys.modules, "minari.data_collector", collector)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        assert write_minari(read(tiny, ["test"]), "tauguard/tiny-v0", 500) == 2
    assert [str(one.message) for one in told] == ["the disk is nearly full"]


def test_an_export_without_its_extra_says_which(tiny, monkeypatch):
    monkeypatch.setitem(sys.modules, "minari", None)
    with pytest.raises(ValueError, match="extra `export`"):
        write_minari(read(tiny), "tauguard/tiny-v0", 500)


def test_a_cluster_without_its_extra_says_which(monkeypatch):
    from tauguard.datasets.cluster import on_cluster

    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(ValueError, match="extra `distributed`"):
        next(on_cluster(len, [()], "local"))


def test_the_card_and_croissant_name_every_file_and_column(tiny):
    croissant = json.loads((tiny / CROISSANT).read_text())
    files = {f["contentUrl"]: f["sha256"] for f in croissant["distribution"] if "sha256" in f}
    assert files == {line["shard"]: digest(tiny / line["shard"]) for line in lines(tiny)}
    columns = pq.read_schema(tiny / "data/train-000000.parquet").names
    for records in croissant["recordSet"]:
        assert [field["name"] for field in records["field"]] == columns
    card = (tiny / CARD).read_text()
    assert card.startswith("---\nlicense: ")
    assert f"path: {shards('train')}" in card


def test_the_pattern_of_a_split_has_no_file_of_another(tmp_path):
    """The splits of the shipped benchmark, some of whose names begin as others do."""
    (tmp_path / "data").mkdir()
    names = [split.name for split in load_configuration("tauguard-collisions-v2").splits]
    own = {n: {f"{n}-000000.parquet", f"{n}-000012.parquet"} for n in names}
    for name in {file for files in own.values() for file in files}:
        (tmp_path / "data" / name).touch()
    assert {"test", "test-arm"} <= set(names)
    assert {n: {p.name for p in tmp_path.glob(shards(n))} for n in names} == own
