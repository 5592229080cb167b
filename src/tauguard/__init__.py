"""tauguard: a cobot-safety simulation environment on MuJoCo.

Import the sub-package that you need (``tauguard.cloth`` pulls in
neither MuJoCo nor Pinocchio): ``models``, ``traces``, ``geometry``, ``cloth``, ``rigid``,
``detectors``, ``contacts``, ``envs``, ``datasets``, ``live``, ``replay``,
``report``, ``hard_cases``.

tauguard is a research tool, not a certified safety function.
"""

from importlib.metadata import version

from tauguard.environments import register_environments

__version__ = version("tauguard")

register_environments()
