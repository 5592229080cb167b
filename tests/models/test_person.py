"""A person of capsules: their size is the stature's, and a blow has the standard's peak force."""

import mujoco
import numpy as np
import pytest

from tauguard.models import Person, SceneSpec, compose
from tauguard.models.body_regions import BODY_REGIONS
from tauguard.models.person import LENGTHS, SEGMENTS, STATURES


def test_lengths_are_those_of_the_table():
    """Winter, figure 4.1: heights of knee, hip, shoulder and chin are sums of the lengths."""
    assert LENGTHS["foot"] + LENGTHS["shank"] == pytest.approx(0.285)
    assert LENGTHS["foot"] + LENGTHS["shank"] + LENGTHS["thigh"] == pytest.approx(0.530)
    assert LENGTHS["hip"] + LENGTHS["trunk"] == pytest.approx(0.818)
    assert LENGTHS["hip"] + LENGTHS["trunk"] + LENGTHS["neck"] == pytest.approx(0.870)
    assert LENGTHS["hip"] + LENGTHS["trunk"] + LENGTHS["neck"] + LENGTHS["head"] == pytest.approx(
        1.0
    )


def test_every_capsule_is_a_region_of_the_limits():
    assert {segment.region for segment in SEGMENTS} == set(BODY_REGIONS) - {"face", "back"}


@pytest.mark.parametrize("stature", [STATURES["female 5"], STATURES["male 95"]])
@pytest.mark.parametrize("posture", ["standing", "seated"])
def test_the_capsules_weigh_and_measure_what_they_say(stature, posture):
    person = Person(stature=stature, posture=posture)
    model = compose(SceneSpec(people=(person,))).model
    for part in person.parts():
        geom = model.geom(part.name)
        assert geom.size[0] == pytest.approx(part.segment.radius * stature)
        assert model.body(part.name).mass[0] == pytest.approx(part.limits.mass)
    assert model.nmocap == len(SEGMENTS)


@pytest.mark.parametrize(
    ("keywords", "words"),
    [
        ({"stature": 3.0}, "1 to 2.3 m"),
        ({"posture": "lying"}, "standing, seated"),
        ({"motion": "dance"}, "walk, work, still"),
        ({"hand_speed": 0.0}, "hand_speed"),
        ({"reaction_time": -1.0}, "reaction_time"),
        ({"position": (np.nan, 0.0)}, "finite"),
    ],
)
def test_numbers_that_cannot_be_are_named(keywords, words):
    with pytest.raises(ValueError, match=words):
        Person(**keywords)


RAIL = """
<mujoco>
  <compiler angle="radian"/>
  <option gravity="0 0 0"/>
  <worldbody>
    <body name="link" pos="0 0 {z}">
      <joint name="rail" type="slide" axis="1 0 0" range="-3 3"/>
      <geom type="sphere" size="0.05" mass="{mass}" contype="1" conaffinity="2"/>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.mark.parametrize("region", ["chest", "abdomen", "left_upper_arm", "right_hand", "skull"])
@pytest.mark.parametrize("mass", [2.0, 8.0])
def test_the_peak_of_a_blow_is_that_of_the_two_mass_model(region, mass, tmp_path):
    """A mass on a rail against one capsule, upright where it stands: v sqrt(mu k)."""
    person = Person(position=(0.0, 0.0), floor=0.0)
    part = next(p for p in person.parts() if p.segment.name == region)
    path = tmp_path / "rail.xml"
    path.write_text(RAIL.format(z=part.segment.height * person.stature, mass=mass))
    scene = compose(SceneSpec(arm=str(path), people=(person,), gravity=(0, 0, 0), timestep=2e-4))
    model, data = scene.model, mujoco.MjData(scene.model)
    # Only the struck capsule stays; the others go out of the way.
    for other in person.parts():
        frame = int(model.body(f"{other.name}_motion").mocapid[0])
        if other.name != part.name:
            data.mocap_pos[frame, 1] = 40.0
    speed = 0.5
    data.qpos[scene.qpos_adr], data.qvel[scene.dof_adr] = -0.12 - part.radius, speed
    armature = float(model.dof_armature[scene.dof_adr[0]])
    model.dof_damping[scene.dof_adr] = 0.0
    peak = 0.0
    for _ in range(3000):
        mujoco.mj_step(model, data)
        if peak and not data.ncon:
            break
        force = np.zeros(6)
        for c in range(data.ncon):
            mujoco.mj_contactForce(model, data, c, force)
            peak = max(peak, float(force[0]))
    expected = part.limits.peak_force(speed, mass + armature)
    assert peak == pytest.approx(expected, rel=0.06)
