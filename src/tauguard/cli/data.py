"""``tauguard data``: list and fetch published logs of real arms."""

from pathlib import Path
from typing import Annotated, Literal

import tyro

from tauguard.findings import ArgumentError, TauguardError, as_flags


def command(
    task: Annotated[Literal["list", "fetch"], tyro.conf.Positional] = "list",
    name: Annotated[str | None, tyro.conf.Positional] = None,
    /,
    from_: Annotated[str | None, tyro.conf.arg(name="from")] = None,
    to: Path | None = None,
) -> None:
    """List published logs of real arms, or download and convert them.

    `tauguard data fetch ur5` downloads one set, `tauguard data fetch all` every set (130 MB and
    more). Every file is checked by its hash; licence and citation are printed and kept beside it.

    Args:
        task: `list`, or `fetch` with a name.
        name: name of a set, or `all`.
        from_: address of a mirror that has the originals under SET/PATH (default: the publishers').
        to: folder (default: the one that TAUGUARD_DATA names, else a folder of the user's cache).
    """
    from tauguard.benchmark import data_folder, fetch

    folder = to or data_folder()
    if task == "list":
        print_list(folder)
    elif name is None:
        raise ArgumentError("fetch: name a set, or all; `tauguard data list` has the names")
    else:
        try:
            fetch(name, from_, folder)
        except TauguardError as error:
            raise type(error)(as_flags(str(error))) from None


def print_list(folder: Path) -> None:
    """Print every set with its arm, contacts, minutes, licence, size and state in the folder."""
    from tauguard.benchmark import is_complete, sets
    from tauguard.report import table

    rows, elsewhere = [], []
    for one in sets().values():
        if not one.base:
            elsewhere.append(f"  {one.name}: {one.arm}; {one.page} (licence: {one.licence})")
            continue
        there = [is_complete(folder, log) for log in one.converted]
        state = "yes" if all(there) else f"{sum(there)} of {len(there)}" if any(there) else "no"
        row = {"name": one.name, "arm": one.arm}
        row["contacts"] = "?" if one.blind else "-" if one.contacts is None else str(one.contacts)
        row["minutes"] = "?" if one.blind else "-" if one.minutes is None else f"{one.minutes}"
        row |= {"licence": one.licence, "MB": f"{one.size / 1e6:.1f}", "fetched": state}
        rows.append(row)
    print(table(rows))
    print("blind: nobody has developed on these logs; keep them for a last judgement")
    print("not fetched by tauguard:", *elsewhere, sep="\n")
    print(f"folder: {folder}")
