"""What a scene needs: episodes to judge on carry loads, and a part that is left out costs less."""

import numpy as np
from matplotlib.figure import Figure

from studies.simulation import needs
from tauguard.detectors import figures, match
from tauguard.envs import Episode
from tauguard.traces import Collision

#: Ten seconds with a collision that nobody finds.
NONE = match([], [Collision("strike", 2.0, 2.1, 2, np.zeros(3), np.zeros(3), 20.0)], (0.0, 10.0))


def test_nothing_is_trained_and_judged_on():
    plan = needs.plan(needs.FULL, 3)
    assert not {one.seed for one in plan.train} & {one.seed for one in plan.judge}
    assert len({one.payload_g for one in plan.judge}) == len(needs.PAYLOADS)
    assert needs.poorer(plan.judge[1], "payloads").payload_g == 0
    assert needs.poorer(plan.judge[1], "model errors").mismatch is None
    assert needs.poorer(plan.judge[1], "ripple") == plan.judge[1]


def test_the_cost_of_the_whole_is_one_and_every_row_is_drawn():
    cost = needs.costs(Episode(seed=1, seconds=0.5), ("friction",), 1)
    assert cost["nothing"]["median"] == 1
    assert cost["friction"]["median"] > 0
    one = needs.TrainedWithout(figures([NONE]), figures([NONE]))
    rows = [needs._row(part, one, cost[part]) for part in cost]
    figure = Figure()
    needs.draw(rows, figure)
    labels = [tick.get_text() for tick in figure.axes[0].get_yticklabels()]
    assert labels == ["nothing", "friction"]
