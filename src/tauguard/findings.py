"""Findings of checks, and the errors of the library.

A check that doubts its input returns a :class:`Finding`. A function that refuses its input raises a
:class:`TauguardError`, which carries all findings up to the refusal. Texts name arguments as Python
in backquotes, such as ```mend="deg"```; :func:`as_flags` writes them as flags of the command line.
"""

from __future__ import annotations

import ast
import contextlib
import dataclasses
import re
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

if TYPE_CHECKING:
    import pandas

__all__ = [
    "ArgumentError", "FileError", "Finding", "Findings", "LogError", "MismatchError",
    "ModelFileError", "RefusedError", "TauguardError", "as_flags", "cause", "note", "preceded_by",
    "raise_errors",
]  # fmt: skip

Severity = Literal["note", "warning", "error"]


@dataclass(frozen=True)
class Finding:
    """A doubt about data or arguments.

    A finding of severity ``"note"`` informs, a ``"warning"`` would have been an error if the caller
    had not accepted it, an ``"error"`` stops the call.
    """

    code: str  #: stable name of the check, for programs
    severity: Severity
    text: str  #: one line; arguments stand in it as Python, in backquotes
    where: tuple[str, ...] = ()  #: names of the logs and joints that it concerns
    accept: str = ""  #: word of the argument ``accept=`` that turns this error into a warning

    def __str__(self) -> str:
        if self.severity == "warning":
            return f'accepted (`accept="{self.accept}"`): {self.text}'
        if self.severity == "error" and self.accept:
            return f'{self.text}; to use the logs all the same, add `accept="{self.accept}"`'
        return self.text


class Findings(tuple[Finding, ...]):
    """Findings in the order in which they were made; printed, one line each."""

    __slots__ = ()

    def __str__(self) -> str:
        return "\n".join(f"{f.severity} [{f.code}]: {f}" for f in self) or "no findings"

    __repr__ = __str__

    def of(self, *codes: str) -> Findings:
        """Those with one of these codes."""
        return Findings(finding for finding in self if finding.code in codes)

    def without(self, *codes: str) -> Findings:
        """Those with none of these codes."""
        return Findings(finding for finding in self if finding.code not in codes)

    def to_frame(self) -> pandas.DataFrame:
        """One row per finding (needs pandas): code, severity, text, where, accept."""
        import pandas

        names = [field.name for field in dataclasses.fields(Finding)]
        return pandas.DataFrame([dataclasses.asdict(finding) for finding in self], columns=names)


def note(code: str, text: str, *where: str) -> Finding:
    """A finding that informs; ``where`` names logs and joints."""
    return Finding(code, "note", text, where)


def cause(code: str, text: str, *where: str, accept: str = "") -> Finding:
    """A finding that stops the call, unless the caller accepts its word ``accept``."""
    return Finding(code, "error", text, where, accept)


class TauguardError(ValueError):
    """Base of the errors that a caller can mend."""

    code: ClassVar[str] = "error"  #: of a finding that is given as text
    shown: ClassVar[int] = 5  #: largest number of findings in the message

    def __init__(self, *findings: Finding | str) -> None:
        """Take what was found until the refusal.

        Args:
            findings: those of severity ``"error"`` are the causes. A text stands for one error
                whose code is that of the class.
        """
        self.findings = Findings(
            Finding(self.code, "error", found) if isinstance(found, str) else found
            for found in findings
        )
        causes = self.causes
        more = len(causes) - self.shown
        super().__init__("; ".join(causes[: self.shown]) + (f"; and {more} more" * (more > 0)))

    @property
    def causes(self) -> list[str]:
        """The texts of the errors; they name words of ``accept=`` only if all can be accepted."""
        errors = [finding for finding in self.findings if finding.severity == "error"]
        acceptable = all(finding.accept for finding in errors)
        return [str(finding) if acceptable else finding.text for finding in errors]

    def __reduce__(self) -> tuple[type[TauguardError], tuple[Finding, ...]]:
        return type(self), tuple(self.findings)


class ArgumentError(TauguardError):
    """An argument has the wrong type, shape or range, or does not go with another one."""

    code = "argument"


class FileError(TauguardError):
    """The content of a file cannot be used: it is damaged, incomplete, or of another format."""

    code = "file"


class LogError(FileError):
    """A file cannot be read as a log: its columns, units, times or rows."""

    code = "log"


class ModelFileError(FileError):
    """A model file is damaged, of another version, or cannot be written."""

    code = "model-file"


class MismatchError(TauguardError):
    """Two parts do not belong together, such as the robot of a log and that of a detector."""

    code = "mismatch"


class RefusedError(TauguardError):
    """Checks refuse the data; ``accept`` has the words with which a caller can use it anyway."""

    code = "refused"

    @property
    def accept(self) -> tuple[str, ...]:
        """The words of ``accept=`` that turn all errors into warnings; empty if none do."""
        causes = [finding for finding in self.findings if finding.severity == "error"]
        words = dict.fromkeys(finding.accept for finding in causes)
        return () if "" in words else tuple(words)


def raise_errors(
    kind: type[TauguardError], findings: Iterable[Finding], accept: Collection[str] = ()
) -> Findings:
    """Return the findings, those whose word is in ``accept`` as warnings.

    Raises:
        TauguardError: of the given ``kind``, with all findings, if an error is not accepted.
    """
    judged = Findings(
        dataclasses.replace(finding, severity="warning")
        if finding.severity == "error" and finding.accept and finding.accept in accept
        else finding
        for finding in findings
    )
    if any(finding.severity == "error" for finding in judged):
        raise kind(*judged)
    return judged


@contextlib.contextmanager
def preceded_by(findings: Iterable[Finding]) -> Iterator[None]:
    """Errors of the block get these findings before their own."""
    try:
        yield
    except TauguardError as error:
        raise type(error)(*findings, *error.findings) from error.__cause__


# -- arguments in texts, as flags ------------------------------------------------------------------

#: An argument in backquotes, such as `mend="deg"`.
_ARGUMENT = re.compile(r"`([a-z_]+)=([^`]*)`")


def as_flags(text: str) -> str:
    """The text with each argument in backquotes written as a flag.

    ```mend="deg"``` becomes ``--mend deg``, ```torque=True``` becomes ``--torque``, and
    ```payload={"a.csv": KG}``` becomes ``--payload a.csv=KG``; None becomes ``unknown``.
    """
    return _ARGUMENT.sub(_flag, text)


def _flag(argument: re.Match[str]) -> str:
    name, value = argument.groups()
    flag = "--" + name.replace("_", "-")
    if value in ("", "True"):
        return flag
    try:
        node = ast.parse(value, mode="eval").body
    except SyntaxError:  # a placeholder such as a,b,c
        return f"{flag} {value}"
    if isinstance(node, ast.Dict):
        pairs = zip(node.keys, node.values, strict=True)
        return " ".join([flag, *(f"{_word(key)}={_word(word)}" for key, word in pairs)])
    if isinstance(node, ast.Tuple | ast.List):
        return " ".join([flag, *map(_word, node.elts)])
    return f"{flag} {_word(node)}"


def _word(node: ast.expr | None) -> str:
    if isinstance(node, ast.Constant):
        return "unknown" if node.value is None else str(node.value)
    if isinstance(node, ast.Tuple | ast.List):
        return ",".join(map(_word, node.elts))
    return "" if node is None else ast.unparse(node)
