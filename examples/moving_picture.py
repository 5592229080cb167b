"""The moving picture of the README: a ball hits an arm, the residual rises, the alarm starts.

    python examples/moving_picture.py [PICTURE.gif]

It runs eight times slower than real time. It needs an OpenGL that MuJoCo finds.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter

import tauguard
from tauguard.datasets import free_episodes, struck_episodes
from tauguard.envs import CollisionPlan, Episode, simulate
from tauguard.replay import video_frames

SPAN, STEP = (-0.2, 0.3), 0.008  # time shown about the onset, time per frame [s]
SLOWER = 8
#: Azimuth, elevation [deg] and distance of the camera, at which nothing hides the ball.
VIEW = (215.0, -12.0, 1.8)


def main(target="struck.gif"):
    speeds = (30.0,)
    episodes = struck_episodes(1, 1, 8, speeds) + free_episodes(1, 6, 20.0, speeds)
    motion = tauguard.simulated(simulate(episode) for episode in episodes)
    detector = tauguard.train(motion, method="srq-svr", false_alarms_per_hour=1)
    strike = CollisionPlan("strike", time=3.0, link=4)
    trace = simulate(Episode(seed=1, seconds=6, collisions=(strike,)))
    found = detector.detect(trace)
    onset, start = trace.truth.collisions[0].onset, found.alarms[0].start
    print(f"alarm {1e3 * (start - onset):.0f} ms after the contact")
    residual = tauguard.residual(trace)
    residual -= residual[np.searchsorted(trace.t, onset) - 1]

    t = trace.t - onset
    seconds, rate = SPAN[1] - SPAN[0], 1 / STEP
    pictures = list(video_frames(trace, onset + SPAN[0], seconds, rate, (320, 380), VIEW))
    shown = (t >= SPAN[0]) & (t <= SPAN[1])
    figure = plt.figure(figsize=(8.4, 3.6), dpi=90, layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.17, 1))
    left.set_axis_off()
    image = left.imshow(pictures[0])
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

    def draw(frame):
        image.set_data(pictures[min(frame, len(pictures) - 1)])
        now = SPAN[0] + frame * STEP
        for joint, line in enumerate(lines):
            line.set_ydata(np.where(t[shown] <= now, residual[shown, joint], np.nan))
        up = now >= start - onset
        mark.set_visible(up)
        mark_text.set_visible(up)
        text.set_text("collision" if up else "free")
        text.set_color("tab:red" if up else "tab:green")

    moving = FuncAnimation(figure, draw, frames=len(pictures) + 12)  # the last one stays a while
    moving.save(target, PillowWriter(fps=rate / SLOWER))


if __name__ == "__main__":
    main(*sys.argv[1:2])
