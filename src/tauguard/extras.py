"""Text for messages on how to install an extra."""


def extra(name: str) -> str:
    """The name of the extra and the commands to install it."""
    return f"the extra `{name}` (pip install 'tauguard[{name}]'; here: uv run --extra {name} ...)"
