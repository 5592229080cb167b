"""Scenes with flexes: cloth and flags, ropes, soft blocks, needles into small cloth."""

from __future__ import annotations

import mujoco
import numpy as np

from scenes.drawing import (
    AFTER,
    GEOM,
    INTEGRATORS,
    KINDS,
    Drawn,
    any_spin,
    any_way,
    at_rest,
    between,
    free_body,
    settle,
    shape,
    slab,
    thrown,
    world,
)
from tauguard.contacts.scenes.impacts import STIFF
from tauguard.models.cloth import Cloth, add_cloth


def cloth(rng: np.random.Generator) -> Drawn:
    """A body into pinned cloth or a hanging flag: in any orientation, spinning."""
    spec, timestep, speed = world(rng, ("discrete",))
    pinned = str(rng.choice(["frame", "corners", "edge"]))
    hangs, turn = pinned == "edge", np.sqrt(0.5)
    sheet = Cloth(
        count=int(rng.choice([9, 13, 15])),
        size=0.3,
        mass=between(rng, 0.02, 0.2),
        position=(0.0, 0.0, 0.0),
        quat_wxyz=(turn, turn, 0.0, 0.0) if hangs else (1.0, 0.0, 0.0, 0.0),
        pinned=pinned,
        young=between(rng, 1e6, 1e7),
        solref=STIFF[0] if rng.random() < 0.5 else (0.003, 1.0),
    )
    add_cloth(spec, sheet)
    body = free_body(spec, "body")
    reach = shape(rng, spec, body, "body", between(rng, 5e-3, 0.1), KINDS, 0.008)
    body.geoms[0].conaffinity = 2
    gap = reach + sheet.radius + 0.003 + rng.random() * speed * timestep
    data = mujoco.MjData(model := spec.compile())
    mujoco.mj_forward(model, data)
    normal = np.array([0, 1.0, 0]) if hangs else np.array([0, 0, 1.0])
    aside = rng.uniform(-0.06, 0.06, 3)
    place = data.flexvert_xpos.mean(axis=0) + aside - aside @ normal * normal + gap * normal
    return thrown(rng, spec, timestep, speed, place, gap, normal, slide=0.0)


#: Of :func:`soft`, by dimension: vertices along each side, spacing and radius [m], springs, pins.
_FORMS = {
    1: ("13 1 1", 0.025, 5e-3, '<edge equality="true"/>', '<pin id="0 12"/>'),
    2: ("9 9 1", 0.035, 2e-3, '<edge equality="true"/>', '<pin id="0 8 72 80"/>'),
    3: (
        "5 5 3",
        0.03,
        1e-3,
        '<elasticity young="{young!r}" poisson="0.2" damping="1e-3"/>',
        '<pin id="0 3 6 9 12"/>',
    ),
}


def soft(rng: np.random.Generator) -> Drawn:
    """A body onto a rope, a net of edges that hold their length, or a soft block."""
    dim = int(rng.choice([1, 2, 3]))
    count, spacing, radius, springs, pins = _FORMS[dim]
    young = between(rng, 1e4, 1e6)
    spec = mujoco.MjSpec.from_string(f"""<mujoco><worldbody><body name="frame">
      <flexcomp name="soft" type="grid" dim="{dim}" count="{count}" radius="{radius!r}"
        spacing="{spacing!r} {spacing!r} {spacing!r}" mass="{between(rng, 0.05, 0.5)!r}">
        {springs.format(young=young)} {pins}
        <contact selfcollide="none" solref="0.003 1"/></flexcomp></body>
      </worldbody></mujoco>""")
    timestep = settle(spec, rng, ("discrete",))  # which `ipc` needs
    speed = between(rng, 1.0, 40.0)
    body = free_body(spec, "body")
    reach = shape(rng, spec, body, "body", between(rng, 5e-3, 0.1), KINDS, 0.008)
    gap = reach + radius + 0.003 + rng.random() * speed * timestep
    data = mujoco.MjData(model := spec.compile())
    mujoco.mj_forward(model, data)
    x = data.flexvert_xpos
    place = [*x.mean(axis=0)[:2] + rng.uniform(-0.01, 0.01, 2), x[:, 2].max() + gap]
    return thrown(rng, spec, timestep, speed, place, gap, slide=0.0)


#: Of :func:`needles`: half sizes, the least and the most half thickness [m], mass [kg], reach [m].
_THIN = {
    "capsule": ((None, 0.03, 0), 5e-4, 3e-3, 0.01, 0.035),
    "box": ((0.03, 0.02, None), 5e-4, 3e-3, 0.05, 0.04),
    "cylinder": ((0.02, None, 0), 5e-4, 3e-3, 0.03, 0.03),
    "ellipsoid": ((0.03, 0.01, None), 1e-3, 5e-3, 0.03, 0.035),
}


def needles(rng: np.random.Generator) -> Drawn:
    """A needle, plate, disc or lens onto a small net, pinned or free, over a floor or not."""
    count, spacing = int(rng.integers(4, 8)), 0.02
    corners = f"0 {count - 1} {count * (count - 1)} {count**2 - 1}"
    pins = f'<pin id="{corners}"/>' if rng.random() < 0.7 else ""
    spec = mujoco.MjSpec.from_string(f"""<mujoco><worldbody>
      <flexcomp name="soft" type="grid" dim="2" count="{count} {count} 1" mass=".05"
        spacing="{spacing} {spacing} {spacing}" radius="{between(rng, 1e-3, 4e-3):.5f}">
        <edge equality="true" damping=".001"/>{pins}
        <contact selfcollide="none" condim="3"/></flexcomp></worldbody></mujoco>""")
    timestep, speed = settle(spec, rng, INTEGRATORS[:4]), between(rng, 1.0, 30.0)
    body = free_body(spec, "body")
    kind = str(rng.choice(list(_THIN)))
    form, least, most, mass, reach = _THIN[kind]
    thin = between(rng, least, most)
    size = [thin if x is None else x for x in form]
    body.add_geom(name="body", type=GEOM[kind], size=size, mass=mass)
    if rng.random() < 0.4:
        floor = spec.worldbody.add_body(name="floor", pos=[0, 0, -0.03])
        slab(rng, floor, "floor", (0.2, 0.2, 1e-3), 1.0)
    qpos, qvel, at, dof = at_rest(spec.compile())
    qpos[at : at + 3] = [*rng.uniform(-0.02, 0.02, 2), reach + 0.01]
    if rng.random() < 0.5:
        qpos[at + 3 : at + 7] = any_way(rng)
    qvel[dof + 2] = -speed
    qvel[dof + 3 : dof + 6] = any_spin(rng, timestep)
    return Drawn(spec, qpos, qvel, timestep, (reach + 0.01) / speed + AFTER)
