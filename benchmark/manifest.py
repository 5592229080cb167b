"""The published sets of logs: where their originals are, their hashes, licences and citations."""

from __future__ import annotations

import difflib
import functools
import hashlib
import os
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tauguard.findings import ArgumentError

#: Hashes with this prefix are git's, of a blob: SHA-1 of ``blob SIZE\\0`` and the content.
GIT = "git-blob:"


@dataclass(frozen=True)
class Original:
    """A published file."""

    path: str  #: in its repository
    bytes: int  #: size; 0: not known
    hash: str  #: sha256, or the hash of git's blob with the prefix GIT


@dataclass(frozen=True)
class Converted:
    """A file that is made of originals."""

    path: str  #: in the data folder
    originals: tuple[str, ...]  #: paths in the repository, in the order that the conversion expects
    bytes: int = 0  #: size; 0: not known
    sha256: str = ""  #: empty: not known


@dataclass(frozen=True)
class DataSet:
    """A set of published logs."""

    name: str
    arm: str
    licence: str  #: as the publisher states it
    citation: str
    page: str  #: repository
    base: str = ""  #: address of the originals at a commit; empty: not fetched by tauguard
    truth: str = ""  #: what is known about contacts
    conversion: str = ""  #: name of the conversion
    originals: tuple[Original, ...] = ()
    converted: tuple[Converted, ...] = ()
    needs: tuple[str, ...] = ()  #: sets without which this one is of no use
    contacts: int | None = None
    minutes: float | None = None
    blind: bool = False  #: nobody has developed on it

    @property
    def size(self) -> int:
        """Known size of the originals [bytes]."""
        return sum(original.bytes for original in self.originals)

    @property
    def licensed(self) -> bool:
        """Whether the publisher states a licence."""
        return self.licence not in ("none stated", "not known")

    def notice(self) -> str:
        """Licence, citation and source, as text that stays beside the data."""
        lines = [f"{self.name}: {self.arm}", f"licence: {self.licence}", f"source: {self.page}"]
        if not self.licensed:
            lines.append(
                "Without a licence the files stay their authors': use them here, pass on none."
            )
        if self.citation:
            lines.insert(2, f"cite: {self.citation}")
        return "\n".join(lines) + "\n"


@functools.cache
def sets() -> dict[str, DataSet]:
    """All sets by name, also those that tauguard does not fetch."""
    table = tomllib.loads(Path(__file__).with_name("sets.toml").read_text("utf-8"))
    elsewhere = table.pop("elsewhere")
    fetched = {name: _set(name, entry) for name, entry in table.items()}
    return fetched | {
        name: DataSet(name, citation="", **entry) for name, entry in elsewhere.items()
    }


def _set(name: str, entry: dict[str, Any]) -> DataSet:
    folder, parts = entry.pop("folder", ""), entry.pop("parts", ())
    originals = [Original(folder + path, size, sha) for path, size, sha in entry.pop("files")]
    by_path = {original.path: original for original in originals}
    converted = []
    for path, source, *hashes in entry.pop("logs"):
        named = [f"{folder}{source}/{part}".replace("//", "/") for part in parts]
        sources = tuple(n for n in named if n in by_path) or (folder + source,)
        if entry["conversion"] == "same":
            hashes = [by_path[sources[0]].bytes, by_path[sources[0]].hash]
        converted.append(Converted(path, sources, *hashes))
    entry["needs"] = tuple(entry.pop("needs", ()))
    return DataSet(name, originals=tuple(originals), converted=tuple(converted), **entry)


def chosen(name: str) -> list[DataSet]:
    """The set of a name with those it needs, or all that tauguard fetches for ``all``.

    Raises:
        ArgumentError: no such set, or one that tauguard does not fetch.
    """
    by_name = sets()
    if name == "all":
        return [dataset for dataset in by_name.values() if dataset.base]
    if name not in by_name:
        near = difflib.get_close_matches(name, by_name, n=1)
        hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(by_name)}"
        raise ArgumentError(f"no data set {name!r}: {hint}")
    dataset = by_name[name]
    if not dataset.base:
        raise ArgumentError(
            f"{name} is not fetched by tauguard: get it at {dataset.page} "
            f"(licence: {dataset.licence})"
        )
    return [*(by_name[other] for other in dataset.needs), dataset]


def data_folder() -> Path:
    """The folder of the logs: the one that ``TAUGUARD_DATA`` names, else the user's cache."""
    if named := os.environ.get("TAUGUARD_DATA"):
        return Path(named)
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache) / "tauguard" / "data"


def hashed(content: bytes, like: str) -> str:
    """The hash of ``content``, of the kind of the hash ``like``."""
    if like.startswith(GIT):
        head = b"blob %d\0" % len(content)
        return GIT + hashlib.sha1(head + content, usedforsecurity=False).hexdigest()
    return hashlib.sha256(content).hexdigest()


def is_complete(folder: Path, part: Original | Converted) -> bool:
    """Whether a file is in the folder with the right content (if a hash of it is known)."""
    path = folder / part.path
    expected = part.hash if isinstance(part, Original) else part.sha256
    if not path.is_file() or (part.bytes and path.stat().st_size != part.bytes):
        return False
    return not expected or hashed(path.read_bytes(), expected) == expected
