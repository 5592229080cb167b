"""Small robots as MJCF text, for what the CURA6-like arm cannot show."""

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
