"""Repairs dm_control for a MuJoCo that is newer than it."""


def repair() -> list[str]:
    """Drop the array names that MuJoCo's structures lack from dm_control's tables.

    dm_control 1.0.50 lists arrays that MuJoCo 4 no longer has, and reads all of them. If the two
    agree, this does nothing.

    Returns:
        The names dropped, as ``structure.name``; empty once it is no longer needed.

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
