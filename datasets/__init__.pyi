"""Public names, for type checkers."""

from tauguard.datasets.alarm_files import judged_alarms as judged_alarms
from tauguard.datasets.arm_logs import read_log as read_log
from tauguard.datasets.arm_logs import read_logs as read_logs
from tauguard.datasets.arm_logs import simulated as simulated
from tauguard.datasets.columns import AS_IS as AS_IS
from tauguard.datasets.columns import PRESETS as PRESETS
from tauguard.datasets.columns import ColumnMap as ColumnMap
from tauguard.datasets.columns import Reading as Reading
from tauguard.datasets.configuration import Configuration as Configuration
from tauguard.datasets.configuration import Split as Split
from tauguard.datasets.configuration import load_configuration as load_configuration
from tauguard.datasets.generation import generate_dataset as generate_dataset
from tauguard.datasets.plans import SPEEDS as SPEEDS
from tauguard.datasets.plans import TRAINING_PAYLOADS as TRAINING_PAYLOADS
from tauguard.datasets.plans import DemoPlan as DemoPlan
from tauguard.datasets.plans import collision_plans as collision_plans
from tauguard.datasets.plans import demo_plan as demo_plan
from tauguard.datasets.plans import free_episodes as free_episodes
from tauguard.datasets.plans import struck_episodes as struck_episodes
from tauguard.datasets.plans import torque_scale as torque_scale
from tauguard.datasets.reader import episodes_of_splits as episodes_of_splits
from tauguard.datasets.reader import read as read
from tauguard.datasets.recordings import simulate_all as simulate_all
from tauguard.datasets.recordings import write_dataset as write_dataset
from tauguard.datasets.twin_episodes import TwinEpisodes as TwinEpisodes
from tauguard.datasets.twin_episodes import twin_contacts as twin_contacts
