"""Model files: a trained detector with its threshold, its robot and the versions of libraries.

The content is JSON and arrays (:mod:`.model_archive`, :mod:`.codec`), never code. A class is built
only if it is one of tauguard or of a module that the user has named. A checksum detects damage, and
the classes check the ranges of their numbers.
"""

from __future__ import annotations

import hmac
import importlib
import importlib.metadata
import json
import os
import zipfile
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from tauguard.atomic_write import write_atomic
from tauguard.detectors import model_archive
from tauguard.detectors.alarms.alarm import CollisionAlarm
from tauguard.detectors.alarms.self_check import check_alarms, check_ranges
from tauguard.detectors.codec import Arrays, decode, encode, type_name
from tauguard.detectors.registry import FILE_TYPES, file_type
from tauguard.findings import ModelFileError
from tauguard.models.stored_robot import StoredRobot
from tauguard.untrusted_input import check_no_device

#: Environment variable with the path of the key file, whose bytes are the key. A signature detects
#: manipulation; a checksum does not.
KEY_FILE = "TAUGUARD_MODEL_KEY"
#: Least length of a key [bytes].
SHORTEST = 16


def key_of_user() -> bytes | None:
    """The key in the file that the environment variable ``TAUGUARD_MODEL_KEY`` names.

    Raises:
        ModelFileError: the file cannot be read, or is shorter than 16 bytes.
    """
    path = os.environ.get(KEY_FILE)
    if not path:
        return None
    try:
        key = Path(path).read_bytes()
    except OSError as error:
        raise ModelFileError(f"{path}: the key cannot be read ({error.strerror})") from None
    if len(key) < SHORTEST:
        raise ModelFileError(f"{path}: a key of {len(key)} bytes, expected {SHORTEST} or more")
    return key


def check_signature(checksum: str, signature: object, key: bytes) -> None:
    """Refuse a content that was not signed with this key.

    Raises:
        ModelFileError: no signature, or one with another key.
    """
    if not isinstance(signature, str):
        raise ModelFileError("not signed, and a key is set: sign it by writing it with the key")
    if not hmac.compare_digest(model_archive.signature(checksum, key), signature):
        raise ModelFileError("signed with another key, or changed since")


#: The version also changes if a detector computes other scores from the same content, because a
#: threshold then has another meaning. Changes by version:
#: 2: the filter of `Unknowns.for_detection`. 3: scores of regressors are severities. 4: the filter
#: learns less of a held contact. 5: the noise grows with inertia, payload and changes of friction.
#: 6: and with changes of torque in slow logs; a change of friction counts once. 7: the bound in
#: free motion grows beyond the speeds and accelerations of the logs; srq-svr has the thresholds of
#: moving-thresholds. 8: the shape of a window has no note. 9: an archive of JSON and arrays, with
#: the robot in it.
FORMAT, VERSION = "tauguard model", 9
#: The kind of a file with a trained detector and its threshold.
ALARM = "collision-alarm"
#: Ending of the files' names.
SUFFIX = ".tauguard"
#: Packages whose versions are written into a file.
MADE_WITH = ("tauguard", "mujoco", "numpy", "scikit-learn")
#: Advice for a file of another format or version.
ANEW = "train the detector anew by `tauguard train`"


def save_model(
    alarm: CollisionAlarm, path: str | os.PathLike[str], robot: str | Path | None = None
) -> None:
    """Write a fitted detector with its threshold; after an error, ``path`` is unchanged.

    The bytes depend on the content alone. They are read again, as :func:`load_model` does it,
    before they replace a file. The file is signed if the user has a key, see :func:`key_of_user`.

    Args:
        alarm: the detector.
        path: where to write.
        robot: file or name of its robot, which is stored with the surface of its links, so that no
            other file is needed for detection and diagnosis (default: ``alarm.robot``).

    Raises:
        ModelFileError: a field that cannot be stored, a detector that does not load, such as one
            that never raises an alarm, or a folder that cannot be written.
    """
    if robot is not None:
        joints = alarm.detector.arm.robot.joint_names
        alarm = replace(alarm, robot=StoredRobot.of(robot, joints))
    data, classes = _written(alarm), _classes(alarm)
    try:
        again = _alarm_of(*_opened(data), classes)
        same = _written(again) == data
    except ModelFileError as error:
        raise ModelFileError(f"{path}: not written, because it would not load: {error}") from None
    if not same:
        raise ModelFileError(f"{path}: not written, because it would load with other values")
    try:
        write_atomic(Path(path), data)
    except OSError as error:
        raise ModelFileError(f"{path}: cannot be written ({error.strerror})") from None


