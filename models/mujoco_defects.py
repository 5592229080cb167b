"""Known defects of MuJoCo versions that change results, and checks for affected models."""

import warnings
from typing import Any

import mujoco

#: Versions whose Newton solver factors a wrong Hessian if the Jacobian is sparse. It may then stop
#: at its limit of iterations with wrong accelerations. Fixed in 4.0.1.
WRONG_SPARSE_NEWTON = ("4.0.0",)
#: Number of degrees of freedom from which MuJoCo's ``auto`` chooses the sparse Jacobian.
SPARSE_FROM = 60


def hit_by_sparse_newton(model: Any) -> bool:
    """Whether this version's Newton solver may give wrong accelerations of this model.

    Args:
        model: MjModel.
    """
    return (
        mujoco.__version__ in WRONG_SPARSE_NEWTON
        and int(model.opt.solver) == mujoco.mjtSolver.mjSOL_NEWTON
        and bool(mujoco.mj_isSparse(model))
    )


def choose_jacobian(spec: Any) -> None:
    """Choose the dense Jacobian in an MjSpec whose rigid bodies would get the sparse one.

    Vertices of cloth do not count: for an arm with cloth both kinds agree to 5e-15, and a dense
    Jacobian of so many vertices takes far longer.
    """
    kinds, option = mujoco.mjtJoint, spec.option
    if mujoco.__version__ not in WRONG_SPARSE_NEWTON:
        return
    sizes = {kinds.mjJNT_FREE: 6, kinds.mjJNT_BALL: 3}
    soft = {name for flex in spec.flexes for name in (*flex.vertbody, *flex.nodebody)}
    bodies = [body for body in spec.bodies if body.name not in soft]
    count = sum(sizes.get(joint.type, 1) for body in bodies for joint in body.joints)
    if count >= SPARSE_FROM and option.jacobian == mujoco.mjtJacobian.mjJAC_AUTO:
        option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE


def warn_of_sparse_newton(model: Any) -> None:
    """Issue a ``UserWarning`` with the remedy if :func:`hit_by_sparse_newton` is true."""
    if hit_by_sparse_newton(model):
        warnings.warn(
            f"MuJoCo {mujoco.__version__}: its Newton solver can give wrong accelerations with a "
            f"sparse Jacobian, which this model has ({model.nv} degrees of freedom); set "
            "model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE, or install the mended library: "
            "pip install --no-deps mujoco-core==4.0.1 (the package mujoco 4.0.0 pins 4.0.0)",
            stacklevel=3,
        )
