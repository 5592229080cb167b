"""Models that a defect of the installed MuJoCo hits are named."""

import warnings

import mujoco
import numpy as np
import pytest

from tauguard.contacts import GuardedStepper
from tauguard.models import SceneObject, SceneSpec, Shape, compose, mujoco_defects
from tauguard.models.cloth import Cloth

DENSE, SPARSE = mujoco.mjtJacobian.mjJAC_DENSE, mujoco.mjtJacobian.mjJAC_SPARSE


def pile(seed, trees=8):
    """Trees of bodies that branch, dropped on one another."""
    rng = np.random.default_rng(seed)

    def limb(place, depth):
        x, y, z = place
        inner = (
            "".join(limb(rng.uniform(-0.1, 0.1, 3), depth - 1) for _ in range(2)) if depth else ""
        )
        joint = rng.choice(['type="ball"', 'axis="1 0 0"', 'axis="0 1 0"'])
        return f"""<body pos="{x} {y} {z}"><joint {joint}/><geom type="capsule" size=".02"
          fromto="0 0 0 {x} {y} {z + 0.01}" mass=".1"/>{inner}</body>"""

    bodies = ""
    for k in range(trees):
        limbs = "".join(limb(rng.uniform(-0.1, 0.1, 3), 1) for _ in range(3))
        bodies += f"""<body pos="{0.03 * rng.normal()} {0.03 * rng.normal()} {0.1 + 0.06 * k}">
          <freejoint/><geom type="box" size=".05 .05 .02" mass=".3"/>{limbs}</body>"""
    return mujoco.MjModel.from_xml_string(f"""<mujoco><option timestep="1e-3"/>
      <size memory="100M"/><worldbody><geom type="plane" size="2 2 .1"/>{bodies}</worldbody>
      </mujoco>""")


def difference(model):
    """Of the accelerations by both kinds of Jacobian: the largest, relative to the dense ones."""
    data, other, worst = mujoco.MjData(model), mujoco.MjData(model), 0.0
    for k in range(150):
        model.opt.jacobian = DENSE
        mujoco.mj_step(model, data)
        if k % 10:
            continue
        found = []
        for kind in (DENSE, SPARSE):
            model.opt.jacobian = kind
            mujoco.mj_resetData(model, other)
            other.qpos[:], other.qvel[:] = data.qpos, data.qvel
            mujoco.mj_forward(model, other)
            found.append(other.qacc.copy())
        worst = max(worst, np.abs(found[1] - found[0]).max() / np.abs(found[0]).max())
    return worst


def test_the_defect_is_in_the_versions_that_are_named():
    worst = difference(pile(0))
    if mujoco.__version__ in mujoco_defects.WRONG_SPARSE_NEWTON:
        assert worst > 0.1
    else:
        assert worst < 1e-6


@pytest.mark.parametrize(
    ("version", "jacobian", "solver", "named"),
    [
        ("4.0.0", "AUTO", "NEWTON", True),
        ("4.0.0", "SPARSE", "NEWTON", True),
        ("4.0.0", "DENSE", "NEWTON", False),
        ("4.0.0", "SPARSE", "CG", False),
        ("4.0.1", "SPARSE", "NEWTON", False),
    ],
)
def test_a_model_that_is_hit_is_named_with_what_to_do(
    monkeypatch, version, jacobian, solver, named
):
    model = pile(0)
    assert model.nv >= 60
    monkeypatch.setattr(mujoco, "__version__", version)
    model.opt.jacobian = getattr(mujoco.mjtJacobian, f"mjJAC_{jacobian}")
    model.opt.solver = getattr(mujoco.mjtSolver, f"mjSOL_{solver}")
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        GuardedStepper(model, mujoco.MjData(model))
    assert len(told) == named
    if named:
        assert "mjJAC_DENSE" in str(told[0].message)


def test_a_small_model_is_not_hit():
    assert not mujoco_defects.hit_by_sparse_newton(pile(0, trees=1))


def test_a_scene_of_many_loose_parts_has_the_dense_jacobian_and_cloth_keeps_its_own():
    parts = tuple(
        SceneObject(
            f"part{k}", (Shape("sphere", (0.05,)),), motion="free", position=(1.0, 0.2 * k, 0.1)
        )
        for k in range(10)
    )
    kinds = mujoco.mjtJacobian
    many, few = compose(SceneSpec(objects=parts)), compose(SceneSpec(objects=parts[:2]))
    hit = mujoco.__version__ in mujoco_defects.WRONG_SPARSE_NEWTON
    assert many.model.nv >= mujoco_defects.SPARSE_FROM
    assert many.model.opt.jacobian == (kinds.mjJAC_DENSE if hit else kinds.mjJAC_AUTO)
    assert not mujoco_defects.hit_by_sparse_newton(many.model)
    assert few.model.opt.jacobian == kinds.mjJAC_AUTO
    cloth = compose(SceneSpec(cloth=Cloth(count=9)))
    assert cloth.model.nv >= mujoco_defects.SPARSE_FROM
    assert cloth.model.opt.jacobian == kinds.mjJAC_AUTO
