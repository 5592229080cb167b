"""The cloth study's closing summary: what the referees found, and what a quick run cannot deny."""

import pytest

from studies.cloth.summary import summary


def checked(**changed):
    row = {"study": "independent check", "set": "all", "kind": "vf", "n": 1000}
    row |= {"clear_certified": 700, "hit_certified": 100, "clear_tight": 650, "labels_differ": None}
    row |= dict.fromkeys(("contradictions", "misses", "false_hits", "late"), 0)
    return {**row, "early_most": 2e-10, **changed}


def met(rows, quick=False):
    return {row["question"]: row["met"] for row in summary(rows, quick)}


def test_each_error_that_the_referees_find_breaks_a_claim():
    part, labelled = checked(set="lattice"), checked(set="spikes", n=10, labels_differ=0)
    sound = met([part, checked(), labelled])
    assert set(sound.values()) == {True, None}
    for key in ("contradictions", "labels_differ", "misses", "false_hits", "late"):
        name = f"certified by independent check, 1010 queries: {key.replace('_', ' ')}"
        assert sound[name] is True
        for quick in (True, False):
            assert met([checked(), labelled | {key: 1}], quick)[name] is False
    assert met([checked(early_most=2e-9)])["error of the time, most"] is False


def test_shares_of_the_referees():
    (row,) = [r for r in summary([checked()], False) if r["question"].startswith("certified, vf")]
    assert row["measured"] == "80.0% by intervals, 65.0% by Tight-Inclusion too"
    (row,) = [
        r
        for r in summary([checked(clear_tight=None)], False)
        if r["question"].startswith("certified, vf")
    ]
    assert row["measured"] == "80.0% by intervals"


def test_a_slow_ratio_is_open_after_a_quick_run():
    rows = [
        {
            "study": "query peer", "set": "s", "kind": "vf", "peer": "ipctk AdditiveCCD",
            "ns": 90.0, "ab2pf_ns": 10.0, "speedup": 9.0,
        }
    ]  # fmt: skip
    assert list(met(rows, quick=True).values()) == ["full run"]
    assert list(met(rows).values()) == [False]
    rows[0]["speedup"] = 11.0
    assert list(met(rows, quick=True).values()) == [True]


def test_frames_are_compared_on_each_ones_own_volume_and_on_the_same():
    own, same = (
        {
            "study": "frame mean", "method": "iccd", "volume": volume, "scenes": 6,
            "times_ab2pf_mean": mean, "times_ab2pf_least": 1.0, "times_ab2pf_most": 6.0,
        }
        for volume, mean in (("k_dop18", 2.2), ("moving_k_dop14", 1.4))
    )  # fmt: skip
    name = "a frame, mean of 6 scenes: iccd over ab2pf, "
    assert met([own, same]) == {
        name + "each on its own volume": False,
        name + "both on moving_k_dop14": None,
    }


@pytest.mark.parametrize("quick", [True, False])
@pytest.mark.parametrize("mean", [1.0, 9.0])
def test_a_mean_over_all_scenes_is_not_judged_where_some_are_absent(mean, quick):
    row = {
        "study": "frame mean", "method": "iccd", "volume": "k_dop18", "scenes": 4,
        "times_ab2pf_mean": mean, "times_ab2pf_least": 1.0, "times_ab2pf_most": 9.0,
    }  # fmt: skip
    (open_,) = summary([row], quick, recorded=False)
    (judged,) = summary([row], quick, recorded=True)
    assert open_["met"] == "not judged: data absent"
    assert judged["met"] == (mean > 2.3 or ("full run" if quick else False))
    assert {**open_, "met": None} == {**judged, "met": None}
