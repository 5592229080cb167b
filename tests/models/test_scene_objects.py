"""Things of your own in a scene: where they are, what they weigh, what touching them exerts."""

import json

import gymnasium as gym
import mujoco
import numpy as np
import pytest
import trimesh

from oracles.contact_forces import contact_forces
from tauguard.envs import Episode, simulate
from tauguard.models import SceneObject, SceneSpec, Shape, Table, compose, load_objects

REACH = "tauguard:tauguard/Reach-v0"
BALL = Shape("sphere", (0.05,))


def make(*objects, **keywords):
    return gym.make(REACH, obstacles=(), objects=objects, **keywords).unwrapped


def test_a_moving_object_is_where_its_path_says_at_every_physics_step():
    path = ((0, 1.0, 1.0, 0.0), (0.5, 1.2, 1.0, 0.3), (0.8, 1.0, 1.0, 0.0))
    env = make(SceneObject("cart", (BALL,), path=path))
    env.reset(seed=0)
    times, places = np.array(path)[:, 0], np.array(path)[:, 1:]
    for _ in range(120):
        env.step(np.zeros(6))
        t = (np.arange(10) * 1e-3 + env.data.time - 0.01 - 1e-9) % times[-1] + 1e-9
        wanted = np.transpose([np.interp(t, times, column) for column in places.T])
        seen = env.batch.region["position"][0, :, 0]
        # A row is the state before its step, and MuJoCo places mocap bodies in the step.
        assert np.abs(seen[1:] - wanted[:-1]).max() < 2e-3
    assert env.regions[0].name == "cart"


def test_a_loose_part_comes_to_rest_in_a_bin_and_weighs_what_it_says():
    floor = Shape("box", (0.2, 0.2, 0.01))
    part = SceneObject("part", (BALL,), motion="free", mass=0.7, position=(0.6, 0.5, 0.2))
    env = make(SceneObject("bin", (floor,), position=(0.6, 0.5, 0.0)), part)
    env.reset(seed=0)
    for _ in range(150):
        _, _, _, _, info = env.step(np.zeros(6))
    assert env.model.body("part").mass == pytest.approx(0.7)
    assert env.data.body("part").xpos == pytest.approx([0.6, 0.5, 0.06], abs=2e-3)
    # The bin carries the part; only what the arm does to them counts.
    assert info["region_force"].tolist() == [0, 0]


@pytest.mark.parametrize(
    ("ground", "height"),
    [({"table": Table((0.6, 0.5, 0.1), (0.3, 0.3, 0.02))}, 0.12), ({"floor": True}, 0.0)],
    ids=["table", "floor"],
)
def test_a_free_part_lies_on_table_and_floor(ground, height):
    part = SceneObject("part", (BALL,), motion="free", mass=0.7, position=(0.6, 0.5, height + 0.1))
    model = compose(SceneSpec(objects=(part,), **ground)).model
    data = mujoco.MjData(model)
    for _ in range(2000):
        mujoco.mj_step(model, data)
    assert data.body("part").xpos == pytest.approx([0.6, 0.5, height + 0.05], abs=2e-3)
    sunk = SceneObject("part", (BALL,), motion="free", mass=0.7, position=(0.6, 0.5, height))
    with pytest.raises(ValueError, match="part is 50 mm inside"):
        compose(SceneSpec(objects=(sunk,), **ground))


def test_a_held_part_is_the_arms_and_the_controller_does_not_know_it():
    held = SceneObject("part", (BALL,), motion="held", mass=1.5, position=(0, 0, 0.1))
    bare, scene = compose(SceneSpec()), compose(SceneSpec(objects=(held,)))
    assert scene.model.body_mass.sum() == pytest.approx(bare.model.body_mass.sum() + 1.5)
    assert scene.arm_model.body_mass.sum() == pytest.approx(bare.arm_model.body_mass.sum())
    data = mujoco.MjData(scene.model)
    mujoco.mj_kinematics(scene.model, data)
    flange = data.site("flange")
    wanted = flange.xpos + 0.1 * flange.xmat.reshape(3, 3)[:, 2]
    assert data.geom("part_0").xpos == pytest.approx(wanted, abs=1e-6)
    assert scene.model.geom("part_0").bodyid[0] == scene.link_bodies[-1]


