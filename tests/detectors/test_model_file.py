"""The container of model files: what is in it, and what is refused by name."""

import dataclasses
import io
import json
import sys
import types
import zipfile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tauguard.detectors import (
    DETECTORS,
    ArmModel,
    CollisionAlarm,
    codec,
    load_model,
    model_archive,
    registry,
    save_model,
)
from tauguard.detectors import model_file as files
from tauguard.detectors.alarms.training import train
from tauguard.detectors.registry import make_detector
from tauguard.findings import ArgumentError, ModelFileError
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


def test_the_file_says_what_it_is_and_was_made_with_and_holds_nothing_but_json_and_arrays(
    alarm, tmp_path
):
    path = tmp_path / "model.tauguard"
    save_model(alarm, path)
    assert [p.name for p in tmp_path.iterdir()] == ["model.tauguard"]
    with zipfile.ZipFile(path) as archive:
        head, *others = archive.namelist()
        container = json.loads(archive.read(head))
        arrays = {n: np.load(io.BytesIO(archive.read(n)), allow_pickle=False) for n in others}
        assert {entry.date_time[0] for entry in archive.infolist()} == {1980}
    assert (container["format"], container["kind"]) == ("tauguard model", "collision-alarm")
    assert container["version"] == files.VERSION
    assert set(container["made_with"]) == {"tauguard", "mujoco", "numpy", "scikit-learn"}
    assert container["arm"]["file"] == "cura6.xml"
    assert container["arm"]["joints"] == list(alarm.detector.arm.robot.joint_names)
    regressor = alarm.detector.regressor
    np.testing.assert_array_equal(
        arrays["arrays/detector.regressor.vectors.npy"], regressor.vectors
    )
    assert container["content"]["fields"]["threshold"] == alarm.threshold


def test_the_same_detector_gives_the_same_bytes_and_so_does_a_loaded_one(alarm, tmp_path):
    one, two = tmp_path / "one.tauguard", tmp_path / "two.tauguard"
    save_model(alarm, one)
    save_model(load_model(one), two)
    assert one.read_bytes() == two.read_bytes()


