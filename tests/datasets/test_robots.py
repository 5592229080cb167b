"""Datasets of arms that are not the package's: by file, checked, the same bytes, true labels."""

import hashlib
import json
import shutil
import textwrap

import numpy as np
import pytest

from tauguard.datasets import inspection
from tauguard.datasets.configuration import Configuration, load_configuration
from tauguard.datasets.dataset_folder import HEAD, lines
from tauguard.datasets.generation import generate_dataset
from tauguard.datasets.reader import read
from tauguard.detectors import RobotNumbers, inverse_dynamics
from tauguard.detectors.calibration.nominal import nominal_arm
from tauguard.detectors.features.front_end import FrontEndSettings
from tauguard.envs import CollisionPlan, Episode, Simulation
from tauguard.models import load_arm, pin_model
from tests.models.arms import random_arm

from .conftest import contents

MIXED = """
    name = "mixed"
    seed = 3
    rate = 100
    episodes_per_shard = 1
    [[splits]]
    name = "train"
    episodes = 2
    seconds = 6.6
    struck = 1.0
    individuals = [0]
    speeds = [40]
    severities = [[4, 64]]
    arms = ["cura6", "robots/other.toml"]
"""
#: Of seven joints.
SEED = 3


@pytest.fixture
def described(tmp_path):
    folder = tmp_path / "robots"
    folder.mkdir()
    (folder / "arm.xml").write_text(random_arm(SEED))
    (folder / "other.toml").write_text('file = "arm.xml"\n[drive]\nlike = "cura6"\n')
    (tmp_path / "mixed.toml").write_text(textwrap.dedent(MIXED))
    return tmp_path / "mixed.toml"


def test_any_workers_give_the_same_bytes_and_the_arm_goes_with_them(described, tmp_path):
    configuration = load_configuration(described)
    assert Configuration.from_json(configuration.to_json()) == configuration
    for workers in (1, 2):
        generate_dataset(configuration, tmp_path / str(workers), workers=workers)
    assert contents(tmp_path / "1") == contents(tmp_path / "2")
    assert inspection.verified(tmp_path / "1") == []
    (line,) = [x for x in lines(tmp_path / "1") if x["arm"] == "other"]
    arm = load_arm(str(described.parent / "robots" / "other.toml"))
    assert line["joints"] == list(arm.joints)
    for text in (json.dumps(line), (tmp_path / "1" / HEAD).read_text()):
        assert str(tmp_path) not in text
    own = described.parent / "robots" / "other.toml"
    _, same = inspection.simulated_again(tmp_path / "1", line, own)
    assert same
    with pytest.raises(ValueError, match=r"its file other\.toml is not here; .* by `robot=`"):
        inspection.simulated_again(tmp_path / "1", line)
    with pytest.raises(ValueError, match="arm cura6 comes with the package"):
        inspection.simulated_again(tmp_path / "1", line | {"arm": "cura6"}, own)

    (described.parent / "robots" / "arm.xml").write_text(random_arm(SEED + 1))
    with pytest.raises(ValueError, match=r"arm other: .*other\.toml is not what the dataset was"):
        inspection.simulated_again(tmp_path / "1", line, own)
    with pytest.raises(ValueError, match="holds another dataset"):
        generate_dataset(load_configuration(described), tmp_path / "1", workers=1)


def test_a_dataset_is_trained_on_where_the_arms_file_is_not(described, tmp_path):
    arm = load_arm(str(described.parent / "robots" / "other.toml"))
    there = tmp_path / "there"
    generate_dataset(load_configuration(described), there, workers=1)
    (known,) = read(there, arm="other")
    before = np.array(FrontEndSettings().fit([known], nominal_arm([known])).arm.drive_gain)
    shutil.move(there, tmp_path / "elsewhere")
    shutil.rmtree(described.parent / "robots")
    (stored,) = read(tmp_path / "elsewhere", arm="other")
    assert stored.joint_names == arm.joints
    believed = nominal_arm([stored])
    np.testing.assert_array_equal(believed.drive_gain, arm.facts.drive.gain)
    cycles = np.outer(arm.facts.drive.gear, arm.facts.drive.ripple.cycles)
    np.testing.assert_array_equal(believed.friction.cycles, cycles)
    after = FrontEndSettings().fit([stored], believed).arm.drive_gain
    np.testing.assert_array_equal(after, before)

    path = tmp_path / "elsewhere" / "arms" / "other.drive.json"
    path.write_text(path.read_text().replace("0", "1", 1))
    assert [name for name, _ in inspection.verified(tmp_path / "elsewhere")] == ["arms/other"]
    with pytest.raises(ValueError, match=r"other\.drive\.json: missing or damaged"):
        next(read(tmp_path / "elsewhere", arm="other"))


