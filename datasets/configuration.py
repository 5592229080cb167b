"""The description of a dataset in TOML, checked completely before anything is simulated."""

from __future__ import annotations

import functools
import hashlib
import json
import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from importlib.resources import files
from pathlib import Path
from typing import Any

from tauguard.datasets.configuration_checks import (
    KEYS,
    SPLIT,
    checked_table,
    closest,
    refuse,
)
from tauguard.datasets.plans import CLAMP_SECONDS, SLOT
from tauguard.datasets.robots import RobotSource, find_robot
from tauguard.findings import FileError
from tauguard.models import ROBOTS, SceneObject, cura6, load_objects

#: Names of this package's configurations.
NAMED = ("tauguard-collisions-v2", "tauguard-collisions-v1", "cura6-twin")
#: Keys of a split that were added after the first datasets were published.
LATER_KEYS = ("clamp_seconds", "paired")


@dataclass(frozen=True)
class Split:
    """A part of a dataset, such as training or test; every episode belongs to one split."""

    name: str
    episodes: int  #: number of episodes
    quick_episodes: int  #: number of episodes (the first ones) that ``--quick`` generates
    seconds: float  #: length of an episode [s]
    arms: tuple[str, ...]  #: names of arm models; this list and each list below is cycled
    individuals: tuple[int, ...]  #: seeds of the model mismatch; -1: no mismatch
    speeds: tuple[float, ...]  #: percent of the largest joint speeds
    payloads_g: tuple[float, ...]  #: carried masses, unknown to the observer [g]
    struck: float  #: fraction of the episodes that have collisions
    collisions: int  #: number planned in each episode that has collisions
    kinds: tuple[str, ...]  #: kinds of collisions; a kind listed twice occurs twice as often
    links: tuple[int, ...]  #: links that collisions act on, 1-based
    severities: tuple[tuple[float, float], ...]  #: ranges of peak ``|tau_ext|``, joints 1-4 [N m]
    temperature: tuple[float, float]  #: range of the gears' temperature [degC]
    picks: float  #: fraction of collision-free episodes in which the arm picks up a payload
    unseen: tuple[str, ...]  #: properties ("arm", ...) whose values the first split does not have
    clamp_seconds: tuple[float, float] = CLAMP_SECONDS  #: range of a clamp's duration [s]
    paired: bool = False  #: episodes 2k (free) and 2k + 1 (with collisions) have the same motion


@dataclass(frozen=True)
class Configuration:
    """The description of a dataset; :func:`load` reads one."""

    name: str
    seed: int  #: seed of every random draw
    rate: int  #: rows per second [Hz]; the physics runs at 1000 Hz
    episodes_per_shard: int
    residual: bool  #: whether the momentum observer's estimate of tau_ext is stored
    mismatch: tuple[tuple[str, float], ...]  #: half-widths, see :class:`tauguard.models.Mismatch`
    splits: tuple[Split, ...]
    robots: tuple[RobotSource, ...] = ()  #: arms that are not the package's own
    objects: tuple[SceneObject, ...] = ()  #: objects around the arm in every episode

    def to_json(self) -> str:
        """The configuration as JSON; equal configurations give equal text."""
        values = asdict(self)
        for name in ("robots", "objects"):
            if not values[name]:
                del values[name]
        for split in values["splits"]:  # hashes must not change: omit later keys at their default
            for name in LATER_KEYS:
                if split[name] == SPLIT[name].default:
                    del split[name]
        return json.dumps(values, sort_keys=True)

    @classmethod
    def from_json(cls, text: str) -> Configuration:
        """The configuration that :meth:`to_json` wrote."""
        values = json.loads(text)
        splits = tuple(Split(**{k: _frozen(v) for k, v in s.items()}) for s in values["splits"])
        robots = tuple(
            RobotSource(**{k: _frozen(v) for k, v in r.items()}) for r in values.get("robots", ())
        )
        objects = tuple(SceneObject(**one) for one in values.get("objects", ()))
        parts = ("splits", "robots", "objects")
        rest = {k: _frozen(v) for k, v in values.items() if k not in parts}
        return cls(**rest, splits=splits, robots=robots, objects=objects)

    @property
    def sha256(self) -> str:
        """SHA-256 of the JSON text without the paths of the arms' files."""
        nowhere = replace(self, robots=tuple(replace(r, source="") for r in self.robots))
        return hashlib.sha256(nowhere.to_json().encode()).hexdigest()

    def anywhere(self) -> Configuration:
        """A copy in which the arms' files have names instead of paths on this machine."""
        return replace(self, robots=tuple(robot.anywhere() for robot in self.robots))

    def joints_of(self, arm: str) -> tuple[str, ...]:
        """The joint names of an arm, base to tip."""
        return next((r.joints for r in self.robots if r.name == arm), cura6.JOINTS)

    def source_of(self, arm: str) -> str:
        """The name or file of this arm, for :func:`tauguard.models.load_arm`."""
        return next((r.source for r in self.robots if r.name == arm), arm)

    def with_source(self, arm: str, source: str) -> Configuration:
        """A copy with an arm's file at ``source``."""
        moved = (replace(r, source=source) if r.name == arm else r for r in self.robots)
        return replace(self, robots=tuple(moved))

    @property
    def most_joints(self) -> int:
        """Largest number of joints of any arm."""
        return max(len(self.joints_of(arm)) for split in self.splits for arm in split.arms)

    def quick(self) -> Configuration:
        """The first episodes of every split, which are byte-equal to the full dataset's."""
        return replace(
            self, splits=tuple(replace(s, episodes=s.quick_episodes) for s in self.splits)
        )

    @functools.cached_property
    def identity(self) -> str:
        """A hash that is equal for the full dataset and for its quick part."""
        return self.quick().sha256

    @property
    def hours(self) -> float:
        """Simulated time of all episodes [h]."""
        return sum(s.episodes * s.seconds for s in self.splits) / 3600


