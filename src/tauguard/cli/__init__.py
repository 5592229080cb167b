"""The command line: one file per command; heavy imports are inside the command.

A command is a module ``tauguard.cli.<name>`` with a function ``command`` whose signature tyro
turns into flags. It raises ``ArgumentError`` or ``OSError`` with one helpful line for bad input
(exit code 2), and ``SystemExit`` with another code if a script needs to distinguish outcomes.
"""

import difflib
import importlib
import os
import re
import sys
from collections.abc import Sequence

from tauguard.cli.checkout import STUDY_COMMANDS, run_studies
from tauguard.findings import ArgumentError, TauguardError, as_flags

COMMANDS = {
    "demo": "simulate an arm, train a detector, detect collisions, write a recording",
    "data": "list and download published logs of real arms",
    "calibrate": "identify friction, inertia and drive gains of a real arm from free logs",
    "twin": "identify a simulated copy of a real arm from free logs",
    "detect": "find collisions in the log of a real arm",
    "speed": "estimate how fast a robot may move beside a person, along a program",
    "generate": "make a labelled dataset from its description, on all cores or a Ray cluster",
    "inspect": "show the content of a generated dataset and check its files",
    "export": "write a generated dataset in the format of another library",
    "robot": "print every parameter of an arm with its source",
    "simulate": "simulate labelled episodes of an arm and record them",
    "train": "train a detector on labelled recordings or on free logs of a real arm",
    "evaluate": "evaluate a detector on labelled recordings",
    "watch": "show a running environment in the rerun viewer",
    "listen": "run a detector on a running robot, read-only: free, collision or fault",
    "play-ur": "send a log as a UR controller would, to test `listen`",
    "replay": "convert an MCAP recording into an .rrd file for the rerun viewer",
    "video": "render a recording of the simulation to GIF or MP4",
    "report": "write the results of all studies and hard cases to one HTML page",
    "hard-cases": "test collision libraries on named cases with exact answers",
    "bench": "measure computing time and errors of methods in a study",
}

#: A user's ``module:Class``; the module may be in the working folder.
OWN = re.compile(r"[A-Za-z_][\w.]*:[A-Za-z_]\w*")

EPILOG = """\
`tauguard COMMAND --help` explains a command. A free log is one in which nothing touched the arm.
Exit codes: 0 done, 1 a defect of tauguard, 2 bad input; --debug shows the traceback of an error.
tauguard is a research tool, not a certified safety function."""


def usage() -> str:
    """The text of ``tauguard --help``."""
    width = max(map(len, COMMANDS))
    lines = [f"  {name:<{width}}  {line}" for name, line in COMMANDS.items()]
    return "\n".join(["usage: tauguard COMMAND [OPTIONS]", "", *lines, "", EPILOG])


def main(argv: Sequence[str] | None = None) -> None:
    """Entry point of ``tauguard``: find the command, parse its flags, run it."""
    args = list(sys.argv[1:] if argv is None else argv)
    debug = "--debug" in args
    args = [arg for arg in args if arg != "--debug"]
    if not args or args[0] in ("-h", "--help"):
        print(usage())
        return
    if args[0] == "--version":
        from tauguard import __version__

        print(__version__)
        return
    name = args[0]
    if name not in COMMANDS:
        near = difflib.get_close_matches(name, COMMANDS, n=1)
        hint = f"did you mean {near[0]}?" if near else f"commands: {', '.join(COMMANDS)}"
        fail(f"unknown command {name!r}: {hint}")
    if name in STUDY_COMMANDS:
        try:
            raise SystemExit(run_studies(name, args[1:] + ["--debug"] * debug))
        except ValueError as error:
            fail(f"{name}: {error}")
    run_command(f"tauguard.cli.{name.replace('-', '_')}", name, args[1:], debug)


def run_command(path: str, name: str, args: Sequence[str], debug: bool) -> None:
    """Parse the flags of the function ``command`` in the module ``path`` and call it."""
    if any(OWN.fullmatch(arg) for arg in args):
        sys.path.append(os.getcwd())  # last, so that no file of this folder hides a library
    module = importlib.import_module(path)
    for flag, kind in module.command.__annotations__.items():
        given = f"--{flag.replace('_', '-')}"
        if "tuple[" in str(kind) and args.count(given) > 1:  # the parser would use only the last
            fail(f"{name}: {given} is given twice; several values follow one flag: {given} A B")

    import tyro

    from tauguard.cli.help_text import tidy

    tidy(module.command)
    try:
        tyro.cli(module.command, args=list(args), prog=f"tauguard {name}")
    except BrokenPipeError:
        sys.stderr.close()
    except KeyboardInterrupt as stop:
        print(f"tauguard {name}: stopped", file=sys.stderr)
        raise SystemExit(143 if type(stop) is not KeyboardInterrupt else 130) from None
    except Exception as error:
        if debug:
            raise
        if isinstance(error, TauguardError):
            from tauguard.cli.output import causes, print_findings

            print_findings(error.findings)
            fail(*(f"{name}: {cause}" for cause in causes(error)))
        if isinstance(error, ValueError | OSError):
            fail(f"{name}: {said(error)}")
        kind, wanted = type(error).__name__, os.environ.get("MUJOCO_GL")
        if wanted and "mujoco" not in sys.modules:  # importing it fails without this OpenGL
            fail(
                f"{name}: MUJOCO_GL={wanted}: MuJoCo finds no such OpenGL; install libegl1 for egl "
                "or libosmesa6 for osmesa, or unset it"
            )
        fail(f"{name}: a defect of tauguard (--debug shows where): {kind}: {error}", code=1)


def said(error: Exception) -> str:
    """The message of an error; for an error of the operating system, file and cause."""
    if isinstance(error, FileExistsError) and error.filename is not None:
        return f"{error.filename}: there is a file of that name; expected a folder, or a new name"
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        return f"{error.filename}: {error.strerror.lower()}"
    return str(error)


def expect(flag: str, value: float, least: float, most: float = float("inf")) -> None:
    """Raise ``ArgumentError`` if a flag's number is NaN or outside ``least`` to ``most``."""
    if not least <= value <= most:
        wanted = f"{least:g} or more" if most == float("inf") else f"{least:g} to {most:g}"
        raise ArgumentError(f"{flag} {value:g}: expected {wanted}")


def fail(*messages: str, code: int = 2) -> None:
    """Print one line per message to standard error and exit with ``code`` (``SystemExit``)."""
    for message in messages:
        line = " ".join(as_flags(message).split())
        print("tauguard " + (line if len(line) <= 2000 else line[:2000] + " ..."), file=sys.stderr)
    raise SystemExit(code)
