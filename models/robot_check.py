"""Check untrusted robot files: the files they name, and a first compilation in a separate process.

MuJoCo's compiler can crash on XML that looks valid, so a file is compiled in a process of limited
memory and time first. A process that has loaded MuJoCo forks a child for each robot, and ends after
a time without work.
"""

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
import xml.etree.ElementTree as ElementTree
from functools import lru_cache
from itertools import product
from pathlib import Path
from select import select

from tauguard.findings import ArgumentError
from tauguard.untrusted_input import read_text, reading

#: Limits of one trial: memory beyond that of the loaded MuJoCo [bytes], and time [s].
MOST_MEMORY, MOST_SECONDS = 1 << 30, 10.0
#: Limit of the processor time of one trial [s]. A model that passes is compiled up to twice more;
#: the sum stays below ``MOST_SECONDS`` on an idle processor.
MOST_WORK = 3
#: Time limit for loading MuJoCo on a busy machine [s].
LOADING = 60.0
#: An idle process ends after this time [s].
IDLE = 20

#: Code of a trial; a request holds the path of a file or its text.
COMPILE = """
spec = mujoco.MjSpec.from_string(what["text"]) if "text" in what else \\
    mujoco.MjSpec.from_file(what["path"])
spec.compile()
"""
_SERVER = """
import json, os, signal, sys
import mujoco
memory, idle, seconds = map(int, sys.argv[1:4])
work = compile(sys.argv[4], "trial", "exec")
def limit():
    import resource
    with open("/proc/self/statm") as statm:
        most = int(statm.read().split()[0]) * resource.getpagesize() + memory
    for kind, soft in ((resource.RLIMIT_AS, most), (resource.RLIMIT_CPU, seconds)):
        hard = resource.getrlimit(kind)[1]
        resource.setrlimit(kind, (soft if hard < 0 else min(soft, hard), hard))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
def trial(what):
    try:
        exec(work, {"mujoco": mujoco, "what": what, "os": os, "signal": signal})
    except ValueError as error:
        if "allocate" in str(error):  # the memory limit, of which MuJoCo has no other sign
            raise
signal.signal(signal.SIGINT, signal.SIG_IGN)
print("ready", flush=True)
while True:
    signal.alarm(idle)
    line = sys.stdin.readline()
    signal.alarm(0)
    if not line:
        os._exit(0)
    child = os.fork()
    if child == 0:
        os.dup2(2, 1)
        try:
            if os.path.exists("/proc/self/statm"):
                limit()
            trial(json.loads(line))
        except BaseException:
            os._exit(1)
        os._exit(0)
    print(os.waitpid(child, 0)[1], flush=True)
"""


