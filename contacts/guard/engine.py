"""Addresses of MuJoCo's functions, and of the fields of a model and its data, for the native guard.

Functions are those of the library that the Python binding has loaded. The binding gives the
addresses of arrays. Scalars, and arrays that MuJoCo moves within its arena, are found by the layout
of the structs, which :mod:`mujoco.introspect` declares for the installed version. This layout is
checked against values of the binding.
"""

import ctypes
import functools
from typing import Any

import mujoco
from mujoco.introspect import ast_nodes

from tauguard.contacts.checker import POSE
from tauguard.models.mujoco_library import function_address, variable_address

#: MuJoCo's functions, by their names in the native guard.
FUNCTIONS = {
    "step": "mj_step",
    "step1": "mj_step1",
    "step2": "mj_step2",
    "kinematics": "mj_kinematics",
    "com_pos": "mj_comPos",
    "com_vel": "mj_comVel",
    "flex": "mj_flex",
    "tendon": "mj_tendon",
    "make_m": "mj_makeM",
    "energy_pos": "mj_energyPos",
    "get_state": "mj_getState",
    "set_state": "mj_setState",
    "copy_state": "mj_copyState",
    "copy_model": "mj_copyModel",
    "mul_m": "mj_mulM",
    "mul_jac": "mj_mulJacVec",
    "mul_jac_t": "mj_mulJacTVec",
    "jac_com": "mj_jacBodyCom",
    "jac": "mj_jac",
    "solve_m": "mj_solveM",
    "integrate": "mj_integratePos",
    "logging.set": "_mjPRIVATE_setTlsLogHandler",  # as in the Python binding: for exceptions
    "logging.global": "_mjPRIVATE_getGlobalLogHandler",
}
#: Flags of features that are refused, because a step with them cannot be rolled back.
REFUSED = {
    "ipc": mujoco.mjtEnableBit.mjENBL_IPC,
    "speculative": mujoco.mjtEnableBit.mjENBL_SPECULATIVE,
    "sleep": mujoco.mjtEnableBit.mjENBL_SLEEP,
}
#: Parts of the state that determine a step.
INTEGRATION = int(mujoco.mjtState.mjSTATE_INTEGRATION)

_MODEL_ARRAYS = (
    *("pair_geom1", "pair_geom2", "flex_vertbodyid", "flex_vert"),
    *("geom_bodyid", "body_rootid", "body_mocapid", "body_dofnum", "body_weldid"),
)
#: Contact parameters that sub-steps change, by the number of their kind in the native guard.
_PARAMETERS = {
    f"at_{name}[{k}]": f"{kind}_{name}"
    for k, kind in enumerate(("pair", "geom", "flex"))
    for name in ("margin", "solref", "solimp", "friction", "priority")
    if hasattr(mujoco.MjModel, f"{kind}_{name}")  # pairs have no priority
}
#: MuJoCo's global callbacks, except the contact filter.
_CALLBACKS = ("passive", "control", "sensor", "time", "act_dyn", "act_gain", "act_bias")
_DATA_ARRAYS = (
    *("qpos", "qvel", "energy", "qfrc_actuator", "qfrc_applied", "xfrc_applied"),
    *("xpos", "xmat", "xipos", "flexvert_xpos", "mocap_pos", "mocap_quat"),
)
_END_ARRAYS = ("qvel", "energy", "xpos", "xmat", "flexvert_xpos", "cvel")
_OTHER_ARRAYS = ("energy", "xpos", "xmat", "flexvert_xpos", "mocap_pos", "mocap_quat")
_MOVING = (
    *("ncon", "nefc", "contact", "efc_aref", "efc_margin", "efc_vel", "efc_pos", "efc_force"),
    *("efc_type", "efc_id", "efc_diagA"),
)
OPTIONS = (
    *("timestep", "disableflags", "enableflags", "integrator", "cone", "solver", "iterations"),
    *("o_margin", "o_solref", "o_solimp"),
)
#: Physical options, which must be finite.
PHYSICS = (
    *("gravity", "wind", "magnetic", "density", "viscosity", "impratio", "tolerance"),
    *("o_margin", "o_solref", "o_solimp", "o_friction"),
)
#: Warnings after which MuJoCo has reset the data.
_RESETS = (
    int(mujoco.mjtWarning.mjWARN_BADQPOS),
    int(mujoco.mjtWarning.mjWARN_BADQVEL),
    int(mujoco.mjtWarning.mjWARN_BADQACC),
)
#: Warnings of too little memory for contacts and for constraints.
_FULL = (int(mujoco.mjtWarning.mjWARN_CONTACTFULL), int(mujoco.mjtWarning.mjWARN_CNSTRFULL))
_NUMBERS = ("nq", "nv", "nbody", "nmocap", "ngeom", "npair", "nflex", "nflexvert", "ntendon")
#: mjLOG_ERROR of mjtLogLevel, which the Python binding does not show.
_LOG_ERROR = 3
_TYPES = {
    "int": ctypes.c_int,
    "mjtNum": ctypes.c_double,
    "double": ctypes.c_double,
    "float": ctypes.c_float,
    "mjtSize": ctypes.c_int64,
    "size_t": ctypes.c_size_t,
    "uintptr_t": ctypes.c_size_t,
    "uint64_t": ctypes.c_uint64,
    "mjtByte": ctypes.c_uint8,
    "mjtBool": ctypes.c_bool,
    "char": ctypes.c_char,
}


