"""ipctk, the peer of the cloth study, set up alike in every part of it."""

from __future__ import annotations

from typing import Any


def load_ipctk() -> Any:
    """ipctk in one thread, without its warnings of pairs that touch at the start; else ``None``."""
    try:
        import ipctk
    except ImportError:
        return None
    ipctk.set_num_threads(1)
    ipctk.set_logger_level(ipctk.LoggerLevel.error)
    return ipctk
