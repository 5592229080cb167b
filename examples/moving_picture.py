"""The moving picture of the README: an arm is struck, the residual rises, the alarm comes.

    MUJOCO_GL=egl python examples/moving_picture.py [PICTURE.gif]

Eight times slower than real time around the strike. Needs an OpenGL that MuJoCo finds.
"""

import sys

import matplotlib.pyplot as plt
import mujoco
import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter

import tauguard
from tauguard.datasets import free_episodes, struck_episodes
from tauguard.detectors import make_detector, train
from tauguard.detectors.calibration.nominal import nominal_arm
from tauguard.envs import CollisionPlan, Episode, simulate

SPAN, STEP = (-0.2, 0.3), 0.008  # [s] about the onset; a frame
SLOWER = 8


def staged(xml):
    """The scene with floor, sky and lamp, which only show."""
    spec = mujoco.MjSpec.from_string(xml)
    sky = {"rgb1": (0.93, 0.95, 0.97), "rgb2": (0.78, 0.83, 0.90), "width": 64, "height": 64}
    gradient = mujoco.mjtBuiltin.mjBUILTIN_GRADIENT
    spec.add_texture(name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=gradient, **sky)
    floor = {"size": (4, 4, 1), "rgba": (0.85, 0.86, 0.88, 1), "contype": 0, "conaffinity": 0}
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, **floor)
    kind = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    spec.worldbody.add_light(type=kind, pos=(0, 0, 3), dir=(-0.3, 0.2, -1), diffuse=[0.4] * 3)
    model = spec.compile()
    model.vis.headlight.ambient[:], model.vis.headlight.diffuse[:] = 0.4, 0.4
    model.vis.quality.offsamples, model.vis.quality.shadowsize = 8, 4096
    return model


class Scene:
    """The scene of a recording, drawn at any of its samples."""

    def __init__(self, trace, height=320, width=380):
        self.trace = trace
        self.model = staged(trace.attachments["scene.xml"])
        self.model.vis.global_.offheight, self.model.vis.global_.offwidth = height, width
        self.model.geom_rgba[self.model.body("striker").geomadr[0]] = (0.85, 0.25, 0.15, 1)
        self.data = mujoco.MjData(self.model)
        self.renderer = mujoco.Renderer(self.model, height, width)
        self.camera, self.options = mujoco.MjvCamera(), mujoco.MjvOption()
        self.options.geomgroup[3:] = 0  # collision shapes
        self.camera.lookat[:] = [0.15, 0.0, 0.45]
        self.camera.distance, self.camera.azimuth, self.camera.elevation = 1.7, 215, -12

    def picture(self, k):
        """The colours of sample ``k``."""
        for name, angle in zip(self.trace.joint_names, self.trace.q[k], strict=True):
            self.data.joint(name).qpos = angle
        first = self.model.joint(self.model.body("striker").jntadr[0]).qposadr[0]
        self.data.qpos[first : first + 3] = self.trace.truth.obstacle_poses[k, 0, :3, 3]
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_comPos(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)
        self.renderer.update_scene(self.data, self.camera, self.options)
        return self.renderer.render()


def main(target="struck.gif"):
    speeds = (30.0,)
    motion = [
        simulate(e) for e in struck_episodes(1, 1, 8, speeds) + free_episodes(1, 6, 20.0, speeds)
    ]
    alarm = train(make_detector("srq-svr"), motion, nominal_arm(motion), per_hour=1)
    strike = CollisionPlan("strike", time=3.0, link=4)
    trace = simulate(Episode(seed=1, seconds=6, collisions=(strike,)))
    found = alarm.detect(trace)
    onset, start = trace.truth.collisions[0].onset, found.alarms[0].start
    print(f"alarm {1e3 * (start - onset):.0f} ms after the contact")
    residual = tauguard.residual(trace)
    residual -= residual[np.searchsorted(trace.t, onset) - 1]

    t = trace.t - onset
    frames = np.searchsorted(t, np.arange(*SPAN, STEP))
    shown = (t >= SPAN[0]) & (t <= SPAN[1])
    scene = Scene(trace)
    figure = plt.figure(figsize=(8.4, 3.6), dpi=90, layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.17, 1))
    left.set_axis_off()
    image = left.imshow(scene.picture(frames[0]))
    text = left.text(0.03, 0.95, "", transform=left.transAxes, va="top", fontsize=15, weight="bold")
    right.set(xlim=(1e3 * SPAN[0], 1e3 * SPAN[1]), xlabel="time from the contact [ms]")
    right.set_ylim(1.15 * residual[shown].min(), 1.25 * residual[shown].max())
    right.set_title("residual [N m], six joints", fontsize=11)
    right.spines[["top", "right"]].set_visible(False)
    lines = right.plot(1e3 * t[shown], residual[shown] * np.nan, linewidth=1.4)
    mark = right.axvline(1e3 * (start - onset), color="tab:red", visible=False)
    mark_text = right.text(
        1e3 * (start - onset) + 8, 1.12 * residual[shown].max(),
        f"alarm after {1e3 * (start - onset):.0f} ms", color="tab:red", visible=False,
    )  # fmt: skip

    def draw(k):
        image.set_data(scene.picture(k))
        for joint, line in enumerate(lines):
            line.set_ydata(np.where(t[shown] <= t[k], residual[shown, joint], np.nan))
        up = trace.t[k] >= start
        mark.set_visible(up)
        mark_text.set_visible(up)
        text.set_text("collision" if up else "free")
        text.set_color("tab:red" if up else "tab:green")

    frames = [*frames, *[frames[-1]] * 12]
    FuncAnimation(figure, draw, frames=frames).save(target, PillowWriter(fps=1 / STEP / SLOWER))


if __name__ == "__main__":
    main(*sys.argv[1:2])
