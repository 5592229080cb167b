"""The container of model files: what is in it, and what is refused by name."""

import dataclasses
import io
import subprocess
import sys
import types
import zipfile

import numpy as np
import pytest

from tauguard.detectors import ArmModel, CollisionAlarm, load_model, registry, save_model
from tauguard.detectors import model_file as files
from tauguard.detectors.registry import make_detector
from tauguard.traces import Trace


@dataclasses.dataclass(frozen=True, eq=False)
class FittedCurrent:
    """Another's fitted method: the largest current over a scale."""

    arm: ArmModel
    dt: float
    scale: np.ndarray
    name: str = "current-size"
    settle: float = 0.0

    def scores(self, trace: Trace) -> np.ndarray:
        return (np.abs(trace.current) / self.scale).max(axis=1)

    def stream(self):
        return types.SimpleNamespace(step=lambda q, qd, i, dt=None: (abs(i) / self.scale).max())


@dataclasses.dataclass(frozen=True)
class CurrentSize:
    """Another's method."""

    name: str = "current-size"

    def fit(self, traces, arm):
        peak = np.max([np.abs(t.current).max(axis=0) for t in traces], axis=0)
        return FittedCurrent(arm, traces[0].dt, peak)


@pytest.fixture(scope="module")
def small(arm, unseen):
    return CollisionAlarm(CurrentSize().fit(unseen[:1], arm), 1.0)


@pytest.fixture
def named(monkeypatch):
    """This module under a name that a user could give and that no test has named before."""
    monkeypatch.setattr(registry, "_NAMED", set())
    module = types.ModuleType("mypackage")
    for kind in (FittedCurrent, CurrentSize):
        monkeypatch.setattr(kind, "__module__", "mypackage")
        setattr(module, kind.__name__, kind)
    monkeypatch.setitem(sys.modules, "mypackage", module)


def test_the_file_says_what_it_is_and_was_made_with_and_holds_nothing_to_trust(alarm, tmp_path):
    import skops.io  # here: it looks through every loaded module for a second

    path = tmp_path / "model.skops"
    save_model(alarm, path)
    assert skops.io.get_untrusted_types(file=path) == []
    assert [p.name for p in tmp_path.iterdir()] == ["model.skops"]
    container = skops.io.load(path)
    assert (container["format"], container["kind"], container["version"]) == (
        "tauguard model",
        "collision-alarm",
        8,
    )
    assert set(container["made_with"]) == {"tauguard", "mujoco", "numpy", "scikit-learn"}


def test_skops_reads_what_is_written_without_it(tmp_path):
    import skops.io

    value = {"a": np.arange(6.0).reshape(2, 3), "b": [1, 2.5e-300, None, True, "x"], "c": {}}
    found = skops.io.loads(files._archive(value | {"d": np.array([True, False])}), trusted=[])
    np.testing.assert_array_equal(found.pop("a"), value.pop("a"))
    np.testing.assert_array_equal(found.pop("d"), [True, False])
    assert found == value
    path = tmp_path / "model.skops"
    code = "import sys; from tauguard.detectors.model_file import write_model as write; "
    code += f"write({str(path)!r}, 'numbers', (1, 2)); assert 'skops' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
    assert skops.io.load(path)["content"] == {"tuple": [1, 2]}


def test_a_module_of_another_is_built_only_if_it_was_named(small, named, tmp_path, unseen):
    path = tmp_path / "model.skops"
    save_model(small, path)
    with pytest.raises(ValueError, match=r"FittedCurrent.*TAUGUARD_DETECTORS=mypackage"):
        load_model(path)
    assert make_detector("mypackage:CurrentSize").name == "current-size"
    again = load_model(path)
    assert again.detect(unseen[0]).score.tobytes() == small.detect(unseen[0]).score.tobytes()
    for name, says in (
        ("nothing:Here", "cannot be imported"),
        ("mypackage:None_", "mypackage has no None_"),
        ("json:JSONDecoder", "expected a class with `name` and `fit"),
    ):
        with pytest.raises(ValueError, match=says):
            make_detector(name)


