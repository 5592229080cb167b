"""The ROS 2 message types of a trace as ``ros2msg`` schemas, for any MCAP reader."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from tauguard.traces.mcap_cdr import Layout

SEPARATOR = "=" * 80

HEADER = "std_msgs/Header"
TIME = "builtin_interfaces/Time"
POINT = "geometry_msgs/Point"
VECTOR = "geometry_msgs/Vector3"

PARTS = {
    HEADER: "builtin_interfaces/Time stamp\nstring frame_id\n",
    TIME: "int32 sec\nuint32 nanosec\n",
    POINT: "float64 x\nfloat64 y\nfloat64 z\n",
    VECTOR: "float64 x\nfloat64 y\nfloat64 z\n",
}

JOINT_STATE = """\
std_msgs/Header header
string[] name
float64[] position  # measured [rad]
float64[] velocity  # measured [rad/s]
float64[] effort    # empty: the current is on /motor_currents
"""
MOTOR_CURRENTS = """\
std_msgs/Header header
float64 time       # exact sample time [s]; header.stamp is rounded to 1 ns
float64[] current  # measured, signed [A], one per joint
"""
JOINT_COMMAND = """\
std_msgs/Header header
float64[] position      # commanded [rad], empty if not recorded
float64[] velocity      # commanded [rad/s], empty if not recorded
float64[] acceleration  # commanded [rad/s^2], empty if not recorded
"""
CONTACT_TRUTH = """\
std_msgs/Header header
float64[] tau_ext            # torque of contacts and applied wrenches at the joints [N m]
float64 contact_force        # norm of the net external contact force [N]
float64 payload              # mass at the flange, unknown to the observer [kg]
int64 link                   # link of the largest contact force, 0 for none
geometry_msgs/Point point    # point of this contact, world frame [m], NaN for none
geometry_msgs/Vector3 force  # force of this contact on the arm, world frame [N]
"""
OBSTACLES = """\
std_msgs/Header header
string[] name
float64[] pose  # homogeneous world pose of each, 4 x 4, row by row
"""
COLLISION = """\
uint8 STRIKE=0
uint8 CLAMP=1
uint8 PULSE=2
std_msgs/Header header
float64 onset                # first sample with contact force [s]
float64 end                  # last sample with contact force [s]
float64 peak_tau             # largest |tau_ext| over joints 1-4 [N m]
int64 link                   # the struck link, 1-based
geometry_msgs/Point point    # at the sample of peak force, world frame [m]
geometry_msgs/Vector3 force  # peak contact force on the arm, world frame [N]
uint8 kind
"""
DETECTION = """\
std_msgs/Header header
float64 time        # exact sample time [s]
float64[] residual  # the observer's estimate of tau_ext [N m]
float64 score       # the detector's output
float64 threshold   # a score above it is a raw alarm
bool alarm          # after the output filter
"""
ALARM = """\
std_msgs/Header header
float64 start  # [s]
float64 end    # [s]
"""
CHECKED_CONTACT = """\
std_msgs/Header header
string[] partners              # bodies and flexes
float64 time                   # exact time of contact [s]
int64 first                    # indices of both partners in partners, from 0
int64 second
geometry_msgs/Point point      # world frame [m], NaN if unknown
geometry_msgs/Vector3 normal   # from the first partner to the second
float64 distance               # between the surfaces, negative in penetration [m]
"""


#: The definition of each message type, without the types that it contains.
DEFINITIONS = {
    "sensor_msgs/msg/JointState": JOINT_STATE,
    "tauguard_msgs/msg/MotorCurrents": MOTOR_CURRENTS,
    "tauguard_msgs/msg/JointCommand": JOINT_COMMAND,
    "tauguard_msgs/msg/ContactTruth": CONTACT_TRUTH,
    "tauguard_msgs/msg/Obstacles": OBSTACLES,
    "tauguard_msgs/msg/Collision": COLLISION,
    "tauguard_msgs/msg/Detection": DETECTION,
    "tauguard_msgs/msg/Alarm": ALARM,
    "tauguard_msgs/msg/CheckedContact": CHECKED_CONTACT,
}
#: NumPy type and number of elements of each type of field.
NUMBERS: dict[str, tuple[str, int | None]] = {
    "float64": ("f8", None),
    "int64": ("i8", None),
    "uint8": ("u1", None),
    "bool": ("?", None),
    POINT: ("f8", 3),
    VECTOR: ("f8", 3),
}


def schema(name: str) -> str:
    """The definition of a message type, followed by those of the types that it contains."""
    text = DEFINITIONS[name]
    parts = [part for part in PARTS if part in text or part == TIME]
    return f"{SEPARATOR}\n".join([text, *(f"MSG: {part}\n{PARTS[part]}" for part in parts)])


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
    for line in DEFINITIONS[name].splitlines():
        kind, _, rest = line.partition("#")[0].partition(" ")
        if "=" in rest:  # a constant
            continue
        if kind == HEADER:
            found.header()
        elif kind == "string[]":
            found.strings(strings)
        elif kind == "float64[]":
            field = next(names)
            found.sequence(field, lengths.get(field, 0))
        else:
            found.number(next(names), *NUMBERS[kind])
    return found
