"""Files of cached results: what they hold comes back, and files of somebody else do no harm."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
#: Writes a result and reads it in another process, which loads the class's module alone.
RESULT = """
import math, sys
from pathlib import Path
import numpy as np
from kept import Kept
from studies.framework import jobs
value = {("a", 1): [1.5, None, True, math.inf, "\u00e9"], 2.0: np.float64(0.1), "empty": ()}
result = [value, Kept(np.asfortranarray(np.arange(6.0).reshape(2, 3)), (1, [jobs.JobCache(None)]))]
path = Path("r.npz")
if sys.argv[1:] == ["write"]:
    path.write_bytes(jobs._data([*result, result[1]]))
else:
    back, kept, same = jobs.read(path)
    assert back == value and type(back[2.0]) is np.float64 and kept is same
    assert (kept.array == result[1].array).all() and kept.array.flags.f_contiguous
    assert kept.more == result[1].more
    assert "sklearn" not in {name.partition(".")[0] for name in sys.modules}
"""
#: Reads a file of somebody else and prints the refusal.
REFUSED = """
import sys
from pathlib import Path
from studies.framework import jobs
for name in sys.argv[1:]:
    try:
        jobs.read(Path(name))
    except ValueError as error:
        print(error)
assert "this" not in sys.modules and "tauguard.cli.demo" not in sys.modules
"""


def ran(code, folder, *args):
    """What ``code`` prints; the user has named the module ``kept`` of this folder."""
    paths = os.pathsep.join([str(ROOT), str(folder)])
    done = subprocess.run(
        [sys.executable, "-c", code, *args],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": paths, "TAUGUARD_DETECTORS": "kept"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_cached_result_is_data_and_comes_back_the_same(tmp_path):
    (tmp_path / "kept.py").write_text(
        "import dataclasses\n@dataclasses.dataclass(frozen=True)\nclass Kept:\n"
        "    array: object\n    more: object\n"
    )
    ran(RESULT, tmp_path, "write")
    ran(RESULT, tmp_path)


def test_a_cached_file_of_somebody_else_is_refused_by_its_name(tmp_path):
    """No file can run code, import a module, crash the process or unpack to more than its size."""

    def foreign(*objects):
        text = json.dumps([[len(objects) - 1], objects]).encode()
        return {"objects": np.frombuffer(text, np.uint8)}

    call = b"cos\nsystem\n(S'touch ran'\ntR."
    # An array of objects whose bytes are an address: reading it crashes a process.
    pointer = (
        b"cnumpy._core.numeric\n_frombuffer\n(C\x08AAAAAAAAcnumpy\ndtype\n(S'O8'\nI00\nI01\ntR"
        b"(I3\nS'|'\nNNNI-1\nI-1\nI0\ntb(I1\ntS'C'\ntR."
    )
    files = {"call.npz": call, "pointer.npz": pointer, "empty.npz": b""}
    arrays = {
        "objects.npz": {"objects": np.array([{}], object)},
        "function.npz": foreign(["os:system", {"command": "touch ran"}]),
        "module.npz": foreign(["this:s", {}]),
        "unloaded.npz": foreign(["tauguard.cli.demo:command", {}]),
        "no_class.npz": foreign(["studies.framework.jobs:build", {}]),
        "other.npz": foreign(["pathlib:Path", {}]),
        "later.npz": foreign(["list", [[1]]], ["list", []]),
        "fields.npz": foreign(["studies.framework.jobs:JobCache", {"path": "a"}]),
        "inside.npz": foreign(["array", None]) | {"0": np.array([{}], object)},
    }
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)
    for name, own in arrays.items():
        np.savez(tmp_path / name, **own)
    np.savez_compressed(tmp_path / "packed.npz", **foreign(["list", []]))
    whole = (tmp_path / "fields.npz").read_bytes()
    (tmp_path / "short.npz").write_bytes(whole[: len(whole) // 2])
    names = [*files, *arrays, "packed.npz", "short.npz"]
    said = ran(REFUSED, tmp_path, *names)
    assert not (tmp_path / "ran").exists()
    for name in names:
        assert f"{name}: damaged, or of other code: delete it" in said, name