def test_damaged_files_are_one_line(alarm, tmp_path):
    whole, bad = tmp_path / "model.skops", tmp_path / "bad.skops"
    save_model(alarm, whole)
    data = whole.read_bytes()
    for content in (b"", data[:100], data[: len(data) // 2], data[:-30], b"hello", b"{}"):
        bad.write_bytes(content)
        with pytest.raises(ValueError, match=r"bad\.skops: not a model file") as error:
            load_model(bad)
        assert "\n" not in str(error.value)
    with pytest.raises(ValueError, match=r"none\.skops: cannot be read"):
        load_model(tmp_path / "none.skops")
    with pytest.raises(ValueError, match="cannot be written"):
        save_model(alarm, tmp_path / "no" / "model.skops")
    with pytest.raises(ValueError, match="threshold inf"):
        save_model(dataclasses.replace(alarm, threshold=np.inf), bad)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ({"a": 1}, "not a model file of tauguard; train the detector anew"),
        ([1], "not a model file of tauguard"),
        ({"format": "tauguard detector 1"}, "earlier format 'tauguard detector 1'; train"),
        ({"format": "tauguard ranking detector 2"}, "earlier format"),
        ({"format": "tauguard model", "version": 9}, "version 9 of the format, expected 8"),
        (
            {"format": "tauguard model", "version": 7},
            "version 7 .*expected 8; train the detector anew",
        ),
        ({"format": "tauguard model", "version": 1}, "version 1 of the format, .* train the"),
        (
            {"format": "tauguard model", "version": files.VERSION, "kind": "robot"},
            "of the kind 'robot'",
        ),
    ],
)
def test_foreign_and_earlier_files_are_named(content, says, tmp_path):
    import skops.io

    path = tmp_path / "model.skops"
    skops.io.dump(content, path)
    with pytest.raises(ValueError, match=says):
        load_model(path)
    path.write_text('{"format": "tauguard free-motion detector 1"}')
    with pytest.raises(ValueError, match="earlier format 'tauguard free-motion detector 1'"):
        load_model(path)


def rewritten(path, change, checked=True):
    """The file with its content changed, under a fitting checksum or the old one."""
    import skops.io

    container = skops.io.load(path)
    change(container["content"]["fields"])
    if checked:
        container["checksum"] = files.checksum(container["content"])
    skops.io.dump(container, path)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda c: c.update(threshold=float("nan")), "unexpected nan"),
        (lambda c: c.update(confirmation=-1.0), "confirmation -1"),
        (lambda c: c.pop("normalisation"), "missing or additional fields: normalisation"),
        (lambda c: c["detector"].update(type="os:system"), "holds a os:system"),
        (lambda c: c["detector"]["fields"]["front"]["fields"].update(dt=0.0), "dt 0.0"),
        (lambda c: c["detector"]["fields"]["regressor"]["fields"].update(sigma=0.0), "sigma: 0.0"),
        (lambda c: c["detector"]["fields"]["regressor"]["fields"]["weights"].fill(np.inf), "array"),
    ],
)
def test_contents_that_the_classes_refuse_are_named(alarm, change, says, tmp_path):
    path = tmp_path / "model.skops"
    save_model(alarm, path)
    rewritten(path, change)
    with pytest.raises(ValueError, match=f"model.skops: .*{says}"):
        load_model(path)


def test_a_change_under_the_old_checksum_is_noticed(alarm, tmp_path):
    path = tmp_path / "model.skops"
    save_model(alarm, path)
    rewritten(path, lambda c: c.update(threshold=1e9), checked=False)
    with pytest.raises(ValueError, match="does not fit its checksum"):
        load_model(path)


