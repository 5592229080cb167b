"""A person in the environments: motion, what they feel, and the same bits from the same seed."""

from dataclasses import replace

import gymnasium as gym
import mujoco
import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv

from oracles.contact_forces import contact_forces
from oracles.reaction_swings import planned
from tauguard.environments import ENVIRONMENTS
from tauguard.envs.gym.people import draw_script
from tauguard.models import Person, SceneObject, Shape, Table
from tauguard.models.person import SEGMENTS

REACH = "tauguard:tauguard/Reach-v0"
FAR = Person(position=(4.0, 0.0))


def moved(person, seconds, seed=0, control_rate=100):
    """Centres of every capsule (T, 15, 3), positions of the frames, at every action."""
    env = gym.make(REACH, obstacles=(person,), control_rate=control_rate).unwrapped
    env.reset(seed=seed)
    rows = []
    for _ in range(round(seconds * control_rate)):
        env.step(np.zeros(6))
        rows.append(env.data.mocap_pos.copy())
    return env, np.array(rows)


def ends(env, name):
    """Both ends of a capsule's straight part [m]."""
    geom = env.data.geom(name)
    half = env.model.geom(name).size[1] * geom.xmat.reshape(3, 3)[:, 2]
    return geom.xpos - half, geom.xpos + half


@pytest.mark.parametrize("posture", ["standing", "seated"])
def test_limbs_keep_their_lengths_and_hang_together(posture):
    person = Person(position=(4.0, 0.0), posture=posture)
    env, _ = moved(person, 1.0)
    for _ in range(40):
        for _ in range(7):
            env.step(np.zeros(6))
        for side in ("left", "right"):
            parts = [ends(env, f"person_{side}_{part}") for part in ("upper_arm", "lower_arm")]
            gap = min(np.linalg.norm(a - b) for a in parts[0] for b in parts[1])
            assert gap < 1e-6
            legs = [ends(env, f"person_{side}_{part}") for part in ("thigh", "lower_leg")]
            assert min(np.linalg.norm(a - b) for a in legs[0] for b in legs[1]) < 1e-6
        shoulders = [ends(env, f"person_{side}_upper_arm") for side in ("left", "right")]
        width = min(np.linalg.norm(a - b) for a in shoulders[0] for b in shoulders[1])
        assert width <= 2 * person.length("shoulder") + 1e-6


def test_motion_is_smooth_and_no_faster_than_people_work():
    person = Person(position=(4.0, 0.0), hand_speed=1.0, walk_speed=1.0)
    _, rows = moved(person, 25.0)
    speed = np.linalg.norm(np.diff(rows, axis=0), axis=2) * 100
    hands = [k for k, s in enumerate(SEGMENTS) if s.region == "hand"]
    assert speed.max() < 3.0
    assert np.quantile(speed[:, hands], 0.95) < 1.6
    assert speed[:, hands].max() > 0.5
    pelvis = rows[:, 4]
    assert np.linalg.norm(pelvis - pelvis[0], axis=1).max() > 0.3  # walked
    feet = [k for k, s in enumerate(SEGMENTS) if s.region == "lower_leg"]
    assert (rows[:, feet, 2] > person.floor).all()


def test_who_stands_still_stands_still():
    _, rows = moved(Person(position=(4.0, 0.0), motion="still"), 3.0)
    assert np.ptp(rows, axis=0).max() < 1e-12


def struck(**keywords):
    """The arm runs into a person who stands in front of it; infos of every action."""
    standing = gym.make("tauguard/React-v1", obstacles=("person",)).unwrapped.compiled.person
    someone = replace(standing, **keywords)
    env = gym.make("tauguard/React-v1", obstacles=(someone,), detector="observer").unwrapped
    env.reset(seed=3)
    infos = []
    for speeds in planned(env, 0.5):
        env.batch.plants[0].override(1, speeds)
        infos.append(env.step(np.zeros(6))[4])
    env.batch.plants[0].override(1, np.zeros(6))
    for _ in range(80):
        infos.append(env.step(np.zeros(6))[4])
    return env, infos


