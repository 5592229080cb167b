"""A dataset's card for the Hugging Face hub, its Croissant metadata, and their checksums.

Card and metadata depend only on ``dataset.json`` and the manifest, so a dataset always has the
same card. The checksums of shards and arms are in the manifest and in ``dataset.json``.
"""

import json
from importlib.resources import files
from pathlib import Path
from typing import Any

from tauguard.atomic_write import write_changed
from tauguard.datasets.columns_of_shards import JOINT_SIGNALS, MEANING, RESIDUAL, schema
from tauguard.datasets.configuration import Configuration
from tauguard.datasets.dataset_folder import (
    CARD,
    CROISSANT,
    SUMS,
    checksums,
    configuration_in,
    lines,
    read_head,
)
from tauguard.datasets.inspection import SplitSummary, summarised

LICENSE, LICENSE_URL = "apache-2.0", "https://www.apache.org/licenses/LICENSE-2.0"

#: Sentence that the card of a dataset of pairs adds.
PAIRS = """ Episodes 2k and 2k + 1 of a split are a pair: the same arm, load, temperature, noise and
commanded motion, first without and then with collisions."""


def write_cards(folder: Path) -> None:
    """Write card, metadata and checksums; a file with the right content is not rewritten."""
    configuration = configuration_in(folder)
    summary = summarised(folder)
    write_changed(folder / CARD, card(configuration, read_head(folder), summary))
    write_changed(folder / CROISSANT, croissant(folder, configuration, summary))
    write_changed(folder / SUMS, checksums(folder))


def describe(configuration: Configuration) -> str:
    """The dataset in a sentence."""
    arms = sorted({arm for split in configuration.splits for arm in split.arms})
    return (
        f"{configuration.hours:.4g} hours of simulated robot arms at work ({', '.join(arms)}), "
        f"{configuration.rate} samples per second, with the exact onset, link, point, force and "
        "joint torque of every collision"
    )


def card(
    configuration: Configuration, head: dict[str, Any], summary: dict[str, SplitSummary]
) -> str:
    """The text of ``README.md``, from the template ``card.md``."""
    parts = "".join(
        f"  - split: {name.replace('-', '_')}\n    path: {shards(name)}\n" for name in summary
    )
    rows, first = sum(one.rows for one in summary.values()), next(iter(summary))
    return (
        files("tauguard.datasets")
        .joinpath("card.md")
        .read_text("utf-8")
        .format(
            license=LICENSE,
            name=configuration.name,
            size=_size(rows),
            files=parts,
            sentence=describe(configuration),
            splits=_split_rows(summary),
            pairs=PAIRS if all(split.paired for split in configuration.splits) else "",
            columns=_column_rows(configuration),
            joints=configuration.most_joints,
            first=first,
            first_name=first.replace("-", "_"),
            key=configuration.name.replace("-", "_"),
            sha256=head["configuration_sha256"],
            tauguard=head["code"]["tauguard"],
            mujoco=head["code"]["mujoco"],
        )
    )


def _split_rows(summary: dict[str, SplitSummary]) -> str:
    return "\n".join(
        f"| {name} | {one.episodes} | {one.hours:.4g} | {one.rows} | {one.megabytes:.1f} | "
        f"{one.collisions} |"
        for name, one in summary.items()
    )


def _column_rows(configuration: Configuration) -> str:
    names = {k: v for k, v in MEANING.items() if k != RESIDUAL or configuration.residual}
    rows = ["| column | meaning |", "|---|---|"]
    return "\n".join([*rows, *(f"| `{k}` | {v} |" for k, v in names.items())])


def _size(rows: int) -> str:
    """The hub's size category for this many rows."""
    names = "1K", "10K", "100K", "1M", "10M", "100M", "1B", "10B", "100B", "1T"
    power = next((i for i in range(len(names)) if rows < 10 ** (i + 3)), len(names) - 1)
    return f"{names[power - 1]}<n<{names[power]}" if power else "n<1K"


def croissant(folder: Path, configuration: Configuration, summary: dict[str, SplitSummary]) -> str:
    """Croissant 1.0 metadata as JSON text: every shard with its SHA-256, every column."""
    shards: dict[str, tuple[str, int, str]] = {}
    for line in lines(folder):
        shards.setdefault(line["shard"], (line["sha256"], line["bytes"], line["split"]))
    distribution: list[dict[str, Any]] = [
        {
            "@type": "cr:FileObject",
            "@id": path,
            "name": path.split("/")[-1],
            "contentUrl": path,
            "contentSize": f"{size} B",
            "encodingFormat": "application/x-parquet",
            "sha256": digest,
        }
        for path, (digest, size, _) in shards.items()
    ]
    records = [
        _records(split, configuration)
        for split in summary
        if any(s == split for _, _, s in shards.values())
    ]
    context = files("tauguard.datasets").joinpath("croissant_context.json").read_text("utf-8")
    content = {
        "@context": json.loads(context),
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "name": configuration.name,
        "description": f"{describe(configuration)}.",
        "license": LICENSE_URL,
        "version": "1.0.0",
        "citeAs": f"{configuration.name}, configuration {configuration.sha256}",
        "distribution": [*distribution, *(r[0] for r in records)],
        "recordSet": [r[1] for r in records],
    }
    return json.dumps(content, indent=1) + "\n"


def shards(split: str) -> str:
    """Pattern of a split's files; the pattern of "test" does not match files of "test-arm"."""
    return f"data/{split}-[0-9]*.parquet"


def _records(split: str, configuration: Configuration) -> tuple[dict[str, Any], dict[str, Any]]:
    """The files of a split, and the columns of their rows."""
    own = {
        "@type": "cr:FileSet",
        "@id": f"{split}-files",
        "name": f"{split}-files",
        "encodingFormat": "application/x-parquet",
        "includes": shards(split),
    }
    fields = []
    for field in schema(configuration.most_joints, configuration.residual):
        signal = field.name.rpartition("_")[0]
        meaning = MEANING.get(field.name)
        if meaning is None and signal in (*JOINT_SIGNALS, RESIDUAL):
            meaning = f"{MEANING[signal]}, joint {field.name.rpartition('_')[2]}"
        kind = "sc:Float" if str(field.type) in ("float", "double") else "sc:Integer"
        fields.append(
            {
                "@type": "cr:Field",
                "@id": f"{split}/{field.name}",
                "name": field.name,
                "description": meaning or f"see {field.name[:-1]}x",
                "dataType": kind,
                "source": {
                    "fileSet": {"@id": f"{split}-files"},
                    "extract": {"column": field.name},
                },
            }
        )
    return own, {"@type": "cr:RecordSet", "@id": split, "name": split, "field": fields}
