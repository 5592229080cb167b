"""How to install an extra, for messages."""


def extra(name: str) -> str:
    """The extra and both ways to it: ``the extra `arms` (pip install ...)``."""
    return f"the extra `{name}` (pip install 'tauguard[{name}]'; here: uv run --extra {name} ...)"
