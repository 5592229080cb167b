"""Worker processes. They end with the command; if one dies, the command fails."""

import contextlib
import multiprocessing
import os
import signal
import threading
import traceback
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from types import FrameType
from typing import Any, TypeVar

from tauguard.atomic_write import remove_parts

Task = TypeVar("Task")
Result = TypeVar("Result")


class WorkerDied(OSError):
    """A worker process ended before its task was done; the message says how."""


class Terminated(KeyboardInterrupt):
    """The command was asked to end (SIGTERM)."""


@contextlib.contextmanager
def terminable() -> Iterator[None]:
    """Context in which SIGTERM raises :class:`Terminated`, so that ``finally`` blocks run."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(number: int, frame: FrameType | None) -> None:
        raise Terminated

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextlib.contextmanager
def writing(
    work: Callable[[Task], Result], tasks: Iterable[Task], workers: int, folder: Path
) -> Iterator[Generator[Result]]:
    """The results of tasks that write files into ``folder``, see :func:`in_processes`.

    When the block ends, also by SIGTERM, no worker and no partly written file is left.
    """
    with terminable():
        results = in_processes(work, tasks, workers)
        try:
            yield results
        finally:
            results.close()  # no worker is left that could still be writing
            remove_parts(folder)


def in_processes(
    work: Callable[[Task], Result], tasks: Iterable[Task], workers: int
) -> Generator[Result]:
    """The results of ``work`` in the order in which they are ready.

    Args:
        work: a function of a module; workers import it by its name.
        tasks: taken one by one, when a worker is free.
        workers: number of processes; 1 computes in this process.

    Raises:
        WorkerDied: a worker was killed.
        Exception: the exception of ``work``. After any exception no worker is left running.
    """
    if workers == 1:
        yield from map(work, tasks)
        return
    waiting = iter(tasks)
    crew: dict[Connection, BaseProcess] = {}
    with contextlib.ExitStack() as stack:
        stack.callback(_end, crew)
        for _ in range(workers):
            task = next(waiting, None)
            if task is None:
                break
            pipe = _hire(work, crew)
            pipe.send(task)
        busy = set(crew)
        ready: deque[Any] = deque()
        while busy:
            ready.extend(wait(list(busy)))
            while ready:
                pipe = ready.popleft()
                result = _receive(pipe, crew[pipe])
                task = next(waiting, None)
                if task is None:
                    busy.discard(pipe)
                else:
                    pipe.send(task)
                yield result


def _hire(work: Callable[[Any], Any], crew: dict[Connection, BaseProcess]) -> Connection:
    """Start a worker and put it into ``crew``; stop signals are deferred until both are done."""
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(theirs, work), daemon=True)
    resource_tracker.ensure_running()  # start() would start it too, and unblock Ctrl-C
    with _stop_signals_deferred(), _ctrl_c_blocked(), _without_opengl():
        process.start()
        crew[ours] = process
    theirs.close()
    return ours


@contextlib.contextmanager
def _stop_signals_deferred() -> Iterator[None]:
    """Context that defers SIGINT and SIGTERM until its end.

    Masking the signals in this thread is not enough: another thread would receive them.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    caught: list[int] = []
    before = {
        number: signal.signal(number, lambda number, frame: caught.append(number))
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    for caught_number in caught:
        signal.raise_signal(caught_number)


@contextlib.contextmanager
def _ctrl_c_blocked() -> Iterator[None]:
    """Block Ctrl-C in processes started here, which inherit the mask; their parent ends them."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def _without_opengl() -> Iterator[None]:
    """Context in which started processes do not load OpenGL, because workers draw nothing.

    GLFW starts another process to find its version; if that is stopped, it prints an error.
    """
    before = os.environ.get("MUJOCO_GL")
    os.environ["MUJOCO_GL"] = "disable"
    try:
        yield
    finally:
        os.environ.pop("MUJOCO_GL")
        if before is not None:
            os.environ["MUJOCO_GL"] = before


def _serve(pipe: Connection, work: Callable[[Any], Any]) -> None:
    """Do tasks until the pipe is closed."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    while True:
        try:
            task = pipe.recv()
        except EOFError:
            return
        try:
            answer: tuple[Any, BaseException | None, str] = (work(task), None, "")
        except Exception as error:
            answer = (None, error, traceback.format_exc())
        try:
            pipe.send(answer)
        except OSError:
            return


def _end_with_parent() -> None:
    """End this worker as soon as the parent has died, so that it does not disturb a new run."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    wait([parent.sentinel])
    os._exit(1)


def _receive(pipe: Connection, process: BaseProcess) -> Any:
    try:
        result, error, trace = pipe.recv()
    except (EOFError, ConnectionError):
        process.join(1)  # the worker closed its pipe, so it is about to end
        code = process.exitcode or 0
        how = f"signal {-code}" if code < 0 else f"exit code {code}"
        raise WorkerDied(f"a worker process died ({how})") from None
    if error is not None:
        if not isinstance(error, ValueError | OSError):
            error.add_note(trace)
        raise error
    return result


def _end(crew: dict[Connection, BaseProcess]) -> None:
    for process in crew.values():
        process.kill()
    for pipe, process in crew.items():
        process.join(2)
        pipe.close()
