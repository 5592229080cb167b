"""The table of model fields is complete, and right where a number can be changed."""

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

from tauguard.contacts.guard.followed_fields import structure_fields
from tauguard.contacts.guard.model_fields import COMPILED, FOLLOWED, LIVE, OTHER, OTHER_OBJECTS

HEADER = (Path(mujoco.__path__[0]) / "include/mujoco/mjmodel.h").read_text()


def declared(struct):
    body = re.search(rf"struct {struct}_? \{{(.*?)\n\}}", HEADER, re.DOTALL).group(1)
    return re.findall(r"(\w+)(?:\[[^\]]*\])*;", re.sub(r"//.*", "", body))


def test_every_field_of_the_installed_headers_is_in_the_table_once():
    names = declared("mjModel") + [f"opt.{name}" for name in declared("mjOption")]
    assert len(names) > 600
    classes = (FOLLOWED, LIVE, COMPILED, OTHER)
    for name in names:
        listed = sum(name in one for one in classes)
        structure = name in structure_fields()
        other = bool(re.fullmatch(OTHER_OBJECTS, name)) and not name.startswith("opt.")
        assert listed + structure == 1 or (other and not listed), name
    assert not set().union(*classes) - set(names)


def scene():
    """All kinds of geoms and a cloth over a floor of boxes, in contact."""
    kinds = ("sphere", "capsule", "ellipsoid", "cylinder", "box")
    bodies = "".join(
        f'<body pos="{0.3 * k} 0 .095"><freejoint/><geom type="{kind}" size=".1 .1 .1"/></body>'
        for k, kind in enumerate(kinds)
    )
    model = mujoco.MjModel.from_xml_string(f"""<mujoco><asset>
      <mesh name="m" vertex="-.1 -.1 -.1 .1 -.1 -.1 0 .1 -.1 0 0 .1"/>
      <hfield name="h" nrow="3" ncol="3" size="1 1 .1 .1" elevation="0 1 0 1 0 1 0 1 0"/></asset>
      <worldbody><geom type="plane" size="5 5 .1"/>{bodies}
      <geom type="hfield" hfield="h" pos="0 3 0"/>
      <body pos="0 3 .08"><freejoint/><geom size=".1"/></body>
      <body pos="0 -1 .095"><freejoint/><geom type="mesh" mesh="m"/></body>
      <flexcomp name="c" type="grid" dim="2" count="4 4 1" spacing=".1 .1 .1" pos="2 2 .005"
        radius=".01" mass=".1"><edge equality="true"/><contact selfcollide="auto"/></flexcomp>
      </worldbody></mujoco>""")
    return model, mujoco.MjData(model)


def contacts(model, data):
    mujoco.mj_forward(model, data)
    return np.array(
        [[*c.geom, *c.flex, c.dist, c.includemargin, *c.pos, *c.frame] for c in data.contact]
    )


def test_numbers_of_other_fields_do_not_change_contacts():
    model, data = scene()
    before = contacts(model, data)
    assert len(before) > 10
    rng, tried = np.random.default_rng(0), 0
    for name in sorted(OTHER):
        owner = model.opt if name.startswith("opt.") else model
        value = getattr(owner, name.removeprefix("opt."))
        floats = np.asarray(value).dtype in (np.float64, np.float32)
        if not floats or not np.asarray(value).size:
            continue
        kept = np.array(value)
        changed = kept + rng.uniform(0.01, 0.1, kept.shape)
        setattr(owner, name.removeprefix("opt."), changed)
        np.testing.assert_array_equal(contacts(model, data), before, err_msg=name)
        setattr(owner, name.removeprefix("opt."), kept)
        tried += 1
    assert tried > 20


@pytest.mark.parametrize(
    "name", ["geom_size", "geom_pos", "geom_margin", "hfield_size", "mesh_vert"]
)
def test_the_same_change_of_a_field_of_collision_does(name):
    model, data = scene()
    before = contacts(model, data)
    getattr(model, name)[:] += 0.01
    if name == "geom_pos":
        model.geom_sameframe[:] = 0
    after = contacts(model, data)
    assert before.shape != after.shape or (before != after).any()


def test_masks_of_bodies_and_trees_without_visual_geoms_are_those_of_mujoco():
    """Edited masks: MuJoCo also reads the bodies' masks, and trees made at compilation."""
    from tauguard.contacts.pairs import geom_flex_pairs, geom_pairs

    rng = np.random.default_rng(1)
    for _ in range(60):
        masks = iter(rng.integers(0, 4, 64))

        def geom(masks=masks):
            return f'<geom size=".1" contype="{next(masks)}" conaffinity="{next(masks)}"/>'

        bodies = "".join(
            f'<body pos="{x} {y} {z}"><freejoint/>{geom()}{geom() if k % 2 else ""}</body>'
            for k, (x, y, z) in enumerate(rng.uniform(-0.05, 0.05, (5, 3)))
        )
        model = mujoco.MjModel.from_xml_string(f"""<mujoco><worldbody>{bodies}
          <flexcomp name="c" type="grid" dim="2" count="3 3 1" spacing=".05 .05 .05" radius=".02"
          mass=".1"><contact selfcollide="none" contype="{next(masks)}"
          conaffinity="{next(masks)}"/><edge equality="true"/></flexcomp></worldbody></mujoco>""")
        for field in (model.geom_contype, model.geom_conaffinity, model.flex_contype):
            field[rng.integers(len(field))] = rng.integers(4)
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        touching = [c for c in data.contact if min(c.geom) >= 0]
        pairs, flexes = geom_pairs(model), geom_flex_pairs(model)
        expected = {tuple(sorted(map(int, contact.geom))) for contact in touching}
        couples = zip(pairs.first, pairs.second, strict=True)
        assert expected == {tuple(sorted(map(int, couple))) for couple in couples}
        expected = {int(max(c.geom)) for c in data.contact if max(c.flex) >= 0}
        assert expected == set(map(int, flexes.first))
