"""The files on which the golden commands work: logs of small synthetic arms, and recordings."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np

from tauguard.traces import Trace, write_mcap
from tests.detectors.synthetic_arm import GAIN, XML, held_joint, record
from tests.oracles.added_contact import Added, add_contact

LENGTH = 20.0  # s
#: Folder of the real logs.
DATA = Path(os.environ.get("TAUGUARD_DATA", Path(__file__).parents[2] / "data"))
GROUPS = ("q", "qd", "current")


def csv(path: str, trace: Trace, *, t=None, scale=1.0, names="", **more: np.ndarray):
    """A table with a header; ``t``: other times; ``more``: columns after those of the trace."""
    joints = names.split() or [str(k + 1) for k in range(trace.q.shape[1])]
    effort = "torque" if trace.meta.get("effort") == "torque" else "current"
    header = ["t", *(f"{kind}_{j}" for kind in ("q", "qd", effort) for j in joints), *more]
    columns = [trace.t if t is None else t, trace.q, trace.qd, scale * trace.current]
    table = np.column_stack([*columns, *more.values()])
    Path(path).parent.mkdir(exist_ok=True)
    # Seven digits: on another processor, the last bits of a sine may differ.
    np.savetxt(path, table, delimiter=",", header=",".join(header), comments="", fmt="%.7g")


def column_map(path: str, effort: str = "current", **more):
    groups = {kind: [f"{kind}_{j}" for j in (1, 2, 3)] for kind in ("q", "qd", effort)}
    Path(path).write_text(json.dumps({"t": "t"} | groups | more))


def ordered(trace: Trace, order: list[int], *groups: str, sign: tuple[int, ...] = (1, 1, 1)):
    """The trace with the columns of ``groups`` in another order, or with other signs."""
    signs = np.array(sign)
    return replace(trace, **{group: getattr(trace, group)[:, order] * signs for group in groups})


def pushed(trace: Trace, *starts: float, size=(28.0, 20.0, 10.0), seconds: float = 0.2) -> Trace:
    for start in starts:
        trace = add_contact(trace, GAIN, Added(start, seconds, size, "push"))
    return trace


def labels(trace: Trace, *starts: float, seconds: float = 0.2) -> np.ndarray:
    return sum(((trace.t >= a) & (trace.t <= a + seconds)).astype(int) for a in starts)


def robots():
    Path("arm.xml").write_text(XML)
    light = XML.replace('mass="4"', 'mass="1"').replace('mass="2"', 'mass=".5"')
    Path("light.xml").write_text(light)
    Path("longer.xml").write_text(XML.replace('body pos=".4 0 0"', 'body pos=".5 0 0"'))
    finger = """<body pos=".3 0 .05"><joint name="finger" type="slide" axis="0 1 0"/>
