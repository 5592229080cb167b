"""What is simulated: the arm, its drive train, obstacles and the scene composer."""

from tauguard.models import cura6
from tauguard.models.arm import Arm, Facts, load_arm
from tauguard.models.body_regions import BODY_REGIONS, BodyRegion, body_region, read_regions
from tauguard.models.catalogue import download_arm, named_arms
from tauguard.models.cloth import Cloth
from tauguard.models.drive import Drive, Friction, Ripple, Sensors, cura6_drive
from tauguard.models.drive_text import drive_of, drive_text
from tauguard.models.impact import impact_velocity, largest_force, reflected_mass, standard_mass
from tauguard.models.known_robots import ROBOTS
from tauguard.models.left_over import LeftOver
from tauguard.models.link_surface import LinkSurface, arm_surface, link_surface
from tauguard.models.mismatch import Mismatch
from tauguard.models.nominal import compiled, pin_model
from tauguard.models.obstacles import BodyProxy, Clamp, Striker, Table
from tauguard.models.payload import set_payload
from tauguard.models.person import STATURES, Person
from tauguard.models.picture import check_opengl
from tauguard.models.robot import Robot, RobotDrive
from tauguard.models.scene import Scene, SceneSpec, compose, without_losses
from tauguard.models.scene_objects import SceneObject, Shape, load_objects

__all__ = [
    "BODY_REGIONS", "ROBOTS", "STATURES", "Arm", "BodyProxy", "BodyRegion", "Clamp", "Cloth",
    "Drive", "Facts", "Friction", "LeftOver", "LinkSurface", "Mismatch", "Person", "Ripple",
    "Robot", "RobotDrive", "Scene", "SceneObject", "SceneSpec", "Sensors", "Shape", "Striker",
    "Table", "arm_surface", "body_region", "check_opengl", "compiled", "compose", "cura6",
    "cura6_drive", "download_arm", "drive_of", "drive_text", "impact_velocity", "largest_force",
    "link_surface", "load_arm", "load_objects", "named_arms", "pin_model", "read_regions",
    "reflected_mass", "set_payload", "standard_mass", "without_losses",
]  # fmt: skip
