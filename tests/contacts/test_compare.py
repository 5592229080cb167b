"""The comparison's counts, on runs whose contacts are known."""

import mujoco
import numpy as np
import pytest

from tauguard.contacts import Contacts, compare, pair_kind, register
from tauguard.contacts.scenes import ContactScene, arm_boxes, ball_cloth, sphere_plate

BOUNCE = """<mujoco><option timestep="0.002" gravity="0 0 0"/><worldbody>
  <body name="wall"><geom type="box" size=".1 1 1" pos="1.1 0 0"/></body>
  <body name="ball"><freejoint/><geom size=".1" mass="1" solref="-40000 0"/></body>
  </worldbody></mujoco>"""


def bounce(speed):
    """A ball that reaches the wall after 0.9 m."""
    model = mujoco.MjModel.from_xml_string(BOUNCE)
    qvel = np.array([speed, 0, 0, 0, 0, 0.0])
    return ContactScene("bounce", model, model.qpos0.copy(), qvel, seconds=0.5)


def test_one_bounce_is_one_event_seen_at_its_time():
    report = compare(bounce(2.001), ["mujoco", "rigid", "cloth"])
    assert len(report.outcomes) == 1
    outcome = report.outcomes[0]
    assert outcome.partners == ("body wall", "body ball")
    assert outcome.onset == pytest.approx(0.9 / 2.001, abs=1e-6)
    assert outcome.generated
    assert outcome.held
    rigid = report["rigid"]
    assert (rigid.events, rigid.recalled, rigid.recall, rigid.precision) == (1, 1, 1.0, 1.0)
    assert rigid.steps == rigid.steps_found > 1
    assert rigid.delay_ms == pytest.approx(0, abs=1e-3)
    # MuJoCo knows at the end of the step in which it happens.
    steps = 0.9 / 2.001 / 0.002
    assert rigid.lead_ms == pytest.approx(2 * (np.ceil(steps) - steps), abs=1e-3)
    assert rigid.depth_mm == pytest.approx(0, abs=1e-9)
    assert rigid.normal_deg == pytest.approx(0, abs=1e-6)
    assert report["mujoco"].lead_ms == 0
    assert report["mujoco"].depth_mm is report["mujoco"].normal_deg is None
    assert report["cloth"].events == 0
    assert report["cloth"].recall is None
    assert not report.disagreements
    assert rigid.us_per_step > 0
    assert report.steps == 250


class Blind:
    name = "blind"
    covers = frozenset({pair_kind("box", "sphere")})

    def __init__(self, model):
        pass

    def check(self, before, after):
        return Contacts.empty()


class Jumpy(Blind):
    """Claims a deep contact of the two geoms in every step."""

    name = "jumpy"

    def check(self, before, after):
        return Contacts([0.5], [[0, 1]], [[-1, -1]], [[-1, -1]], [[0, 0, 0]], [[1, 0, 0]], [-0.01])


def test_a_blind_and_a_jumpy_checker_are_told_apart():
    register("blind", Blind)
    register("jumpy", Jumpy)
    report = compare(bounce(2.0), ["blind", "jumpy"])
    blind, jumpy = report["blind"], report["jumpy"]
    assert (blind.recall, blind.precision, blind.reports) == (0.0, None, 0)
    assert [d.kind for d in blind.disagreements] == ["missed"]
    assert jumpy.recall == 1.0
    assert jumpy.reports == 250
    assert jumpy.precision == jumpy.correct / 250
    assert jumpy.steps <= jumpy.correct <= jumpy.steps + 2
    assert sum(d.kind == "false" for d in jumpy.disagreements) == 250 - jumpy.correct
    text = str(report)
    assert "blind missed: body wall and body ball" in text
    assert text.count("jumpy false: body wall and body ball, 10 mm, and ") == 1
    assert {row["checker"] for row in report.rows()} == {"blind", "jumpy"}


class Stray(Jumpy):
    """Reports a pair that it says it does not cover."""

    name = "stray"
    covers = frozenset({pair_kind("box", "mesh")})