class Trial:
    """Compiles robots in a separate process; safe to use from several threads and after a fork.

    Systems without ``fork`` (Windows) skip the trial; those without ``/proc`` (macOS) have no limit
    of memory.

    Args:
        work: Python code with the variables ``what``, a request, and ``mujoco``.
        seconds: time limit for one robot.
    """

    def __init__(self, work: str = COMPILE, seconds: float = MOST_SECONDS) -> None:
        """Keep the settings; the process starts with the first request."""
        self._work, self.seconds = work, seconds
        self._lock, self._owner = threading.Lock(), 0
        self._process: subprocess.Popen[bytes] | None = None

    def of(self, **what: str) -> str | None:
        """Try a robot: None if MuJoCo compiles or refuses it, otherwise the failure as text.

        Args:
            what: ``path`` of a file, or its ``text``.
        """
        if not hasattr(os, "fork"):
            return None
        line = json.dumps(what).encode() + b"\n"
        if self._owner != os.getpid():  # the process belongs to the parent
            self._lock, self._process, self._owner = threading.Lock(), None, os.getpid()
        with self._lock:
            for _ in range(2):  # an idle process may just have ended, also after the request
                process = self._running()
                if process is None or process.stdin is None or process.stdout is None:
                    break
                with contextlib.suppress(BrokenPipeError):
                    process.stdin.write(line)
                    process.stdin.flush()
                    if not select([process.stdout], [], [], self.seconds)[0]:
                        self._end()
                        return f"MuJoCo needs more than {self.seconds:g} s for it"
                    if status := process.stdout.readline().strip():
                        return self._failure(int(status))
                self._end()
        return "the process that tries to compile it ends unexpectedly"

    def _failure(self, status: int) -> str | None:
        if status == 0:
            return None
        if os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGXCPU:
            return f"MuJoCo needs more than {MOST_WORK} s of processor time for it"
        return (
            f"MuJoCo does not survive it (a crash, or more than {MOST_MEMORY >> 30} GiB of memory)"
        )

    def _running(self) -> subprocess.Popen[bytes] | None:
        if self._process is None or self._process.poll() is not None:
            limits = map(str, (MOST_MEMORY, IDLE, MOST_WORK))
            command = [sys.executable, "-c", _SERVER, *limits, self._work]
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
            )
            out = self._process.stdout
            if out is None or not select([out], [], [], LOADING)[0] or not out.readline():
                self._end()
        return self._process

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        with contextlib.suppress(OSError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()


#: Largest number of files that include one another.
MOST_INCLUDES = 100

#: Attributes that name a file: `file`, and one for each side of a cube's texture.
FILES = ("file", *(f"file{side}" for side in ("right", "left", "up", "down", "front", "back")))

#: The process that compiles files first.
TRIAL = Trial()


def checked_robot(path: Path) -> Path:
    """Check that ``path`` names only files of its folder and does not crash MuJoCo; returns it.

    A file that MuJoCo merely refuses passes, because its later compilation reports the reason.

    Raises:
        ArgumentError: a file outside the robot's folder is named, or MuJoCo crashes or needs more
            than 1 GiB, 3 s of processor time or 10 s.
        OSError: cannot be read.
    """
    stamp = os.stat(path)
    _check(str(path.resolve()), stamp.st_mtime_ns, stamp.st_size)
    return path


def checked_text(text: str) -> str:
    """Check that the ``text`` of a robot does not crash MuJoCo; returns it.

    Raises:
        ArgumentError: as for :func:`checked_robot`.
    """
    _check_text(text)
    return text


@lru_cache(maxsize=64)
def _check_text(text: str) -> None:
    wrong = TRIAL.of(text=text)
    if wrong:
        raise ArgumentError(wrong)


@lru_cache(maxsize=256)
def _check(path: str, mtime: int, size: int) -> None:
    _check_names(Path(path))
    wrong = TRIAL.of(path=path)
    if wrong:
        raise ArgumentError(f"{path}: {wrong}")


def _check_names(path: Path) -> None:
    """Check that every file and folder that the robot names lies in the folder of its file."""
    folder, waiting, seen = path.parent.resolve(), [path], set[Path]()
    while waiting:
        one = waiting.pop()
        if one in seen:
            continue
        seen.add(one)
        if len(seen) > MOST_INCLUDES:
            raise ArgumentError(f"{path}: more than {MOST_INCLUDES} files include one another")
        with reading(one, "expected the XML of a robot"):
            root = ElementTree.fromstring(read_text(one))
        dirs = [folder]
        for compiler in root.iter("compiler"):
            for key in ("meshdir", "texturedir", "assetdir"):
                if key in compiler.attrib:
                    dirs.append(_inside(path, folder, folder, compiler.attrib[key]))
        for element in root.iter():
            names = [element.attrib[key] for key in FILES if key in element.attrib]
            for name, where in product(names, dirs):
                target = _inside(path, folder, where, name)
                if element.tag == "include" and target.is_file():
                    waiting.append(target)


def _inside(robot: Path, folder: Path, where: Path, name: str) -> Path:
    target = (where / name.replace("\\", "/")).resolve()  # both separate folders in MuJoCo
    if not target.is_relative_to(folder):
        raise ArgumentError(f"{robot}: names {name!r}, a file outside its folder {folder}")
    return target