def test_archives_that_unpack_to_too_much_are_refused(tmp_path, monkeypatch):
    path = tmp_path / "model.skops"
    monkeypatch.setattr(files, "LARGEST", 2**20)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("zeros", bytes(2**21))
    with pytest.raises(ValueError, match="unpacks to 2 MB"):
        load_model(path)
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        header, {"descr": "<f8", "fortran_order": False, "shape": (10**11,)}
    )
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a.npy", header.getvalue())
    with pytest.raises(ValueError, match="declares a shape"):
        load_model(path)


def of(*names):
    """A change of one number deep in a file: the names on the way, then what becomes of it."""
    *way, change = names

    def changed(content):
        *outer, last = way
        for name in outer:
            content = content[name]["fields"]
        content[last] = change(content[last])

    return changed


MACHINE, FRONT = ("detector", "regressor"), ("detector", "front")
EDITS = {
    "weights to nothing": of(*MACHINE, "weights", lambda w: w * 0),
    "weights tiny": of(*MACHINE, "weights", lambda w: w * 1e-9),
    "weights huge": of(*MACHINE, "weights", lambda w: w * 1e300),
    "intercept low": of(*MACHINE, "intercept", lambda v: v - 1e3),
    "intercept high": of(*MACHINE, "intercept", lambda v: v + 1e3),
    "sigma tiny": of(*MACHINE, "sigma", lambda v: 1e-150),
    "sigma huge": of(*MACHINE, "sigma", lambda v: 1e150),
    "vectors far away": of(*MACHINE, "vectors", lambda v: v + 1e6),
    "threshold high": of("threshold", lambda v: 1e9),
    "threshold low": of("threshold", lambda v: -1e9),
    "confirmation of hours": of("confirmation", lambda v: 1e4),
    "factor tiny": of("detector", "scaling", "factor", lambda v: 1e-12),
    "observer that sleeps": of(*FRONT, "gain", lambda v: 1e-9),
    "settles in a year": of(*FRONT, "settle", lambda v: 3e7),
    "samples every nanosecond": of(*FRONT, "dt", lambda v: 1e-9),
    "gains tiny": of(*FRONT, "arm", "drive_gain", lambda v: v * 1e-9),
    "masses huge": of(*FRONT, "arm", "robot", "inertial", lambda v: v * 1e30),
    "gravity huge": of(*FRONT, "arm", "robot", "gravity", lambda v: v * 1e9),
}


@pytest.mark.parametrize("edit", EDITS)
def test_edits_under_a_fitting_checksum_that_blind_or_deafen_it_are_refused(edit, alarm, tmp_path):
    path = tmp_path / "model.skops"
    save_model(alarm, path)
    rewritten(path, EDITS[edit])
    with pytest.raises(ValueError, match=r"^[^\n]*model\.skops: [^\n]*$"):
        load_model(path)


def test_a_key_signs_and_nothing_else_is_read_with_it(small, named, tmp_path, monkeypatch):
    make_detector("mypackage:CurrentSize")
    unsigned, path, key = (tmp_path / name for name in ("unsigned.skops", "model.skops", "key"))
    save_model(small, unsigned)
    key.write_bytes(b"sixteen bytes or more")
    monkeypatch.setenv("TAUGUARD_MODEL_KEY", str(key))
    save_model(small, path)
    assert load_model(path).threshold == small.threshold
    with pytest.raises(ValueError, match="not signed, and a key is set"):
        load_model(unsigned)
    rewritten(path, lambda c: c.update(threshold=1.01))
    with pytest.raises(ValueError, match="signed with another key, or changed since"):
        load_model(path)
    key.write_bytes(b"another key of bytes")
    save_model(small, unsigned)
    key.write_bytes(b"short")
    with pytest.raises(ValueError, match="a key of 5 bytes, expected 16 or more"):
        load_model(unsigned)
    monkeypatch.delenv("TAUGUARD_MODEL_KEY")
    assert load_model(unsigned).threshold == small.threshold  # without a key nothing is asked
