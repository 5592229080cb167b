"""A dataset's folder: its head file, its shards, and the lock that allows one writer."""

import contextlib
import hashlib
import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

from tauguard.atomic_write import PART, remove_parts, write_atomic, write_changed
from tauguard.datasets.code_identity import code, computed_bits, versions
from tauguard.datasets.configuration import Configuration
from tauguard.datasets.robots import check_unchanged, nominal_texts
from tauguard.datasets.schedule import stated_balance
from tauguard.datasets.shard import digest, fault, manifest_path, read_lines
from tauguard.findings import FileError

#: Version of the folder's layout; readers refuse newer ones.
FORMAT = 2
HEAD = "dataset.json"
#: Checksums of the files that have no checksum elsewhere; written last.
SUMS = "SHA256SUMS"
CARD, CROISSANT = "README.md", "croissant.json"
#: Endings of an arm's files in ``arms``, by the name of the trace's attachment.
_ENDINGS = {"arm.xml": ".xml", "drive.json": ".drive.json"}


def read_head(folder: Path) -> dict[str, Any]:
    """The content of ``dataset.json``.

    Raises:
        FileError: the folder holds no dataset, one of a newer format, or a damaged one (also if
            its numbers of shards are not those of its configuration).
        FileNotFoundError: no such folder.
    """
    path = folder / HEAD
    if not folder.is_dir():
        raise FileNotFoundError(
            f"{folder}: no folder of that name; `tauguard generate` makes datasets"
        )
    if not path.is_file():
        raise FileError(f"{folder}: no {HEAD} in it; `tauguard generate` makes datasets")
    try:
        head = json.loads(path.read_text(encoding="utf-8"))
        version = head["format"]
        if isinstance(version, int) and version > FORMAT:
            raise FileError(
                f"{folder}: a dataset of format {version}; this tauguard reads up to {FORMAT}: "
                "install a newer version"
            )
        own = Configuration.from_json(json.dumps(head["configuration"]))
        counts = {split.name: shard_count(own, split.name) for split in own.splits}
        if head.get("shards", counts) != counts:
            raise LookupError("shards: not those of the configuration")
    except (
        LookupError,
        TypeError,
        AttributeError,
        ArithmeticError,
        json.JSONDecodeError,
        UnicodeDecodeError,
        RecursionError,
    ):
        raise FileError(
            f"{path}: damaged; `tauguard generate` with the same configuration into another "
            "folder makes the same bytes"
        ) from None
    return dict(head)


def configuration_in(folder: Path) -> Configuration:
    """The configuration of the dataset in ``folder``; errors as for :func:`read_head`."""
    return Configuration.from_json(json.dumps(read_head(folder)["configuration"]))


def shard_count(configuration: Configuration, split: str) -> int:
    """How many shards a split has."""
    episodes = next(s.episodes for s in configuration.splits if s.name == split)
    return math.ceil(episodes / configuration.episodes_per_shard)


def shards(configuration: Configuration) -> Iterator[tuple[str, int]]:
    """Name of the split and number of every shard, in order."""
    for split in configuration.splits:
        for number in range(shard_count(configuration, split.name)):
            yield split.name, number


def lines(folder: Path) -> Iterator[dict[str, Any]]:
    """The manifest's lines, one per episode, split by split; missing shards are skipped.

    Raises:
        FileError: a damaged file of the manifest.
    """
    for split, number in shards(configuration_in(folder)):
        path = folder / manifest_path(split, number)
        if path.is_file():
            yield from read_lines(path)


def faults(folder: Path) -> Iterator[tuple[str, int, str | None]]:
    """Name of the split, number and fault (None: intact) of every shard; reads every byte."""
    for split, number in shards(configuration_in(folder)):
        yield split, number, fault(folder, split, number)


def checksums(folder: Path) -> str:
    """SHA-256 of head, card and metadata, as ``sha256sum --check`` reads them."""
    return "".join(f"{digest(folder / name)}  {name}\n" for name in (HEAD, CARD, CROISSANT))


def changed(folder: Path) -> list[tuple[str, str]]:
    """Names of the files that have changed, among head, card, metadata and checksums.

    Empty for a dataset without checksums, which is incomplete or of an earlier version.
    """
    if not (folder / SUMS).exists():
        return []
    if not (folder / SUMS).is_file():
        return [(SUMS, "no file")]
    there = (folder / SUMS).read_bytes()
    found = []
    for name in (HEAD, CARD, CROISSANT):
        if not (folder / name).is_file():
            found.append((name, "missing"))
        elif f"{digest(folder / name)}  {name}\n".encode() not in there:
            found.append((name, f"not the file that {SUMS} lists"))
    if not found and there != checksums(folder).encode():
        found.append((SUMS, "damaged"))
    return found


