"""The MuJoCo library that the Python binding has loaded, for code that calls it natively."""

import ctypes
import functools
from pathlib import Path

import mujoco


@functools.cache
def library() -> ctypes.CDLL:
    """The loaded library.

    Raises:
        OSError: the folder of the Python binding has no library.
    """
    folder = Path(mujoco.__file__).parent
    names = [*folder.glob("libmujoco.so*"), *folder.glob("libmujoco*.dylib")]
    if not names:
        raise OSError(f"no MuJoCo library beside its Python binding in {folder.name}")
    return ctypes.CDLL(str(names[0]))


@functools.cache
def function_address(name: str) -> int:
    """The address of a function of the library."""
    address = ctypes.cast(getattr(library(), name), ctypes.c_void_p).value
    assert address is not None
    return address


@functools.cache
def variable_address(name: str) -> int:
    """The address of a global variable of the library."""
    return ctypes.addressof(ctypes.c_void_p.in_dll(library(), name))