def load_configuration(source: str | Path) -> Configuration:
    """The configuration in a TOML file, or this package's configuration of that name.

    Raises:
        FileError: not TOML, an unknown key, a value out of range, or an ``unseen`` value that the
            first split has; the message names key, value and what would work.
        OSError: no such file.
    """
    path = Path(source)
    if str(source) in NAMED:
        named = files("tauguard.datasets").joinpath(f"named/{source}.toml")
        text, where = named.read_text("utf-8"), ""
    elif path.is_file():
        try:
            text, where = path.read_text(encoding="utf-8"), f"{path}: "
        except UnicodeDecodeError:
            raise FileError(f"{path}: not a text file; expected TOML") from None
    else:
        raise FileNotFoundError(
            f"configuration {str(source)!r}: no such file{closest(str(source), NAMED)}; named "
            f"configurations: {', '.join(NAMED)}"
        )
    try:
        return parse(tomllib.loads(text), path.parent)
    except tomllib.TOMLDecodeError as error:
        raise FileError(f"{where}not TOML ({error})") from None
    except RecursionError:
        raise FileError(f"{where}not TOML of a dataset (nested too deep)") from None
    except ValueError as error:
        raise FileError(f"{where}{error}") from None


def parse(values: Mapping[str, Any], folder: Path = Path()) -> Configuration:
    """The configuration of parsed TOML; errors as for :func:`load`.

    Args:
        values: the tables.
        folder: base of relative paths of arms and objects.
    """
    top = checked_table("", {k: v for k, v in values.items() if k not in TABLES}, KEYS["top"])
    widths = checked_table("mismatch", _table(values, "mismatch"), KEYS["mismatch"])
    common = dict(_table(values, "episodes"))
    checked_table("episodes", common, KEYS["split"], partial=True)
    tables = values.get("splits")
    if not (isinstance(tables, list) and tables and all(isinstance(t, dict) for t in tables)):
        refuse("splits", tables, "one [[splits]] table or more")
    splits, robots = [], dict[str, RobotSource]()
    for number, own in enumerate(tables):
        where = f"splits[{number}]"
        merged = checked_table(where, {**common, **own}, KEYS["split"])
        merged["arms"] = _named_arms(where, merged["arms"], folder, robots)
        joints = [
            len(robots[arm].joints if arm in robots else cura6.JOINTS) for arm in merged["arms"]
        ]
        splits.append(_split(where, merged, min(joints)))
    _check_splits(splits)
    around = top.pop("objects")
    return Configuration(
        **top,
        objects=load_objects(folder / around) if around else (),
        mismatch=tuple(sorted(widths.items())),
        splits=tuple(splits),
        robots=tuple(robots[name] for name in sorted(robots)),
    )