@contextlib.contextmanager
def claimed(folder: Path, configuration: Configuration) -> Iterator[None]:
    """Context in which ``folder`` holds the described dataset and only this process writes to it.

    Missing subfolders, arm files and the head file are written on entry.

    Raises:
        FileError: the folder holds something else.
        OSError: another process is writing into the folder, or it cannot be made.
    """
    made = not folder.exists()
    folder.mkdir(parents=True, exist_ok=True)
    try:
        with _locked(folder):
            head = head_of(configuration)
            if (folder / HEAD).is_file():
                _check_same(folder, head)
            elif any(
                not (entry.name.startswith(".") and entry.name.endswith(PART))
                for entry in folder.iterdir()
            ):
                raise FileError(
                    f"{folder}: not empty, and no dataset; name a new or an empty folder"
                )
            remove_parts(folder)
            _begin(folder, head, configuration)
            yield
    finally:
        if made:
            with contextlib.suppress(OSError):
                folder.rmdir()  # succeeds only if it is empty


def head_of(configuration: Configuration) -> dict[str, Any]:
    """The content of ``dataset.json``."""
    return {
        "format": FORMAT,
        "name": configuration.name,
        "configuration_sha256": configuration.sha256,
        "code": {"sha256": code(), "computed_bits": computed_bits(), **versions()},
        "hours": configuration.hours,
        "shards": {s.name: shard_count(configuration, s.name) for s in configuration.splits},
        "planned": stated_balance(configuration),
        "arms_sha256": {name: _sha256(text) for name, text in _arm_files(configuration).items()},
        "configuration": json.loads(configuration.anywhere().to_json()),
    }


def arms_of(configuration: Configuration, splits: tuple[str, ...] | None = None) -> tuple[str, ...]:
    """The arms of these splits (default: of all), by name."""
    chosen = [s for s in configuration.splits if splits is None or s.name in splits]
    return tuple(sorted({arm for split in chosen for arm in split.arms}))


def arm_xml(folder: Path, arm: str) -> str:
    """The nominal arm that a dataset was made with, as MJCF; errors as for :func:`arm_texts`."""
    return arm_texts(folder, arm)["arm.xml"]


def arm_checksums(head: dict[str, Any]) -> dict[str, str]:
    """SHA-256 of each file of ``arms``, by its name, as ``dataset.json`` states it."""
    wanted: dict[str, str] = head.get("arms_sha256", {})
    if head["format"] == 1:  # keys without extension; no drive files
        wanted = {f"{name}.xml": digest for name, digest in wanted.items()}
    return wanted


def arm_texts(folder: Path, arm: str) -> dict[str, str]:
    """The attachments of every trace of an arm (``Scene.nominal_texts``), read from the folder.

    Raises:
        FileError: a file is missing or not the one that was written.
    """
    head = read_head(folder)
    wanted, found = arm_checksums(head), {}
    for name, ending in _ENDINGS.items():
        path = folder / "arms" / f"{arm}{ending}"
        if path.name not in wanted and name != "arm.xml":
            continue
        try:
            text = path.read_text(encoding="utf-8") if path.is_file() else ""  # a pipe would block
        except UnicodeDecodeError:
            text = ""
        if not text or wanted.get(path.name, _sha256(text)) != _sha256(text):
            raise FileError(
                f"{path}: missing or damaged; the same `tauguard generate` that made the dataset "
                "writes it again"
            )
        found[name] = text
    if head["format"] == 1:
        with contextlib.suppress(ValueError, OSError):  # training needs the drive, reading does not
            robots = configuration_in(folder).robots
            check_unchanged(arm, robots)
            found = nominal_texts(arm, robots) | found
    return found


def _arm_files(configuration: Configuration) -> dict[str, str]:
    """The files of ``arms``: names and texts."""
    return {
        f"{arm}{_ENDINGS[name]}": text
        for arm in arms_of(configuration)
        for name, text in nominal_texts(arm, configuration.robots).items()
    }


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _begin(folder: Path, head: dict[str, Any], configuration: Configuration) -> None:
    for name in ("data", "manifest", "arms"):
        (folder / name).mkdir(exist_ok=True)
    for name, text in _arm_files(configuration).items():
        write_changed(folder / "arms" / name, text)
    path, text = folder / HEAD, json.dumps(head, indent=1, sort_keys=True) + "\n"
    if not path.is_file() or path.read_bytes() != text.encode():
        (folder / SUMS).unlink(missing_ok=True)  # checksums of the old head; write_cards writes new
        write_atomic(path, text)


def _check_same(folder: Path, head: dict[str, Any]) -> None:
    there = read_head(folder)
    if there["configuration_sha256"] != head["configuration_sha256"]:
        raise FileError(
            f"{folder}: holds another dataset ({there['name']}, configuration "
            f"{there['configuration_sha256'][:12]}, not {head['configuration_sha256'][:12]}); "
            "name another folder"
        )
    if there["code"] != head["code"]:
        differ = [k for k in head["code"] if there["code"].get(k) != head["code"][k]]
        named = [f"{k} {there['code'].get(k)}" for k in differ if k in versions()]
        why = ", ".join(named) or "other sources, or a machine that rounds differently"
        raise FileError(
            f"{folder}: was begun with {why}: new shards would not have the same bytes; "
            "name another folder"
        )


@contextlib.contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Allow one writer at a time; the lock ends with the process, however the process ends."""
    try:
        import fcntl
    except ImportError:  # this system has no flock
        yield
        return
    import os

    handle: IO[bytes] | int = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise OSError(f"{folder}: another process is generating into it") from None
        yield
    finally:
        os.close(handle)  # type: ignore[arg-type]