def addresses(model: Any, data: Any, end: Any, other: Any) -> dict[str, int]:
    """Addresses, sizes and constants of MuJoCo that the native guard uses, by name.

    Args:
        model: MjModel.
        data: The MjData to step.
        end: Another MjData, for the kinematics at the end of a step.
        other: A third MjData, for other mocap poses; without mocap bodies it may be ``end``.

    Raises:
        RuntimeError: the structs of the installed MuJoCo differ from their declared layout.
    """
    out = {own: function_address(name) for own, name in FUNCTIONS.items()}
    out |= {name: _array(model, name) for name in _MODEL_ARRAYS}
    out |= {name: _array(data, name) for name in _DATA_ARRAYS}
    out |= {f"end_{name}": _array(end, name) for name in _END_ARRAYS}
    out |= {f"other_{name}": _array(other, name) for name in _OTHER_ARRAYS}
    out |= {name: int(getattr(model, name)) for name in _NUMBERS}
    fields, contact = _layout("mjData"), _layout("mjContact")
    warning = _layout("mjWarningStat")
    base = data._address
    out |= {name: base + int(getattr(fields, name).offset) for name in (*_MOVING, "time")}
    for k, kind in enumerate(_RESETS):
        at = kind * ctypes.sizeof(warning) + int(warning.number.offset)
        out[f"resets[{k}]"] = base + int(fields.warning.offset) + at
    for k, kind in enumerate(_FULL):
        at = kind * ctypes.sizeof(warning) + int(warning.number.offset)
        out[f"full[{k}]"] = base + int(fields.warning.offset) + at
    names = ("dist", "dim", "geom", "flex", "efc_address", "pos", "frame", "surfacevel")
    out |= {f"at_{name}": int(getattr(contact, name).offset) for name in names}
    out["at_friction_of"] = int(contact.friction.offset)
    struct = _layout("mjModel")
    out |= {own: int(getattr(struct, name).offset) for own, name in _PARAMETERS.items()}
    out |= {f"callbacks[{k}]": variable_address(f"mjcb_{n}") for k, n in enumerate(_CALLBACKS)}
    option = model._address + int(struct.opt.offset)
    out |= {
        name: option + int(getattr(_layout("mjOption"), name).offset)
        for name in (*OPTIONS, *PHYSICS)
    }
    _compare(model, data, out, base + int(fields.qpos.offset))
    return out | {
        "model": model._address,
        "data": base,
        "end": end._address,
        "other": other._address,
        "model_size": ctypes.sizeof(struct),
        "surfaces_move": model._address + int(struct.flg_surfacevel.offset),
        "contact_size": ctypes.sizeof(contact),
        "interpolated": bool(model.nflex) and bool(model.flex_interp.any()),
        "state_size": mujoco.mj_stateSize(model, INTEGRATION),
        "signature.integration": INTEGRATION,
        "signature.pose": POSE,
        "discrete": int(mujoco.mjtIntegrator.mjINT_DISCRETE),
        "pyramidal": int(mujoco.mjtCone.mjCONE_PYRAMIDAL),
        "elliptic": int(mujoco.mjtCone.mjCONE_ELLIPTIC),
        "runge_kutta": int(mujoco.mjtIntegrator.mjINT_RK4),
        "override_flag": int(mujoco.mjtEnableBit.mjENBL_OVERRIDE),
        "refused": sum(int(bit) for bit in REFUSED.values()),
        "contact_filter": variable_address("mjcb_contactfilter"),
        "at_pstack": int(fields.pstack.offset),
        "at_pbase": int(fields.pbase.offset),
        "logging.error": _LOG_ERROR,
        "logging.at_subject": int(_layout("mjLogMessage").subject.offset),
        "newton": int(mujoco.mjtSolver.mjSOL_NEWTON),
        "equality": int(mujoco.mjtConstraint.mjCNSTR_EQUALITY),
        "refsafe": int(mujoco.mjtDisableBit.mjDSBL_REFSAFE),
    }