<geom type="box" size=".01 .01 .03" mass=".05"/></body>"""
    Path("gripper.xml").write_text(
        XML.replace("</body></body></body>", f"{finger}</body></body></body>")
    )
    Path("ur3.xml").write_text(XML.replace("<mujoco>", '<mujoco model="ur3">'))


def maps():
    column_map("columns.json")
    column_map("torques.json", "torque")
    column_map("degrees.json", degrees=True)
    Path("bad.json").write_text('{"t": "t", "x": 1}')


def free_logs():
    free = [record(seed, LENGTH) for seed in range(3)]
    for k, trace in enumerate(free):
        csv(f"free/log{k}.csv", trace)
        torque = replace(trace, current=trace.current * GAIN, meta={"effort": "torque"})
        csv(f"torques/log{k}.csv", torque)
    for k, trace in enumerate(free[:2]):
        named = replace(trace, meta={"log": f"log{k}"})
        Path("mcap").mkdir(exist_ok=True)
        write_mcap(Path(f"mcap/log{k}.mcap"), named)
    csv("laden.csv", record(20, LENGTH, load=3.0))
    for k in range(2):
        csv(f"held/held{k}.csv", held_joint(k))
    still = record(4, 8.0)
    still.q[:], still.qd[:], still.current[:] = still.q[0], 0.0, still.current[0]
    csv("still.csv", still)
    csv("short.csv", record(4, 5.0))
    odd = held_joint(12)
    odd.current[:, 2] += 20.0 / GAIN[2]
    csv("odd.csv", odd)
    for k, trace in enumerate(free):
        csv(f"pushes/pushed{k}.csv", pushed(trace, 4.0 + k, 13.0 + k))
    often = (3.0, 5.5, 11.0, 13.0, 15.0, 18.0)
    csv("touched.csv", pushed(record(6, LENGTH), *often, size=(14.0, -18.0, 9.0), seconds=0.4))


def strange_logs():
    """Logs whose columns, units or rows are not what they should be."""
    trace = record(7, LENGTH)
    csv("swapped.csv", ordered(trace, [1, 0, 2], "current"))
    csv("exchanged.csv", ordered(trace, [0, 2, 1], *GROUPS))
    csv("negated.csv", ordered(trace, [0, 1, 2], "current", sign=(1, -1, 1)))
    csv("turned.csv", ordered(trace, [0, 1, 2], *GROUPS, sign=(1, 1, -1)))
    csv("backward.csv", ordered(trace, [0, 1, 2], "qd", sign=(1, -1, 1)))
    csv("milli.csv", trace, scale=1000.0)
    csv("degrees.csv", replace(trace, q=np.degrees(trace.q), qd=np.degrees(trace.qd)))
    csv("ms.csv", replace(trace, t=1000 * trace.t))
    touch = pushed(trace, 15.0)
    csv("labelled.csv", touch, label=labels(touch, 15.0))
    flat = replace(trace, current=trace.current.copy())
    flat.current[800:840, 1] = 30.0
    csv("saturated.csv", flat)
    rows = np.r_[0:1000, 1100 : len(trace.t)]
    csv("gap.csv", Trace(trace.joint_names, *(getattr(trace, x)[rows] for x in ("t", *GROUPS))))
    late = replace(trace, t=trace.t + 0.02 * (np.arange(len(trace.t)) >= 700))
    csv("late.csv", late)
    csv("twice.csv", trace, t=np.concatenate([trace.t[:900], trace.t[899:-1]]))
    two = Trace(("a", "b"), trace.t, *(getattr(trace, x)[:, :2] for x in GROUPS))
    csv("two.csv", two, names="a b")
    Path("empty.csv").write_text("")
    Path("words.csv").write_text("t,q_1\n0,hello\n1,2\n")
    cells = Path("free/log0.csv").read_text().splitlines()
    cells[100] = cells[100].rpartition(",")[0] + ","
    Path("hole.csv").write_text("\n".join(cells) + "\n")


def watched_logs():
    """Logs to detect collisions in."""
    trace = record(8, LENGTH)
    csv("quiet.csv", trace)
    touch = pushed(trace, 12.5, 16.0)
    csv("pushed.csv", touch)
    csv("clock.csv", replace(touch, t=touch.t + 1000.0))
    csv("truth.csv", touch, contact=labels(touch, 12.5, 16.0, 18.0))
    csv("early.csv", pushed(trace, 4.0), contact=labels(trace, 4.0))
    frozen = replace(touch, **{x: getattr(touch, x).copy() for x in GROUPS})
    for group in GROUPS:
        getattr(frozen, group)[1450:1490] = getattr(frozen, group)[1450]
    csv("frozen.csv", frozen)
    write_mcap(Path("pushed.mcap"), touch)
    csv("slow.csv", Trace(trace.joint_names, *(getattr(trace, x)[::5] for x in ("t", *GROUPS))))


def recordings():
    """Recordings with truth of the simulated arm: some with collisions, some without."""
    from tauguard.datasets import free_episodes, struck_episodes, write_dataset
    from tauguard.models import cura6

    Path("cura6.xml").write_text(cura6.arm_xml())
    struck = struck_episodes(6, 1, 4, (30.0,))
    write_dataset(struck + free_episodes(6, 2, 6.0, (30.0,)), Path("recordings"), workers=1)
    write_dataset(free_episodes(7, 3, 6.0, (30.0,)), Path("calm"), workers=1)
    write_dataset(struck_episodes(9, 1, 4, (30.0,)), Path("unseen"), workers=1)
    for folder in ("recordings", "calm", "unseen"):  # names contain a hash of the episode
        for k, path in enumerate(sorted(Path(folder).iterdir())):
            path.rename(f"{folder}/{k}.mcap")
    Path("nothing").mkdir()
    Path("damaged.tauguard").write_bytes(b"PK\x03\x04 not a model")


def write_all():
    """Write all files into the working folder."""
    for make in (robots, maps, free_logs, strange_logs, watched_logs, recordings):
        make()


def cut_logs():
    """Write the beginnings of real logs, and the robot files, into the working folder."""

    def head(source: str, target: str, rows: int):
        lines = (DATA / source).read_text().splitlines(keepends=True)
        Path(target).parent.mkdir(parents=True, exist_ok=True)
        Path(target).write_text("".join(lines[:rows]))

    for arm in ("ur5", "ur10e", "ur3"):
        head(f"{arm}/{arm}.urdf", f"{arm}/{arm}.urdf", 10**6)
    for k, log in enumerate(("no4", "no5", "no7")):
        head(f"ur5/free/{log}.csv", f"ur5/free/{k}.csv", 3500)
    head("ur5/contact/no7_pushed.csv", "ur5/no7_pushed.csv", 3000)
    for k, log in enumerate(("01_31-unload", "02_05-20sec_8harm", "02_06-20sec_10harm")):
        head(f"ur10e/free/ur-20_{log}.csv", f"ur10e/free/{k}.csv", 2000)
    head("ur10e/free/ur-20_01_13-load_2600.csv", "ur10e/loaded.csv", 2000)
    head("ur10e/free/ur-20_02_10-20sec_7harm.csv", "ur10e/test.csv", 2000)
    for k, log in enumerate(("id1", "id2")):
        head(f"ur3/free/{log}.csv", f"ur3/free/{k}.csv", 3000)
    head("panda_touch/a4.csv", "panda/a4.csv", 3000)
    lines = Path("panda/a4.csv").read_text().splitlines()
    bare = "".join(line.rpartition(",")[0] + "\n" for line in lines)
    Path("panda/unlabelled.csv").write_text(bare)