def test_an_older_dataset_is_read_and_trained_on_while_its_file_is_the_same(described, tmp_path):
    folder = tmp_path / "old"
    generate_dataset(load_configuration(described), folder, workers=1)
    head = json.loads((folder / HEAD).read_text())
    head["format"] = 1
    own = (k.removesuffix(".xml") for k in head["arms_sha256"] if k.endswith(".xml"))
    head["arms_sha256"] = {name: head["arms_sha256"][f"{name}.xml"] for name in own}
    source = described.parent / "robots" / "other.toml"
    head["configuration"]["robots"][0]["source"] = str(source)
    (folder / HEAD).write_text(json.dumps(head))
    (folder / "arms" / "other.drive.json").unlink()
    (stored,) = read(folder, arm="other")
    gain = load_arm(str(source)).facts.drive.gain
    np.testing.assert_array_equal(nominal_arm([stored]).drive_gain, gain)
    own, text = folder / "arms" / "cura6.xml", "<mujoco/>"  # that build's arm, not this one's
    own.write_text(text)
    head["arms_sha256"]["cura6"] = hashlib.sha256(text.encode()).hexdigest()
    (folder / HEAD).write_text(json.dumps(head))
    assert next(read(folder, arm="cura6")).attachments["arm.xml"] == text
    source.write_text(source.read_text() + "torque_constant = 0.3\n")
    (stored,) = read(folder, arm="other")
    with pytest.raises(ValueError, match=r"arm other: an earlier version .* make them again"):
        nominal_arm([stored])
    head["configuration"]["robots"][0]["source"] = "/" + 300 * "x"  # it cannot even be looked at
    (folder / HEAD).write_text(json.dumps(head))
    assert list(next(read(folder, arm="other")).attachments) == ["arm.xml"]


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ("robots/none.urdf", r"splits\[0\]\.arms: arm 'robots/none\.urdf': no such file or name"),
        ("robots/broken.xml", r"splits\[0\]\.arms: arm .*broken\.xml"),
        ("robots/cura6.xml", "expected another file name, cura6 is an arm of the package"),
        ("robots/two words.xml", "expected a file name of letters"),
        ("other.xml", "expected another file name: two arms would be other"),
    ],
)
def test_an_arm_that_cannot_be_is_named_before_anything_is_written(described, asked, message):
    folder = described.parent
    (folder / "robots" / "broken.xml").write_text("<mujoco><worldbody/></mujoco>")
    for name in ("robots/cura6.xml", "robots/two words.xml", "other.xml"):
        (folder / name).write_text(random_arm(SEED))
    described.write_text(described.read_text().replace('"cura6"', f'"{asked}"'))
    with pytest.raises(ValueError, match=message):
        load_configuration(described)


def test_a_split_strikes_links_that_its_arms_have(described):
    few = 'file = "arm.xml"\njoints = ["{}"]\n'.format(
        '", "'.join(load_arm(str(described.parent / "robots" / "arm.xml")).joints[:3])
    )
    (described.parent / "robots" / "other.toml").write_text(few)
    assert load_configuration(described).splits[0].links == (2, 3)
    described.write_text(described.read_text() + "links = [5]\n")
    with pytest.raises(ValueError, match=r"links = \(5,\): expected 1 to 3, links of every arm"):
        load_configuration(described)


@pytest.mark.parametrize("seed", [3, 8])
@pytest.mark.parametrize("kind", ["strike", "clamp", "pulse"])
def test_the_labels_are_what_the_motion_was_pushed_by(tmp_path, seed, kind):
    """Newton's law along the trace: tau_ext = M dv/dt + bias - tau, from Pinocchio's numbers."""
    path = tmp_path / "arm.xml"
    path.write_text(random_arm(seed))
    plans = tuple(CollisionPlan(kind, time=t, link=4) for t in (0.6, 2.2))
    simulation = Simulation(
        Episode(1, 4.0, 60.0, arm=str(path), collisions=plans, ideal_drive=True)
    )
    trace = simulation.run()
    assert trace.truth.collisions
    robot = RobotNumbers.from_pin(pin_model(simulation.scene.arm_xml))
    qdd = np.diff(trace.qd, axis=0) / trace.dt
    needed = inverse_dynamics(robot, trace.q[:-1], trace.qd[:-1], qdd)
    pushed = needed - simulation.scene.drive.gain * trace.current[:-1]
    largest = np.abs(trace.truth.tau_ext).max()
    np.testing.assert_allclose(pushed, trace.truth.tau_ext[:-1], atol=1e-6 * largest)
