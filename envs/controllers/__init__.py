"""Controllers to start from, on the nominal Pinocchio model: each gives joint torques [N m]."""

from tauguard.envs.controllers.admittance import Admittance
from tauguard.envs.controllers.computed_torque import ComputedTorque
from tauguard.envs.controllers.friction import friction_torque
from tauguard.envs.controllers.gravity_pd import GravityPD
from tauguard.envs.controllers.operational_space import OperationalSpace

__all__ = ["Admittance", "ComputedTorque", "GravityPD", "OperationalSpace", "friction_torque"]
