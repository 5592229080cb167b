"""Make dm_control work with a newer MuJoCo."""


def repair() -> list[str]:
    """Remove array names from dm_control's tables if MuJoCo's structures lack them.

    dm_control 1.0.50 lists arrays that MuJoCo 4 no longer has, and reads all of them.

    Returns:
        The removed names, as ``structure.name``; empty if nothing had to be removed.

    Raises:
        ImportError: dm_control is not installed (it has no wheels for Python 3.13 and later).
    """
    import mujoco

    try:
        from dm_control.mujoco.wrapper.mjbindings import sizes
    except ImportError as error:
        raise ImportError(
            "dm_control is not installed: it has wheels for Python 3.12 and earlier only"
        ) from error
    dropped = []
    structures = {"mjmodel": mujoco.MjModel, "mjdata": mujoco.MjData}
    for name, structure in structures.items():
        table = sizes.array_sizes[name]
        for field in [field for field in table if not hasattr(structure, field)]:
            del table[field]
            dropped.append(f"{name}.{field}")
    return dropped