def load_model(path: str | os.PathLike[str]) -> CollisionAlarm:
    """Read a file of :func:`save_model`.

    Raises:
        ModelFileError: the file is missing, damaged, or of another kind or version (the message
            says what to do), has numbers that no arm can have, or contains a detector that raises
            no alarm at any impact or alarms all the time.
    """
    check_no_device(Path(path))
    try:
        with open(path, "rb") as stream:
            data = stream.read(model_archive.LARGEST + 1)
    except OSError as error:
        raise ModelFileError(f"{path}: cannot be read ({error.strerror})") from None
    try:
        return _alarm_of(*_opened(data), {})
    except ModelFileError as error:
        raise ModelFileError(f"{path}: {error}") from None


def _written(alarm: CollisionAlarm) -> bytes:
    """The bytes of a model file.

    Raises:
        ModelFileError: names a field that cannot be stored.
    """
    arrays: Arrays = {}
    content, robot = encode(alarm, arrays), alarm.detector.arm.robot
    head = {
        "format": FORMAT,
        "version": VERSION,
        "kind": ALARM,
        "made_with": {name: importlib.metadata.version(name) for name in MADE_WITH},
        "arm": {
            "file": "" if alarm.robot is None else alarm.robot.name,
            "joints": list(robot.joint_names),
        },
        "content": content,
    }
    return model_archive.packed(head, arrays, key_of_user())


def _opened(data: bytes) -> tuple[dict[str, Any], Arrays]:
    """The content of a model file of this version, with its checksum and signature verified.

    Raises:
        ModelFileError: says what is wrong with the file.
    """
    try:
        head, arrays, checksum = model_archive.unpacked(data)
    except Exception as error:  # a damaged archive can raise any exception
        if earlier := _earlier(data):
            raise ModelFileError(f"of the earlier format {earlier!r}; {ANEW}") from None
        raise ModelFileError(f"not a model file, or a damaged one ({_line(error)})") from None
    if head.get("format") != FORMAT:
        raise ModelFileError(f"not a model file of tauguard; {ANEW}")
    version, kind, key = head.get("version"), head.get("kind"), key_of_user()
    if version != VERSION:
        raise ModelFileError(f"version {version} of the format, expected {VERSION}; {ANEW}")
    if kind != ALARM:
        raise ModelFileError(f"a file of the kind {kind!r}, expected {ALARM!r}")
    if checksum != head.get("checksum"):
        raise ModelFileError("its content does not fit its checksum: it was damaged or changed")
    if key is not None:
        check_signature(checksum, head.get("signature"), key)
    return head, arrays


def _alarm_of(
    head: Mapping[str, Any], arrays: Arrays, classes: Mapping[str, type]
) -> CollisionAlarm:
    """The detector in a file, if it is one that works.

    Args:
        head: JSON of the file.
        arrays: by name.
        classes: classes of others that are allowed beside those that the user has named.

    Raises:
        ModelFileError: says what is wrong with the content.
    """

    def known(name: str) -> type:
        return classes[name] if name in classes else file_type(name)

    try:
        alarm = decode(head.get("content"), arrays, known)
        if not isinstance(alarm, CollisionAlarm):
            raise ModelFileError(f"contains a {type(alarm).__name__}, not a detector; {ANEW}")
        with np.errstate(all="ignore"):
            check_ranges(alarm)
            check_alarms(alarm)
    except Exception as error:  # of any kind, in the classes that are built
        raise ModelFileError(" ".join(str(error).split()) or _line(error)) from None
    return alarm


def _classes(value: object) -> dict[str, type]:
    """The classes of others within a value, by their names in files.

    Raises:
        ModelFileError: a class that no other process could import.
    """
    found: dict[str, type] = {}
    if isinstance(value, list | tuple | dict):
        for item in value.values() if isinstance(value, dict) else value:
            found |= _classes(item)
    elif is_dataclass(value):
        kind, name = type(value), type_name(type(value))
        if name not in FILE_TYPES:
            module = importlib.import_module(kind.__module__)
            if (
                kind.__module__ == "__main__"
                or getattr(module, kind.__qualname__, None) is not kind
            ):
                raise ModelFileError(
                    f"a {name} cannot be in a model file: define {kind.__name__} at the top of a "
                    "module that other programs can import"
                )
            found[name] = kind
        for field in fields(value):
            found |= _classes(getattr(value, field.name))
    return found


def _earlier(data: bytes) -> str:
    """The format of a file of an earlier version; "" if it is none."""
    try:
        with zipfile.ZipFile(BytesIO(data)) as archive:
            return "skops" if "schema.json" in archive.namelist() else ""
    except Exception:  # of any kind, in a damaged archive
        pass
    try:
        found = json.loads(data)
    except (ValueError, RecursionError):
        return ""
    name = found.get("format") if isinstance(found, dict) else None
    return name if isinstance(name, str) and name.startswith("tauguard ") else ""


def _line(error: Exception) -> str:
    text = str(error).splitlines()
    return f"{type(error).__name__}: {text[0][:200]}" if text else type(error).__name__