def test_a_module_of_another_is_built_only_if_it_was_named(small, named, tmp_path, unseen):
    path = tmp_path / "model.tauguard"
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
    whole, bad = tmp_path / "model.tauguard", tmp_path / "bad.tauguard"
    save_model(alarm, whole)
    data = whole.read_bytes()
    for content in (b"", data[:100], data[: len(data) // 2], data[:-30], b"hello", b"{}"):
        bad.write_bytes(content)
        with pytest.raises(ValueError, match=r"bad\.tauguard: not a model file") as error:
            load_model(bad)
        assert "\n" not in str(error.value)
    with pytest.raises(ValueError, match=r"none\.tauguard: cannot be read"):
        load_model(tmp_path / "none.tauguard")
    with pytest.raises(ValueError, match="cannot be written"):
        save_model(alarm, tmp_path / "no" / "model.tauguard")
    with pytest.raises(ValueError, match="threshold: inf cannot be stored"):
        save_model(dataclasses.replace(alarm, threshold=np.inf), bad)


@pytest.mark.parametrize(
    ("head", "says"),
    [
        ({"format": "another"}, "not a model file of tauguard; train the detector anew"),
        ({"version": 8}, "version 8 of the format, expected 9; train the detector anew"),
        ({"version": 10}, "version 10 of the format"),
        ({"kind": "robot"}, "of the kind 'robot', expected 'collision-alarm'"),
        ({"content": [1]}, "contains a list, not a detector"),
        ({"content": 1}, "contains a int, not a detector"),
    ],
)
def test_foreign_files_are_named(head, says, tmp_path):
    path = tmp_path / "model.tauguard"
    known = {"format": "tauguard model", "version": files.VERSION, "kind": "collision-alarm"}
    path.write_bytes(model_archive.packed(known | head, {}))
    with pytest.raises(ModelFileError, match=f"model.tauguard: .*{says}"):
        load_model(path)


def test_files_of_earlier_versions_say_how_to_train_anew(tmp_path):
    path = tmp_path / "model.skops"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("0.npy", b"")
        archive.writestr("schema.json", '{"__class__": "dict"}')
    with pytest.raises(ModelFileError, match="earlier format 'skops'; train the detector anew by"):
        load_model(path)
    path.write_text('{"format": "tauguard free-motion detector 1"}')
    with pytest.raises(ModelFileError, match="earlier format 'tauguard free-motion detector 1'"):
        load_model(path)


def rewritten(path, change, checked=True):
    """The file with its content changed, under a fitting checksum or the old one.

    ``change`` gets the fields of the detector, in which arrays stand in place of their names.
    """
    head, arrays, _ = model_archive.unpacked(path.read_bytes())
    content = filled(head["content"], arrays)
    change(content["fields"])
    changed = {}
    new = model_archive.packed(head | {"content": named_arrays(content, changed)}, changed)
    with zipfile.ZipFile(io.BytesIO(new)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    own = json.loads(members["model.json"]) | {"signature": head["signature"]}
    own["checksum"] = own["checksum"] if checked else head["checksum"]
    archive_of(path, *(members | {"model.json": json.dumps(own)}).items())


def filled(content, arrays):
    if isinstance(content, dict):
        if set(content) == {"array"}:
            return arrays[content["array"]]
        return {key: filled(value, arrays) for key, value in content.items()}
    return [filled(value, arrays) for value in content] if isinstance(content, list) else content


def named_arrays(content, arrays):
    if isinstance(content, np.ndarray):
        name = f"a{len(arrays)}"
        arrays[name] = content
        return {"array": name}
    if isinstance(content, dict):
        return {key: named_arrays(value, arrays) for key, value in content.items()}
    if isinstance(content, list):
        return [named_arrays(value, arrays) for value in content]
    return content


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda c: c.update(threshold=1e31), r"threshold: 1e\+31 cannot be stored"),
        (lambda c: c.update(confirmation=-1.0), "confirmation -1"),
        (lambda c: c.pop("normalisation"), "missing or additional fields: normalisation"),
        (lambda c: c["detector"].update({"class": "os:system"}), "holds a os:system"),
        (lambda c: c["detector"]["fields"]["front"]["fields"].update(dt=0.0), "dt 0.0"),
        (lambda c: c["detector"]["fields"]["regressor"]["fields"].update(sigma=0.0), "sigma: 0.0"),
        (lambda c: c["detector"]["fields"]["regressor"]["fields"]["weights"].fill(np.inf), "array"),
    ],
)
def test_contents_that_the_classes_refuse_are_named(alarm, change, says, tmp_path):
    path = tmp_path / "model.tauguard"
    save_model(alarm, path)
    rewritten(path, change)
    with pytest.raises(ValueError, match=f"model.tauguard: .*{says}"):
        load_model(path)


def test_a_change_under_the_old_checksum_is_noticed(alarm, tmp_path):
    path = tmp_path / "model.tauguard"
    save_model(alarm, path)
    rewritten(path, lambda c: c.update(threshold=1e9), checked=False)
    with pytest.raises(ValueError, match="does not fit its checksum"):
        load_model(path)


def archive_of(path, *members, method=zipfile.ZIP_STORED):
    with zipfile.ZipFile(path, "w", method) as archive:
        for name, data in members:
            archive.writestr(name, data)


def npy(array):
    data = io.BytesIO()
    np.save(data, array, allow_pickle=True)
    return data.getvalue()


