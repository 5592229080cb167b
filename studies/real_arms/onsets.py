"""Onsets of pushes from an untouched run of the same program: the script of ``contacts.csv``.

``python -m studies.real_arms.onsets`` prints the file. It uses positions, velocities and currents
alone, and no detector. Each row of the pushed log is matched with a row of the untouched log:
nearest in positions and velocities and, of rows that are as near, the one whose time differs least
from the offset so far. A contact is a stretch in which the difference of the drives' torques
(median of five rows) is above 3 N m at some joint, with a peak above 12 N m. The untouched parts of
these logs have peaks up to 11.1 N m. In no7 the two runs fit together worse, so that its onsets
count as found by eye.
"""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.spatial import cKDTree

from tauguard.arrays import Array, runs
from tauguard.benchmark.arms import ARMS, initial_arm, logs
from tauguard.benchmark.contacts import MOVES
from tauguard.traces import Trace

#: Torques at which a contact begins and ends, and that its peak exceeds [N m].
EDGE, PEAK = 3.0, 12.0
#: Weight of a velocity in a distance of positions [s]; rows that are less farther than the nearest
#: are as near [rad]; number of nearest rows; weight of the present row in the running offset.
TIMES_SPEED, AS_NEAR, ROWS, FOLLOWS = 0.05, 2e-3, 30, 0.02
#: Time at the beginning in which the runs are not yet aligned [s].
ALIGNED = 0.5
TRUTH = {"no5_pushed": "same program", "no7_pushed": "by eye"}

HEAD = """\
# Contacts in logs without a sensor or a switch: seconds from the log's first sample.
# same program: from where the torque less that of an untouched run of the program passes 3 N m, to
# where it falls below; `python -m studies.real_arms.onsets` prints these rows and those of
# no7_pushed, whose runs fit together worse. ur-static: the change of the currents, seen by a
# person; no10_standing_pushed: likewise, to the peak.
log,onset,end,state,truth
"""
#: What a person saw.
BY_EYE = """\
ur-static,3.2,5.8,standing,by eye
ur-static,11.6,15.8,standing,by eye
ur-static,17.1,21.1,standing,by eye
ur-static,25.4,30.9,standing,by eye
ur-static,38.0,43.0,standing,by eye
ur-static,43.9,45.5,standing,by eye
no10_standing_pushed,3.22,3.42,standing,by eye
no10_standing_pushed,5.25,5.45,standing,by eye
no10_standing_pushed,6.15,6.47,standing,by eye
no10_standing_pushed,7.95,8.27,standing,by eye
no10_standing_pushed,9.7,10.4,standing,by eye
"""


def same_rows(pushed: Trace, free: Trace) -> Array:
    """For each row of the pushed log, the row of the untouched one, shape (T,)."""
    tree = cKDTree(np.hstack([free.q, TIMES_SPEED * free.qd]))
    distance, near = tree.query(np.hstack([pushed.q, TIMES_SPEED * pushed.qd]), k=ROWS)
    row, offset = np.zeros(len(pushed.t), dtype=int), 0.0
    for k, (far, rows) in enumerate(zip(distance, near, strict=True)):
        alike = rows[far < far[0] + AS_NEAR]
        late = free.t[alike] - free.t[0] - (pushed.t[k] - pushed.t[0])
        best = int(np.argmin(np.abs(late - offset)))
        row[k], offset = alike[best], (1 - FOLLOWS) * offset + FOLLOWS * late[best]
    return row


def contacts(pushed: Trace, free: Trace, gain: Array) -> list[tuple[float, float, str]]:
    """Onset, end [s] and state of each contact."""
    change = gain * (pushed.current - free.current[same_rows(pushed, free)])
    padded = np.pad(change, ((2, 2), (0, 0)), mode="edge")
    size = np.abs(np.median(sliding_window_view(padded, 5, axis=0), axis=-1)).max(axis=1)
    t, found = pushed.t - pushed.t[0], []
    for first, after in runs(size > EDGE):
        top = first + int(np.argmax(size[first:after]))
        if t[first] < ALIGNED or size[top] <= PEAK:
            continue
        speed = np.median(np.abs(pushed.qd[first : top + 1]).max(axis=1))
        state = "moving" if speed > MOVES else "standing"
        found.append((float(t[first]), float(t[after - 1]), state))
    return found


def table() -> str:
    """The text of ``contacts.csv``."""
    arm = ARMS["ur5"]
    by_name = {log.name: log.trace for log, _ in logs("ur5")}
    gain = initial_arm(arm).drive_gain
    lines = [
        f"{name},{onset:.2f},{end:.2f},{state},{TRUTH[name]}\n"
        for name, program in arm.same_program.items()
        for onset, end, state in contacts(by_name[name], by_name[program], gain)
    ]
    return HEAD + BY_EYE + "".join(lines)


if __name__ == "__main__":
    print(table(), end="")
