"""Compile an untrusted robot in a separate process first, with limited memory and time.

A process that has loaded MuJoCo forks a child for each robot, and ends after a time without work.
"""

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
from select import select

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
        if "allocate" in str(error):  # refused because of the memory limit
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
            for _ in range(2):  # an idle process may just have ended
                process = self._running()
                if process is None or process.stdin is None:
                    break
                with contextlib.suppress(BrokenPipeError):
                    process.stdin.write(line)
                    process.stdin.flush()
                    return self._answer(process)
                self._end()
        return "the process that compiles it first does not start"

    def _answer(self, process: subprocess.Popen[bytes]) -> str | None:
        assert process.stdout is not None
        if not select([process.stdout], [], [], self.seconds)[0]:
            self._end()
            return f"MuJoCo needs more than {self.seconds:g} s for it"
        answer = process.stdout.readline().strip()
        if answer == b"0":
            return None
        if not answer:
            self._end()
        elif os.WIFSIGNALED(int(answer)) and os.WTERMSIG(int(answer)) == signal.SIGXCPU:
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