def test_archives_that_do_not_hold_what_they_say_are_refused(tmp_path, monkeypatch):
    path, head = tmp_path / "model.tauguard", ("model.json", "{}")
    monkeypatch.setattr(model_archive, "LARGEST", 2**20)
    archive_of(path, head, ("arrays/zeros.npy", bytes(2**21)), method=zipfile.ZIP_DEFLATED)
    with pytest.raises(ModelFileError, match="unpacks to 2 MB"):
        load_model(path)
    header = io.BytesIO()
    huge = {"descr": "<f8", "fortran_order": False, "shape": (10**11,)}
    np.lib.format.write_array_header_1_0(header, huge)
    pickled = npy(np.array([object()], dtype=object))
    for member, says in (
        (
            ("arrays/a.npy", header.getvalue()),
            r"a.npy: declares float64 of shape \(100000000000,\)",
        ),
        (("arrays/a.npy", npy(np.zeros(3)) + b"more"), "a.npy: declares"),
        (("arrays/a.npy", pickled), "a.npy: declares object"),
        (("arrays/a.npy", npy(np.array(["text"]))), "a.npy: declares <U4"),
        (("arrays/../a.npy", npy(np.zeros(3))), "a part that no model file has: 'arrays/../a.npy'"),
        (("setup.py", "print(1)"), "a part that no model file has: 'setup.py'"),
    ):
        archive_of(path, head, member)
        with pytest.raises(ModelFileError, match=says):
            load_model(path)
    with pytest.warns(UserWarning, match="Duplicate name"):
        archive_of(path, head, head)
    with pytest.raises(ModelFileError, match="two parts of one name"):
        load_model(path)
    archive_of(path, ("model.json", "[" * 100_000))
    with pytest.raises(ModelFileError, match="not a model file, or a damaged one"):
        load_model(path)


def test_flipped_bytes_are_refused_or_change_nothing(small, named, tmp_path):
    make_detector("mypackage:CurrentSize")
    path, rng = tmp_path / "model.tauguard", np.random.default_rng(0)
    save_model(small, path)
    data, refused = path.read_bytes(), 0
    for at in rng.integers(len(data), size=80):
        path.write_bytes(data[:at] + bytes([data[at] ^ 1 << rng.integers(8)]) + data[at + 1 :])
        try:
            again = load_model(path)
        except ModelFileError:
            refused += 1
            continue
        save_model(again, path)
        assert path.read_bytes() == data
    assert refused > 60


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
    path = tmp_path / "model.tauguard"
    save_model(alarm, path)
    rewritten(path, EDITS[edit])
    with pytest.raises(ValueError, match=r"^[^\n]*model\.tauguard: [^\n]*$"):
        load_model(path)


def test_a_key_signs_and_nothing_else_is_read_with_it(small, named, tmp_path, monkeypatch):
    make_detector("mypackage:CurrentSize")
    unsigned, path, key = (
        tmp_path / name for name in ("unsigned.tauguard", "model.tauguard", "key")
    )
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


@dataclasses.dataclass(frozen=True)
class OwnFitted:
    """A fitted method with a field of any type."""

    arm: ArmModel
    dt: float
    x: object
    name: str = "own"
    settle: float = 0.0

    def scores(self, trace: Trace) -> np.ndarray:
        return np.abs(trace.current).max(axis=1)

    def stream(self):
        return types.SimpleNamespace(step=lambda q, qd, i, dt=None: abs(i).max())


@dataclasses.dataclass(frozen=True)
class Own:
    """A method with a field of any type."""

    x: object
    name: str = "own"

    def fit(self, traces, arm):
        return OwnFitted(arm, traces[0].dt, self.x)


@pytest.fixture
def own_module(named, monkeypatch):
    for kind in (OwnFitted, Own):
        monkeypatch.setattr(kind, "__module__", "mypackage")
        setattr(sys.modules["mypackage"], kind.__name__, kind)
    registry.admit("mypackage")


def same(a, b):
    """Equal types and bits, throughout."""
    assert type(a) is type(b)
    if isinstance(a, np.ndarray | np.generic):
        assert (a.dtype.str, a.shape, a.tobytes()) == (b.dtype.str, b.shape, b.tobytes())
    elif isinstance(a, list | tuple):
        assert len(a) == len(b)
        for x, y in zip(a, b, strict=True):
            same(x, y)
    elif isinstance(a, dict):
        assert list(a) == list(b)
        same(list(a.values()), list(b.values()))
    else:
        assert (a, repr(a)) == (b, repr(b))