def _compare(model: Any, data: Any, found: dict[str, int], qpos: int) -> None:
    """Check the layout against the fields that the binding exposes."""
    same = (
        ctypes.c_double.from_address(found["timestep"]).value == model.opt.timestep,
        ctypes.c_int.from_address(found["cone"]).value == model.opt.cone,
        ctypes.c_double.from_address(found["time"]).value == data.time,
        ctypes.c_int.from_address(found["ncon"]).value == data.ncon,
        ctypes.c_int.from_address(found["nefc"]).value == data.nefc,
        ctypes.c_int.from_address(found["resets[2]"]).value == data.warning[_RESETS[2]].number,
        *(
            ctypes.c_size_t.from_address(model._address + found[own]).value == _array(model, name)
            for own, name in _PARAMETERS.items()
            if getattr(model, name).size
        ),
        not model.nq or ctypes.c_size_t.from_address(qpos).value == found["qpos"],
    )
    if not all(same):
        raise RuntimeError(
            f"MuJoCo {mujoco.__version__}: its structs differ from their declared layout; guarded "
            "steps need MuJoCo 4.0"
        )


def _array(owner: Any, name: str) -> int:
    return int(getattr(owner, name).ctypes.data)


def _structs() -> Any:
    """MuJoCo's declarations of structs by name; the import is slow."""
    from mujoco.introspect.structs import STRUCTS

    return STRUCTS


@functools.cache
def _layout(struct: str) -> Any:
    """The ctypes layout of a MuJoCo struct."""
    return _structure(struct, _structs()[struct])


def _structure(name: str, declared: Any) -> Any:
    if any(not hasattr(field, "type") for field in declared.fields):
        raise RuntimeError(
            f"MuJoCo {mujoco.__version__}: {name} has a field without a type; guarded steps need "
            "MuJoCo 4.0"
        )
    fields = [(field.name, _ctype(field.type)) for field in declared.fields]
    return type(name, (ctypes.Structure,), {"_fields_": fields})


def _ctype(kind: Any) -> Any:
    if isinstance(kind, ast_nodes.PointerType):
        return ctypes.c_void_p
    if isinstance(kind, ast_nodes.ArrayType):
        out = _ctype(kind.inner_type)
        for extent in reversed(kind.extents):
            out = out * extent
        return out
    if isinstance(kind, ast_nodes.AnonymousStructDecl):
        return _structure("anonymous", kind)
    name = kind.name.removeprefix("struct ").rstrip("_")
    if name in _TYPES:
        return _TYPES[name]
    return _layout(name) if name in _structs() else ctypes.c_int  # an enumeration