def test_the_force_on_an_object_is_what_mujoco_says_and_costs_beyond_its_limits():
    """The tool sinks onto a block; the truth is mj_contactForce of every contact with it."""
    start = make()
    start.reset(seed=0)
    x, y, z = start.batch.observation[0, 18:21]
    block = SceneObject(
        "block",
        (Shape("box", (0.2, 0.2, 0.05)),),
        position=(x, y, z - 0.25),
        quasi_static_limit=20.0,
        transient_limit=50.0,
    )
    env = make(block, control="cartesian")
    env.reset(seed=0)
    cost = touched = 0.0
    for _ in range(100):
        _, _, _, _, info = env.step(np.array([0, 0, -1, 0, 0, 0]))
        last = np.linalg.norm(sum(force for _, force in contact_forces(env.model, env.data)))
        assert info["region_force"][0] >= last - 1e-6
        touched, cost = max(touched, info["region_force"][0]), cost + info["cost"]
    assert touched > 50
    assert cost > 0
    assert info["cost_sum"] == pytest.approx(cost)
    assert env.regions[info["region"] - 1].name == "block"


def test_fragments_specs_and_meshes(tmp_path):
    fragment = (
        '<mujoco><worldbody><geom type="box" size=".1 .1 .1" pos="0 0 .1"/></worldbody></mujoco>'
    )
    file = tmp_path / "box.xml"
    file.write_text(fragment)
    mesh = tmp_path / "part.ply"
    trimesh.creation.box((0.2, 0.2, 0.2)).export(mesh)
    spec = mujoco.MjSpec.from_string(fragment)
    far = {"position": (0.0, 2.0, 0.0)}
    for obj in (
        SceneObject("a", mjcf=fragment, **far),
        SceneObject("a", mjcf=str(file), **far),
        SceneObject("a", mjcf=spec, **far),
        SceneObject("a", (Shape("mesh", file=str(mesh), position=(0, 0, 0.1)),), **far),
    ):
        scene = compose(SceneSpec(objects=(obj,)))
        data = mujoco.MjData(scene.model)
        mujoco.mj_kinematics(scene.model, data)
        assert data.geom("a_0").xpos == pytest.approx([0, 2, 0.1], abs=1e-6)
        assert scene.model.npair > 0
        mujoco.MjModel.from_xml_string(scene.xml)  # the text stands alone


def test_a_toml_file_gives_the_same_objects_and_names_what_is_wrong(tmp_path):
    path = tmp_path / "cell.toml"
    path.write_text(
        '[[object]]\nname = "block"\nposition = [1, 0, 0]\nstiffness = 2e4\n'
        'shapes = [{ kind = "box", size = [0.1, 0.1, 0.1] }]\n'
    )
    block = SceneObject(
        "block", (Shape("box", (0.1, 0.1, 0.1)),), position=(1.0, 0.0, 0.0), stiffness=2e4
    )
    assert load_objects(path) == (block,)
    path.write_text('[[object]]\nname = "block"\nshape = []\n')
    with pytest.raises(ValueError, match=r"cell\.toml: no key 'shape'; expected some of name, sh"):
        load_objects(path)
    with pytest.raises(FileNotFoundError, match=r"objects none\.toml: no such file; expected a TO"):
        load_objects("none.toml")


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"shapes": ()}, "expected either shapes or mjcf"),
        ({"motion": "flying"}, "motion 'flying'; expected one of fixed, held, free"),
        ({"path": ((0, 0, 0, 0),)}, "two or more rows"),
        ({"path": ((0, 0, 0, 0), (0, 1, 0, 0))}, "times that grow"),
        ({"stiffness": 0.0}, "stiffness"),
        ({"name": "a b"}, "expected a name of letters"),
    ],
)
def test_values_that_cannot_be_are_named(values, message):
    with pytest.raises(ValueError, match=message):
        SceneObject(**({"name": "a", "shapes": (BALL,)} | values))


def test_an_object_in_an_episode_is_hit_labelled_and_in_its_text():
    wall = SceneObject(
        "ram", (Shape("box", (0.05, 0.6, 0.6)),), stiffness=2e4,
        path=((0, 1.6, 0.0, 0.5), (2.0, 0.35, 0.0, 0.5), (4.0, 1.6, 0.0, 0.5)),
    )  # fmt: skip
    episode = Episode(3, seconds=2.5, objects=(wall,))
    assert Episode.from_json(episode.to_json()) == episode
    assert "objects" not in json.loads(Episode(3).to_json())
    trace = simulate(episode)
    assert trace.truth.collisions
    at = trace.truth.obstacle_names.index("ram")
    assert trace.truth.obstacle_poses[-1, at, 0, 3] == pytest.approx(0.66, abs=0.01)
    quiet = trace.truth.contact_force == 0
    assert 0 < quiet.sum() < len(quiet)
    assert (trace.truth.tau_ext[quiet] == 0).all()


