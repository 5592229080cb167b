"""What commands print: findings, and errors with their findings."""

from __future__ import annotations

from collections.abc import Iterable

from tauguard.findings import Finding, TauguardError, as_flags


def print_findings(findings: Iterable[Finding]) -> None:
    """Print notes and warnings, one line each, with arguments as flags."""
    for finding in findings:
        if finding.severity != "error":
            warning = finding.severity == "warning"
            accepted = f"accepted as --accept {finding.accept} says: " if warning else ""
            print(f"note: {accepted}{as_flags(finding.text)}")


def causes(error: TauguardError) -> list[str]:
    """The errors among the findings, with arguments as flags."""
    return [as_flags(text) for text in error.causes]
