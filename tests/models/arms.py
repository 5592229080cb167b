"""Small robots as MJCF text, for what the CURA6-like arm cannot show."""

import numpy as np

#: A mass on a rail with one round contact shape: the standard's robot.
SLED = """<mujoco><option timestep="0.001"/><worldbody>
  <body name="sled"><joint name="rail" type="slide" axis="1 0 0"/>
    <geom type="sphere" size="0.05" mass="{mass}"/></body></worldbody></mujoco>"""

#: Seven joints, unnamed parts, a mesh, a welded tool, actuators, a keyframe and a textured base.
SEVEN = """<mujoco model="seven"><compiler angle="radian" meshdir="."/>
  <asset><mesh name="tool" file="tool.obj" scale="0.5 0.5 0.5"/>
    <texture name="paint" type="2d" builtin="flat" width="4" height="4"/>
    <material name="paint" texture="paint"/></asset>
  <worldbody><body name="pedestal" pos="0 0 0.1" euler="0 0.2 0">
  <geom size="0.1 0.1 0.1" type="box" material="paint"/>
  <body pos="0 0 0.1"><joint axis="0 0 1" actuatorfrcrange="-80 80"/>
    <geom type="capsule" fromto="0 0 0 0 0 0.2" size="0.06"/>
    <body pos="0 0 0.2"><joint axis="0 1 0"/>
    <geom type="capsule" fromto="0 0 0 0 0 0.2" size="0.06"/>
    <body pos="0 0 0.2"><joint axis="0 0 1"/>
    <geom type="capsule" fromto="0 0 0 0 0 0.2" size="0.05"/>
    <body pos="0 0 0.2"><joint axis="0 1 0"/>
    <geom type="capsule" fromto="0 0 0 0 0 0.2" size="0.05"/>
    <body pos="0 0 0.2"><joint axis="0 0 1"/>
    <inertial pos="0 0 0" mass="1" diaginertia=".01 .01 .01"/>
    <body pos="0 0 0.2"><joint axis="0 1 0"/>
    <geom type="capsule" fromto="0 0 0 0 0 0.1" size="0.04"/>
    <body pos="0 0 0.1"><joint name="last" axis="0 0 1"/><geom size="0.04"/>
      <body name="tool" pos="0 0 0.06" euler="0.3 0 0"><geom type="mesh" mesh="tool" mass="0.4"/>
        <site name="attachment_site" pos="0 0 0.05"/></body>
    </body></body></body></body></body></body></body></body></worldbody>
  <actuator><motor joint="last" forcerange="-7 7"/></actuator>
  <keyframe><key name="home" qpos="0 0.5 0 -1 0 0.5 0.1"/></keyframe></mujoco>"""

TETRAHEDRON = "v 0 0 0\nv 0.2 0 0\nv 0 0.2 0\nv 0 0 0.2\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def random_arm(seed: int, gripper: str = "none", sources: str = "mixed") -> str:
    """MJCF of an arm that nobody has seen: 5 to 7 joints, sizes, ranges and losses at random.

    Args:
        seed: of everything.
        gripper: "none", "fingers" (two branches) or "jaw" (a last joint called so).
        sources: "mixed" gives some arms armature, damping, friction loss, actuators or a keyframe.
    """
    rng = np.random.default_rng([seed, 7])
    n = int(rng.integers(5, 8))
    axes = ["0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0", "0 0 1"]
    reach, light = rng.uniform(0.5, 1.3), rng.uniform(0.4, 0.8)
    limits = 150 * reach**2 * light ** np.arange(n) + 5
    extras = {
        "damping": rng.random() < 0.5,
        "loss": rng.random() < 0.5,
        "armature": rng.random() < 0.3,
        "limits": rng.random() < 0.8,
        "key": rng.random() < 0.3,
    }
    text, mass = "", 6 * reach
    for i in range(n):
        length = reach / n * rng.uniform(0.6, 1.4)
        more = f' damping="{rng.uniform(0, 0.08) * limits[i]:.4f}"' if extras["damping"] else ""
        more += f' frictionloss="{rng.uniform(0, 0.04) * limits[i]:.4f}"' if extras["loss"] else ""
        more += (
            f' armature="{rng.uniform(0.001, 0.01) * limits[i]:.5f}"' if extras["armature"] else ""
        )
        if extras["limits"]:
            more += f' actuatorfrcrange="{-limits[i]:.2f} {limits[i]:.2f}"'
        if rng.random() < 0.8:  # ranges that need not hold zero
            middle, half = rng.uniform(-0.8, 0.8), rng.uniform(0.9, 2.8)
            more += f' range="{middle - half:.3f} {middle + half:.3f}"'
        text += (
            f'<body name="link{i}" pos="0 0 {length if i else 0.1:.3f}"><joint name="j{i}" '
            f'axis="{axes[i]}"{more}/><geom type="capsule" size="{0.06 * light ** (i / 4):.4f}" '
            f'fromto="0 0 0 0 0 {length:.3f}" mass="{mass:.3f}"/>'
        )
        mass *= light
    fingers = "".join(
        f'<body name="finger{k}" pos="0 {y} 0.08"><joint name="finger{k}_joint" type="slide" '
        f'axis="0 1 0" range="0 0.04"/><geom type="box" size=".01 .01 .03" mass=".05"/></body>'
        for k, y in enumerate((-0.02, 0.02))
    )
    jaw = (
        '<body name="jaw" pos="0 0 0.08"><joint name="gripper_joint" axis="0 1 0" range="0 1"/>'
        '<geom size=".02" mass=".05"/></body>'
    )
    text += {"none": "", "fingers": fingers, "jaw": jaw}[gripper] + "</body>" * n
    pose = " ".join(["0.1"] * (n + {"none": 0, "fingers": 2, "jaw": 1}[gripper]))
    key = f'<keyframe><key qpos="{pose}"/></keyframe>' if extras["key"] else ""
    head = '<mujoco><compiler angle="radian" autolimits="true"/>'
    return f"{head}<worldbody>{text}</worldbody>{key}</mujoco>"
