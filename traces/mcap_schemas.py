"""The ROS 2 message types of a trace as ``ros2msg`` schemas, for any MCAP reader."""

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


def complete(text: str, *parts: str) -> str:
    """A message definition, followed by the definitions of the types that it contains."""
    sections = [text, *(f"MSG: {name}\n{PARTS[name]}" for name in parts)]
    return f"{SEPARATOR}\n".join(sections)


SCHEMAS = {
    "sensor_msgs/msg/JointState": complete(JOINT_STATE, HEADER, TIME),
    "tauguard_msgs/msg/MotorCurrents": complete(MOTOR_CURRENTS, HEADER, TIME),
    "tauguard_msgs/msg/JointCommand": complete(JOINT_COMMAND, HEADER, TIME),
    "tauguard_msgs/msg/ContactTruth": complete(CONTACT_TRUTH, HEADER, TIME, POINT, VECTOR),
    "tauguard_msgs/msg/Obstacles": complete(OBSTACLES, HEADER, TIME),
    "tauguard_msgs/msg/Collision": complete(COLLISION, HEADER, TIME, POINT, VECTOR),
    "tauguard_msgs/msg/Detection": complete(DETECTION, HEADER, TIME),
    "tauguard_msgs/msg/Alarm": complete(ALARM, HEADER, TIME),
    "tauguard_msgs/msg/CheckedContact": complete(CHECKED_CONTACT, HEADER, TIME, POINT, VECTOR),
}
