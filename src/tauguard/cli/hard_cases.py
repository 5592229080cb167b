"""``tauguard hard-cases``: cases with exact answers, for tauguard and other libraries."""

from pathlib import Path

from tauguard.findings import ArgumentError


def command(
    adapter: tuple[str, ...] = (),
    case: tuple[str, ...] = (),
    json: Path | None = None,
) -> None:
    """Run the hard cases on every installed library and print the verdicts.

    Args:
        adapter: libraries to test: names, or module:Class of your own adapter, whose module may be
            in the working folder (default: all).
        case: names of cases, or beginnings of names (default: all).
        json: write a row for every answer here as JSON.
    """
    from tauguard.hard_cases import adapters, load_cases, run, verdicts
    from tauguard.report import machine, table, versions, write_json

    cases = [one for one in load_cases() if not case or one.name.startswith(case)]
    if not cases:
        raise ArgumentError(f"case {', '.join(case)}: no case has a name that begins so")
    rows = run(cases, adapters(adapter))
    if not rows:
        kinds = ", ".join(dict.fromkeys(one.kind for one in cases))
        raise ArgumentError(f"none of the libraries answers cases of this kind ({kinds})")
    shown = ("case", "library", "expected", "answer", "right", "wrong")
    print(table([{key: row[key] for key in shown} for row in rows]))
    print("\n" + table(verdicts(rows)))
    if json is not None:
        payload = {"machine": machine(), "versions": versions(), "rows": rows}
        write_json(json, {"name": "hard-cases", **payload})
        print(f"json: {json}")