TABLES = ("mismatch", "episodes", "splits")
#: Time before the first collision's slot plus time after the last slot [s].
MARGIN = 3.5


def _named_arms(
    where: str, asked: tuple[str, ...], folder: Path, robots: dict[str, RobotSource]
) -> tuple[str, ...]:
    """Names of the arms in the dataset; arms from files are added to ``robots``."""
    names = []
    for arm in asked:
        if arm in cura6.NAMES:
            names.append(arm)
            continue
        try:
            found = find_robot(arm, folder)
        except ValueError as error:
            hint = closest(arm, (*cura6.NAMES, *ROBOTS))
            raise FileError(f"{where}.arms: {error}{hint}") from None
        if robots.setdefault(found.name, found) != found or found.name in names:
            refuse(f"{where}.arms", arm, f"another file name: two arms would be {found.name}")
        names.append(found.name)
    return tuple(names)


def _split(where: str, values: dict[str, Any], joints: int) -> Split:
    if values["links"] is None:
        values["links"] = tuple(range(min(2, joints), joints + 1))
    elif max(values["links"]) > joints:
        refuse(f"{where}.links", values["links"], f"1 to {joints}, links of every arm")
    quick = values["quick_episodes"]
    if quick is None:
        quick = max(1, round(0.02 * values["episodes"]))
        values["quick_episodes"] = quick + quick % 2 if values["paired"] else quick
    elif quick > values["episodes"]:
        refuse(f"{where}.quick_episodes", quick, f"at most the split's {values['episodes']}")
    room = int((values["seconds"] - MARGIN) / SLOT)
    if values["collisions"] is None:
        values["collisions"] = max(room, 0)
    if values["struck"] > 0 and not 1 <= values["collisions"] <= room:
        refuse(
            f"{where}.collisions",
            values["collisions"],
            f"1 to {room}, as many as {values['seconds']:g} s have room for "
            f"({SLOT:g} s each after {MARGIN:g} s)",
        )
    if values["paired"]:
        if values["struck"] != 0.5 or values["picks"] > 0:
            raise FileError(
                f"{where}.paired: one episode of each pair has collisions, none picks up a load; "
                f"expected struck = 0.5 and picks = 0, found {values['struck']:g} and "
                f"{values['picks']:g}"
            )
        if values["episodes"] % 2 or values["quick_episodes"] % 2:
            counts = values["episodes"], values["quick_episodes"]
            refuse(f"{where}.episodes, quick_episodes", counts, "even numbers, as they are paired")
    return Split(**values)


def _check_splits(splits: list[Split]) -> None:
    """Refuse equal names, and values of the first split that another split calls unseen."""
    names = [split.name for split in splits]
    if len(set(names)) < len(names):
        refuse("splits", names, "a name of its own for every split")
    first = splits[0]
    for number, split in enumerate(splits):
        where = f"splits[{number}].unseen"
        if number == 0 and split.unseen:
            refuse(where, split.unseen, "nothing: other splits are compared with the first one")
        for what in split.unseen:
            shared = values_of(first, what) & values_of(split, what)
            if shared:
                raise FileError(
                    f"{where}: {split.name} shares {what} {sorted(shared)[0]!r} with {first.name}; "
                    f"expected no {what} of {first.name}"
                )


def values_of(split: Split, what: str) -> set[Any]:
    """The planned values of ``what``: "arm", "individual", "payload" or "speed"."""
    if what == "individual":
        return {(arm, number) for arm in split.arms for number in split.individuals}
    return set({"arm": split.arms, "payload": split.payloads_g, "speed": split.speeds}[what])


def _table(values: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    table = values.get(name, {})
    if not isinstance(table, dict):
        refuse(name, table, f"a table [{name}]")
    return dict(table)


def _frozen(value: Any) -> Any:
    return tuple(map(_frozen, value)) if isinstance(value, list) else value
