"""Studies are tried as a user runs them: through the command, in a process of its own."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


def run(*command, cwd, **environment):
    """The finished process, its output as text."""
    return subprocess.run(
        [sys.executable, "-m", *map(str, command)],
        cwd=cwd,
        env=os.environ | environment,
        capture_output=True,
        text=True,
    )


@pytest.fixture
def bench(tmp_path):
    """``bench("cloth-frames")``: a quick run's JSON and what it printed."""

    def quick(name, *flags):
        files = ["--json", tmp_path / "rows.json", "--figure", tmp_path / "figure.png"]
        done = run("tauguard", "bench", name, "--quick", *files, *flags, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")
        return json.loads((tmp_path / "rows.json").read_text()), done.stdout

    return quick


#: Forks a process for each line; what it has imported, they need not import again.
SERVER = """
import json, os, runpy, sys
import matplotlib.pyplot, tauguard.cli.help_text, tauguard.report, typeguard
matplotlib.pyplot.subplots()[0].canvas.draw()
for line in sys.stdin:
    job = json.loads(line)
    child = os.fork()
    if child:
        print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
        continue
    os.chdir(job["cwd"])
    os.environ.update(job["environment"])
    for number, path in enumerate((os.devnull, job["out"], job["err"])):
        os.dup2(os.open(path, os.O_RDWR | os.O_CREAT), number)
    sys.path.insert(0, job["cwd"])
    sys.argv = job["argv"]
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
    break
"""


@pytest.fixture(scope="session")
def server():
    """A process that has imported what studies import first, in a second that each would take."""
    command, pipe = [sys.executable, "-c", SERVER], subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as process:
        yield process
        process.stdin.close()


@pytest.fixture
def forked(server, tmp_path_factory):
    """``forked("studies", "bench", cwd=folder, NAME="value")``: as :func:`run`, sooner."""

    def run(*command, cwd, **environment):
        out, err = (tmp_path_factory.mktemp("forked") / name for name in ("out", "err"))
        job = {"argv": [str(word) for word in command], "cwd": str(cwd), "environment": environment}
        server.stdin.write(json.dumps(job | {"out": str(out), "err": str(err)}) + "\n")
        server.stdin.flush()
        code = int(server.stdout.readline())
        return subprocess.CompletedProcess(command, code, out.read_text(), err.read_text())

    return run
