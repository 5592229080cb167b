"""Compute shards on a Ray cluster (extra ``distributed``): one task per shard, one core each."""

import itertools
import logging
from collections.abc import Callable, Generator, Iterable
from typing import Any, TypeVar

from tauguard.extras import extra
from tauguard.findings import ArgumentError

Task = TypeVar("Task")
Result = TypeVar("Result")

#: Tasks submitted for each core; more would only use memory.
WAITING = 2


def on_cluster(
    work: Callable[[Task], Result], tasks: Iterable[Task], address: str
) -> Generator[Result]:
    """Yield the results of ``work`` in the order in which they are ready.

    A task whose node or process is lost is repeated on another node. The folder that the tasks
    write must have the same path on all nodes. All nodes must have the same version of tauguard.

    Args:
        work: function of one task.
        tasks: taken one by one.
        address: of the cluster; "auto": the cluster of this machine; "local": start one here.

    Raises:
        ArgumentError: Ray is not installed.
        OSError: no cluster answers at the address, or the cluster gave up on a task.
    """
    try:
        import ray
    except ImportError:
        raise ArgumentError(f"`ray=` needs {extra('distributed')}") from None
    own = not ray.is_initialized()
    if own:
        _connect(ray, address)
    remote = ray.remote(num_cpus=1, max_retries=-1)(work)
    waiting = iter(tasks)
    pending: list[Any] = []
    try:
        while True:
            room = WAITING * max(int(ray.cluster_resources().get("CPU", 1)), 1) - len(pending)
            pending += [remote.remote(task) for task in itertools.islice(waiting, max(room, 0))]
            if not pending:
                return
            ready, pending = ray.wait(pending, timeout=1.0)
            for reference in ready:
                yield _result(ray, reference)
    finally:
        for reference in pending:
            ray.cancel(reference, force=True)
        if own:
            ray.shutdown()


def _connect(ray: Any, address: str) -> None:
    try:
        ray.init(
            address=None if address == "local" else address,
            include_dashboard=False if address == "local" else None,
            log_to_driver=False,
            logging_level=logging.ERROR,
        )
    except (ConnectionError, ValueError, RuntimeError) as error:
        raise OSError(f'`ray="{address}"`: {" ".join(str(error).split())[:200]}') from None


def _result(ray: Any, reference: Any) -> Any:
    try:
        return ray.get(reference)
    except ray.exceptions.RayTaskError as error:
        cause = error.cause
        if isinstance(cause, ValueError | OSError):
            raise type(cause)(*cause.args) from None
        raise
    except ray.exceptions.RayError as error:
        raise OSError(f"the cluster lost a task: {' '.join(str(error).split())[:200]}") from None