def test_info_says_where_how_hard_and_how_late():
    env, infos = struck(reacts=False)
    worst = max(infos, key=lambda info: info["region_force"].max())
    k = int(worst["region_force"].argmax())
    name = env.regions[k].name
    assert name.startswith("person_")
    assert worst["region_force"][k] == pytest.approx(worst["force"], rel=0.5)
    direction = worst["region_direction"][k]
    assert np.linalg.norm(direction) == pytest.approx(1.0)
    assert direction[1] > 0.5  # the swing goes along y
    away = np.linalg.norm(worst["region_point"][k] - env.data.body(name).xpos)
    assert away < 0.4
    assert worst["region_pressure"][k] > 0
    peak = max(np.abs(info["tau_ext_peak"]).max() for info in infos)
    assert peak >= max(np.abs(info["tau_ext"]).max() for info in infos)
    onset = next(i for i, info in enumerate(infos) if info["onset"])
    alarm = next(i for i in range(onset, len(infos)) if infos[i]["alarm"])
    delay = infos[alarm]["alarm_delay"]
    assert (alarm - onset - 1) * 0.01 <= delay <= (alarm - onset + 1) * 0.01
    assert infos[onset - 1]["alarm_delay"] == -1


def test_a_touched_person_steps_back_after_their_reaction_time():
    env, infos = struck(reacts=True, reaction_time=0.2)
    onset = next(i for i, info in enumerate(infos) if info["onset"])
    assert onset < len(infos) - 60
    body = env.data.body("person_chest_motion").xpos
    assert body[1] > env.compiled.person.position[1] + 0.1
    still, others = struck(reacts=False)
    assert still.data.body("person_chest_motion").xpos[1] == pytest.approx(
        still.compiled.person.position[1]
    )
    # Before the reaction time both are the same.
    for a, b in zip(infos[: onset + 19], others, strict=False):
        assert a["force"] == b["force"]


@pytest.mark.parametrize("name", sorted(ENVIRONMENTS))
def test_native_and_single_have_the_same_bits_with_a_person(name):
    keywords = {"obstacles": ("person",), "max_episode_steps": 9}
    sync = SyncVectorEnv([lambda: gym.make(name, **keywords)] * 2)
    vector = gym.make_vec(name, num_envs=2, threads=2, **keywords)
    first, again = sync.reset(seed=4), vector.reset(seed=4)
    assert np.array_equal(first[0], again[0])
    vector.action_space.seed(0)
    for _ in range(24):
        actions = vector.action_space.sample()
        a, b = sync.step(actions), vector.step(actions)
        assert np.array_equal(a[0], b[0])
        for key in ("region_force", "region_point", "tau_ext_peak", "cost"):
            assert np.array_equal(a[4][key], b[4][key]), key


def test_an_episode_knows_nothing_of_the_one_before():
    env = gym.make(REACH).unwrapped
    first, _ = env.reset(seed=2)
    for _ in range(30):
        env.step(np.full(6, 0.5))
    again, info = env.reset(seed=2)
    assert np.array_equal(first, again)
    assert not info["region_force"].any()
    assert not info["tau_ext_peak"].any()


