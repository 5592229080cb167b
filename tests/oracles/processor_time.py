"""Processor time of blocks and of methods, by part."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def clock(spent: dict[str, float], part: str) -> Iterator[None]:
    """Add the processor time of the block to the part."""
    began = time.process_time()
    yield
    spent[part] += time.process_time() - began


def count_time(spent: dict[str, float], part: str, owner: object, name: str) -> None:
    """Let a method of one object count the processor time that it takes."""
    method: Callable[..., object] = getattr(owner, name)

    def counted(*arguments: object, **options: object) -> object:
        with clock(spent, part):
            return method(*arguments, **options)

    setattr(owner, name, counted)
