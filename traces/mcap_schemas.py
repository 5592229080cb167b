"""The ROS 2 message types of a trace: definitions for any MCAP reader, and layouts for ours.

Each type is a file of the folder ``ros``, in the form of a ROS 2 package.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from importlib.resources import files
from types import MappingProxyType

from tauguard.traces.mcap_cdr import Layout

SEPARATOR = "=" * 80
#: NumPy type and number of elements of each type of field.
NUMBERS: dict[str, tuple[str, int | None]] = {
    "float64": ("f8", None),
    "int64": ("i8", None),
    "uint8": ("u1", None),
    "bool": ("?", None),
    "geometry_msgs/Point": ("f8", 3),
    "geometry_msgs/Vector3": ("f8", 3),
}


@cache
def definition(name: str) -> str:
    """The definition of a type, such as ``sensor_msgs/msg/JointState``."""
    package, *_, kind = name.split("/")
    return files("tauguard.traces").joinpath(f"ros/{package}/msg/{kind}.msg").read_text("utf-8")


def schema(name: str) -> str:
    """The definition of a type, followed by those of the types that it contains."""
    parts = [f"MSG: {part}\n{definition(part)}" for part in dict.fromkeys(_parts(name))]
    return f"{SEPARATOR}\n".join([definition(name), *parts])


def _parts(name: str) -> Iterator[str]:
    for line in definition(name).splitlines():
        kind = line.partition(" ")[0]
        if "/" in kind:
            yield kind
            yield from _parts(kind)


def layout(
    name: str,
    fields: Sequence[str],
    strings: Sequence[str] = (),
    lengths: Mapping[str, int] = MappingProxyType({}),
) -> Layout:
    """The layout of a message type.

    Args:
        name: the type.
        fields: a name for each field of numbers, in the order of the definition.
        strings: content of the field that is a list of strings.
        lengths: number of elements of each field that is a sequence (default: 0).
    """
    found, names = Layout(), iter(fields)
    for line in definition(name).splitlines():
        kind, _, rest = line.partition("#")[0].partition(" ")
        if "=" in rest:  # a constant
            continue
        if kind == "std_msgs/Header":
            found.header()
        elif kind == "string[]":
            found.strings(strings)
        elif kind == "float64[]":
            field = next(names)
            found.sequence(field, lengths.get(field, 0))
        else:
            found.number(next(names), *NUMBERS[kind])
    return found