def test_pairs_that_a_checker_does_not_cover_are_not_counted():
    register("stray", Stray)
    report = compare(bounce(2.0), ["stray"], seconds=0.46)
    stray = report["stray"]
    assert stray.not_covered == report.steps == 230
    assert (stray.events, stray.reports, stray.first, stray.lead_ms) == (0, 0, None, None)
    assert "stray: 230 contacts of pairs that it does not cover" in str(report)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"geom": [[0, 2]]}, "geom 2, expected -1 to 1"),
        ({"flex": [[-1, 0]]}, "flex 0, expected -1 to -1"),
        ({"time": [1.5]}, "time 1.5, expected 0 to 1"),
        ({"time": [np.nan]}, "time nan"),
        ({"distance": [np.nan]}, "distance nan, expected a finite number"),
        ({"normal": [[0, 0, 2]]}, r"normal \[0.0, 0.0, 2.0\], expected length 1, or NaN"),
        ({"normal": [[0, 0, np.nan]]}, r"normal \[0.0, 0.0, nan\], expected length 1, or NaN"),
        ({"geom": [[0, -1]]}, "a partner with a geom and a flex, or neither"),
    ],
)
def test_a_contact_of_another_model_or_step_is_refused(change, said):
    class Wrong(Blind):
        def check(self, before, after):
            row = {"time": [0.5], "geom": [[0, 1]], "flex": [[-1, -1]], "feature": [[-1, -1]]}
            row |= {"point": [[0, 0, 0]], "normal": [[1, 0, 0]], "distance": [0.0]}
            return Contacts(**row | change)

    register("wrong", Wrong, replace=True)
    with pytest.raises(ValueError, match=f"checker 'wrong': {said}"):
        compare(bounce(2.0), ["wrong"], seconds=0.01)


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize(("known", "angle"), [(1.0, 0.0), (-1.0, 180.0), (np.nan, None)])
def test_depth_and_normal_of_a_checker_that_looks_at_the_end_of_a_step(order, known, angle):
    class Late(Blind):
        """Closed form: the wall's face is at x = 1, the ball's radius is .1."""

        def check(self, before, after):
            distance = 1 - after.geom_xpos[1, 0] - 0.1
            if distance > 0:
                return Contacts.empty()
            normal = [-order * known, *((np.nan, np.nan) if np.isnan(known) else (0, 0))]
            pair, none = [[0, 1][::order]], [[-1, -1]]
            return Contacts([1], pair, none, none, [[np.nan] * 3], [normal], [distance])

    register("late", Late, replace=True)
    report = compare(bounce(2.001), ["late"])
    late = report["late"]
    assert late.depth_mm == pytest.approx(0, abs=1e-9)
    assert late.normal_deg == (None if angle is None else pytest.approx(angle, abs=1e-6))
    assert late.opposite == (late.normals if angle else 0)
    assert (late.normals > 1) == (angle is not None)
    said = f"late: {late.opposite} of {late.normals} normals are opposite to MuJoCo's"
    assert (said in str(report)) == bool(angle)


@pytest.mark.parametrize(
    ("covers", "said"),
    [(None, "no covers"), ({("sphere", "box", "x")}, "pair_kind"), ({("ball", "box")}, "'ball'")],
)
def test_a_checker_that_is_none_is_refused(covers, said):
    class Odd:
        name = "odd"

        def __init__(self, model):
            if covers is not None:
                self.covers = covers

        def check(self, before, after):
            return Contacts.empty()

    register("odd", Odd, replace=True)
    with pytest.raises(ValueError, match=said):
        compare(bounce(2.0), ["odd"], seconds=0.01)


@pytest.mark.parametrize("build", [ball_cloth, sphere_plate])
def test_what_mujoco_steps_over_the_swept_checkers_see(build):
    report = compare(build(speed=40.0), timestep=5e-3)
    outcome = report.outcomes[0]
    assert not outcome.generated
    assert not outcome.held
    seen = "cloth" if build is ball_cloth else "rigid"
    assert report[seen].recall == 1.0
    assert report[seen].precision == 1.0
    assert report["mujoco"].recall == 0.0
    assert [d.checker for d in report.disagreements] == ["mujoco"]


def test_recall_of_the_arm_between_boxes_is_one():
    report = compare(arm_boxes(), timestep=5e-3)
    rigid = report["rigid"]
    assert rigid.events >= 3
    assert rigid.recall == 1.0
    assert rigid.steps_found == rigid.steps
    assert rigid.precision == 1.0


def test_a_finely_stepped_run_is_a_second_yardstick():
    report = compare(bounce(2.001), ["mujoco", "rigid"], seconds=0.46, ground_truth=False, fine=20)
    impact = 0.9 / 2.001
    assert impact <= report.first_contact <= impact + 1e-4
    assert report["rigid"].first == pytest.approx(impact, abs=1e-6)
    assert impact < report["mujoco"].first <= impact + 2e-3
    off = 1e3 * (report["rigid"].first - report.first_contact)
    assert report["rigid"].first_error_ms == pytest.approx(off)
    never = compare(bounce(2.0), ["rigid"], seconds=0.1, ground_truth=False, fine=2)
    assert never.first_contact is None
    assert never["rigid"].first is None
    assert never["rigid"].first_error_ms is None
    flat = compare(bounce(2.001), ["cloth"], seconds=0.46, ground_truth=False, fine=2)
    assert flat.first_contact is not None  # of a ball and a plane, which cloth does not cover
    assert flat["cloth"].first_error_ms is None


def test_without_ground_truth_there_is_cost_but_no_judgement():
    report = compare(bounce(2.0), ["rigid"], seconds=0.05, ground_truth=False)
    assert report["rigid"].recall is None
    assert report["rigid"].events is None
    assert report.steps == 25
    assert report.outcomes == ()


def test_bad_input_is_named():
    with pytest.raises(ValueError, match=r"checkers 'rigid': expected a list of names"):
        compare("arm_boxes", "rigid")
    with pytest.raises(ValueError, match=r"scene 'moon': expected one of arm_cloth"):
        compare("moon")
    with pytest.raises(ValueError, match=r"checker 'eye': expected one of .*mujoco"):
        compare(bounce(1.0), ["eye"])
    with pytest.raises(ValueError, match=r"options of 'rigd': expected one of the checkers rigid"):
        compare("arm_boxes", ["rigid"], options={"rigd": {}})
    with pytest.raises(ValueError, match=r"'rigid': .*'bad'; its options are threshold, skip$"):
        compare("arm_boxes", ["rigid"], options={"rigid": {"bad": 1}})
    with pytest.raises(ValueError, match="seconds -1"):
        compare(bounce(1.0), seconds=-1)
    with pytest.raises(ValueError, match="fine 0"):
        compare(bounce(1.0), fine=0)
    with pytest.raises(KeyError, match="'cloth': expected one of rigid"):
        compare(bounce(1.0), ["rigid"], seconds=0.01)["cloth"]
