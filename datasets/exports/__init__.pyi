"""Public names, for type checkers."""

from tauguard.datasets.exports.lerobot import LEROBOT_VERSION as LEROBOT_VERSION
from tauguard.datasets.exports.lerobot import write_lerobot as write_lerobot
from tauguard.datasets.exports.minari import write_minari as write_minari