def test_a_conveyor_carries_what_lies_on_it_and_stays_where_it_is():
    bed = Shape("box", (0.6, 0.15, 0.02))
    belt = SceneObject("belt", (bed,), position=(0.0, 0.8, 0.1), belt=(0.3, 0.0, 0.0))
    part = SceneObject(
        "part", (Shape("box", (0.03,) * 3),), position=(-0.4, 0.8, 0.15), motion="free"
    )
    env = make(belt, part)
    env.reset(seed=0)
    places = []
    for _ in range(200):
        env.step(np.zeros(6))
        places.append(env.data.body("part").xpos[0])
    assert np.diff(places[100:]).mean() / 0.01 == pytest.approx(0.3, rel=0.01)
    assert env.data.body("belt").xpos == pytest.approx([0.0, 0.8, 0.1], abs=1e-3)
    trace = simulate(Episode(3, seconds=1.0, objects=(belt, part)))
    k = trace.truth.obstacle_names.index("part")
    assert np.ptp(trace.truth.obstacle_poses[:, k, 0, 3]) > 0.2


def test_what_is_written_by_dm_control_or_mujoco_is_an_object():
    spec = mujoco.MjSpec.from_string("<mujoco><worldbody/></mujoco>")
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.1, 0.1, 0.1])
    fixtures = [SceneObject("a", mjcf=spec, position=(0.9, 0.5, 0.2))]
    if (mjcf := pytest.importorskip("dm_control.mjcf")) is not None:
        root = mjcf.RootElement(model="jig")
        root.worldbody.add("geom", type="cylinder", size=[0.1, 0.2])
        fixtures.append(SceneObject("b", mjcf=root, position=(0.9, -0.5, 0.2)))
    env = make(*fixtures)
    assert [region.name for region in env.regions] == ["a", "b"]
    assert env.model.geom("b_0").type == mujoco.mjtGeom.mjGEOM_CYLINDER
    again = SceneObject(**json.loads(json.dumps({"name": "a", "mjcf": fixtures[0].mjcf})))
    assert again.mjcf == fixtures[0].mjcf


def test_an_mjcf_file_with_a_mesh_stands_alone(tmp_path):
    trimesh.creation.box((0.1, 0.2, 0.3)).export(tmp_path / "part.stl")
    text = (
        '<mujoco><asset><mesh file="part.stl"/></asset><worldbody><geom type="mesh" mesh="part"/>'
    )
    (tmp_path / "jig.xml").write_text(text + "</worldbody></mujoco>")
    jig = SceneObject("jig", mjcf=str(tmp_path / "jig.xml"), position=(0.9, 0.5, 0.2))
    (tmp_path / "part.stl").unlink()
    model = mujoco.MjModel.from_xml_string(make(jig).scene.xml)
    assert sorted(model.geom_aabb[model.geom("jig_0").id, 3:]) == pytest.approx([0.05, 0.1, 0.15])


@pytest.mark.parametrize(
    ("objects", "message"),
    [
        ([("link1", (0.9, 0.5, 0.2), "fixed")], "object link1: the scene has a part of this name"),
        ([("a", (0.9, 0.5, 0.2), "fixed"), ("b", (0.93, 0.5, 0.2), "free")], "b is .* mm inside a"),
        ([("a", (0.9, 0.5, 0.2), "free"), ("b", (0.93, 0.5, 0.2), "free")], "a is .* mm inside b"),
    ],
)
def test_objects_at_places_that_cannot_be_are_refused_by_name(objects, message):
    placed = [SceneObject(n, (BALL,), position=p, motion=m) for n, p, m in objects]
    with pytest.raises(ValueError, match=message):
        make(*placed)
    with pytest.raises(ValueError, match=message):
        simulate(Episode(3, seconds=1.0, objects=tuple(placed)))


def test_a_person_does_not_begin_inside_an_object():
    def at(x):
        block = SceneObject("block", (Shape("box", (0.1,) * 3),), position=(x, 0.0, 0.1))
        return gym.make(REACH, obstacles=("person",), objects=(block,)).unwrapped

    free = gym.make(REACH, obstacles=("person",)).unwrapped.compiled.person.position
    env = at(free[0])
    assert env.compiled.person.position[0] > free[0] + 0.1
    env.reset(seed=0)
    block = env.model.geom("block_0").id
    for region in env.regions[:-1]:
        geom = env.model.geom(region.name).id
        assert mujoco.mj_geomDistance(env.model, env.data, geom, block, 0.5, None) > -0.01