def test_a_script_is_the_seeds():
    a, b, c = (draw_script(FAR, np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert all(np.array_equal(x, y) for x, y in zip(a, b, strict=True))
    assert not np.array_equal(a[0], c[0])


def test_forces_on_a_person_are_the_engines():
    env = gym.make(REACH, control="cartesian", control_rate=1000).unwrapped
    env.reset(seed=1)
    model, data, found = env.model, env.data, 0
    for _ in range(6000):
        way = env.batch.observation[0, 21:24]
        _, _, _, _, info = env.step(np.append(np.clip(way / 0.02, -1, 1), np.zeros(3)))
        total = {}
        for contact, on_second in contact_forces(model, data):
            for geom, sign in zip(contact.geom, (-1, 1), strict=True):
                body = int(model.geom_bodyid[geom])
                total[body] = total.get(body, 0) + sign * on_second
        for k, region in enumerate(env.regions):
            force = total.get(region.body, np.zeros(3))
            ours = info["region_force"][k] * info["region_direction"][k]
            assert ours == pytest.approx(force, abs=1e-9 + 1e-9 * np.linalg.norm(force))
            found += np.linalg.norm(force) > 1
        if found > 50:
            break
    assert found > 50


def test_obstacles_say_what_would_work():
    with pytest.raises(ValueError, match="person, skull"):
        gym.make(REACH, obstacles=("persn",))
    with pytest.raises(ValueError, match="'person' twice"):
        gym.make(REACH, obstacles=("person", "person"))


def test_several_people_are_each_as_if_alone():
    """Their regions follow one another, and each moves as the only person with the same script."""
    other = Person(position=(-0.2, 1.4), facing=-np.pi / 2)
    both = gym.make(REACH, obstacles=("person", other)).unwrapped
    both.reset(seed=3)
    assert len(both.regions) == 30
    assert both.regions[15].name == "person2_skull"
    alone = gym.make(REACH, obstacles=(other,)).unwrapped
    alone.reset(seed=3)
    batch = alone.batch
    batch.reaches[0], batch.walks[0] = both.batch.reaches[0, 2:], both.batch.walks[0, 8:]
    batch.start(0)
    for _ in range(150):
        both.step(np.zeros(6))
        alone.step(np.zeros(6))
    model, data = both.model, both.data
    for region in alone.regions:
        twin = region.name.replace("person_", "person2_")
        there = data.body(f"{twin}_motion").xpos
        assert there == pytest.approx(alone.data.body(f"{region.name}_motion").xpos, abs=1e-12)
    state = both.get_state()
    once = both.step(np.full(6, 0.1))[0]
    both.set_state(state)
    assert np.array_equal(both.step(np.full(6, 0.1))[0], once)
    assert model.ngeom > 30


def test_a_second_person_is_felt_limited_and_costed():
    """A person placed into the tool's path is hit although they are not the first."""
    other = Person(position=(0.0, 0.45), facing=-np.pi / 2, motion="still", reacts=False)
    env = gym.make(REACH, obstacles=(FAR, other), control="joint_velocity").unwrapped
    env.reset(seed=0)
    hit = np.zeros(30)
    for _ in range(250):
        *_, info = env.step(np.array([1.0, 0, 0, 0, 0, 0]))
        hit = np.maximum(hit, info["region_force"])
        if hit.max() > 50:
            break
    assert hit[:15].max() == 0
    assert hit[15:].max() > 50
    assert env.regions[info["region"] - 1].name.startswith("person2_")


def test_walks_go_round_tables_and_objects_and_a_step_back_ends_before_them():
    """A table to the left, a pillar behind on the right: no leg is ever inside either."""
    box = Shape("box", size=(0.1, 0.1, 0.8))
    pillar = SceneObject("pillar", shapes=(box,), position=(1.9, -0.7, 0.0))
    table = Table(position=(1.1, 1.15, 0.0), half_extents=(0.3, 0.5, 0.05))
    env = gym.make(
        "tauguard/Reach-v0",
        obstacles=(Person(position=(1.4, 0.0), motion="walk"),),
        table=table,
        objects=(pillar,),
        max_episode_steps=10**6,
    ).unwrapped
    model, data = env.model, env.data
    legs = [model.geom(p).id for p in ("person_pelvis", "person_left_thigh", "person_right_thigh")]
    around = [model.geom("table").id] + [
        g for g in range(model.ngeom) if model.body(model.geom_bodyid[g]).name == "pillar"
    ]
    walked, nearest = 0.0, np.inf
    for seed in range(4):
        env.reset(seed=seed)
        for _ in range(500):
            env.step(np.zeros(6))
            hip = data.geom_xpos[legs[0]]
            walked = max(walked, float(np.hypot(hip[0] - 1.4, hip[1])))
            for leg in legs:
                for other in around:
                    far = mujoco.mj_geomDistance(model, data, leg, other, 1.0, None)
                    nearest = min(nearest, far)
    assert walked > 0.5
    assert nearest > 0.05  # a leg of who walks straight comes within 5 mm


def test_who_stands_between_walls_does_not_walk():
    person = Person(position=(1.0, 0.0), motion="walk")
    walls = np.array([[0.0, 0.35, 3.0, 0.45], [0.0, -0.45, 3.0, -0.35]])
    _, walks = draw_script(person, np.random.default_rng(0), walls)
    assert np.ptp(walks[:, 2]) < 0.1
    _, free = draw_script(person, np.random.default_rng(0))
    assert np.ptp(free[:, 2]) > 0.5