SMALLEST = 5e-324
KEPT = [
    *(1.5, -0.0, SMALLEST, 1e16, 2**80, True, None, "text \ud800", (), [], {}),
    *(np.float64(1.5), np.float32(0.1), np.float16(0.1), np.int64(-3), np.uint8(3), np.bool_(True)),
    *((np.float64(1),), [1, (2.0, [np.float64(-0.0)])], {"b": 1, "a": {"": (None,)}}),
    *(np.array(2.5), np.zeros((0, 3)), np.asfortranarray(np.arange(6.0).reshape(2, 3))),
    *(np.arange(3, dtype=">i4"), np.arange(12.0)[::3], np.array([True]), np.array([SMALLEST])),
]
CYCLE: list = []
CYCLE.append(CYCLE)
REFUSED = [
    *(float("inf"), -float("inf"), float("nan"), 1e31, 10**400, 1j, {1: 2}, {1, 2}, b"x", CYCLE),
    *(np.array([1.0, np.nan]), np.longdouble(1), np.array([1], dtype=np.longdouble), np.str_("a")),
    *(
        np.float64("nan"),
        np.array(["a"]),
        np.array([None]),
        np.ma.array([1.0]),
        np.datetime64(0, "s"),
    ),
    *(abs, object(), types.SimpleNamespace(a=1), [1, (float("inf"),)], {"a": np.complex64(1)}),
]


@pytest.mark.parametrize("x", KEPT, ids=repr)
def test_a_field_of_ones_own_detector_loads_with_the_same_bits(
    x, own_module, unseen, arm, tmp_path
):
    path = tmp_path / "own.tauguard"
    codec.check_storable(Own(x))
    save_model(CollisionAlarm(Own(x).fit(unseen, arm), 1.0), path)
    same(load_model(path).detector.x, x)


@pytest.mark.parametrize("x", REFUSED, ids=lambda x: type(x).__name__)
def test_a_field_that_no_file_can_keep_is_refused_before_training(x, unseen, arm, monkeypatch):
    monkeypatch.setattr(Own, "fit", lambda self, traces, arm: pytest.fail("it was trained"))
    with pytest.raises(ArgumentError, match=r"^Own\.x[.0-9]*( \.\.\.)?: "):
        train(Own(x), unseen, arm)


SCALARS = st.one_of(
    st.none(),
    st.booleans(),
    st.text(max_size=3),
    st.integers(-(10**30), 10**30),
    st.floats(-1e30, 1e30),
    st.floats(-1e30, 1e30).map(np.float64),
    st.floats(-(2.0**99), 2.0**99, width=32).map(np.float32),
    st.integers(-(2**63), 2**63 - 1).map(np.int64),
    arrays(np.float64, st.integers(0, 3), elements=st.floats(-1e30, 1e30)),
)
NESTED = st.recursive(
    SCALARS,
    lambda inner: st.one_of(
        st.lists(inner, max_size=3),
        st.lists(inner, max_size=3).map(tuple),
        st.dictionaries(st.text(max_size=3), inner, max_size=3),
    ),
    max_leaves=8,
)


@settings(max_examples=40)
@given(NESTED)
def test_nested_values_come_back_from_an_archive_with_the_same_bits(value):
    own: dict = {}
    content = codec.encode(value, own, "x")
    head, found, checksum = model_archive.unpacked(model_archive.packed({"c": content}, own))
    assert checksum == head["checksum"]
    same(codec.decode(head["c"], found, lambda name: pytest.fail(name)), value)


@pytest.mark.parametrize("name", DETECTORS)
def test_the_settings_of_every_method_can_be_kept(name):
    codec.check_storable(make_detector(name))


def test_what_would_not_load_is_refused_when_it_is_saved_and_the_older_file_stays(
    small, named, tmp_path
):
    path = tmp_path / "model.tauguard"
    path.write_text("older")

    @dataclasses.dataclass(frozen=True)
    class Local(FittedCurrent):
        pass

    nameless = Local(small.detector.arm, small.detector.dt, small.detector.scale)
    for alarm, says in (
        (dataclasses.replace(small, threshold=1e9), "raises no alarm at any impact"),
        (dataclasses.replace(small, threshold=-1.0), "alarm all the time"),
        (CollisionAlarm(nameless, 1.0), "at the top of a module"),
    ):
        with pytest.raises(ModelFileError, match=says):
            save_model(alarm, path)
    assert path.read_text() == "older"
    assert [p.name for p in tmp_path.iterdir()] == ["model.tauguard"]
