"""From a real arm's collision-free logs to a calibrated, working detector."""

import json
from dataclasses import replace

import numpy as np
import pytest

from tauguard.cli import main

pytestmark = pytest.mark.data
TEST = "ur-20_02_10-30sec_12harm.csv"


@pytest.fixture(scope="module")
def folder(data_dir):
    folder = data_dir / "ur10e"
    if not folder.is_dir():
        pytest.skip("no ur10e folder in the real data")
    return folder


def test_calibrate_train_detect(folder, tmp_path, capsys):
    names = ["20_01_31-unload", "20_02_06-20sec_10harm", "20_02_12-40sec_12harm"]
    logs = [str(folder / "free" / f"ur-{name}.csv") for name in names]
    logs.append(str(folder / "jointwise" / "ur-20_01_22-joint_3.csv"))
    robot, model = tmp_path / "ur10e.calibrated.urdf", tmp_path / "model.tauguard"
    common = ["--columns", "ur10e"]
    given = ["--robot", str(folder / "ur10e.urdf"), "--out", str(robot)]
    main(["calibrate", *logs, *given, *common, "--json", str(tmp_path / "calibrate.json")])
    figures = json.loads((tmp_path / "calibrate.json").read_text())
    assert "from the gains of the preset ur10e\n" in capsys.readouterr().out
    excitation = [v for k, v in figures["held_out_rms_nm"].items() if "joint" not in k]
    for rms in excitation:
        assert all(a < b for a, b in zip(rms, [2.0, 2.3, 1.0, 0.4, 0.4, 0.3], strict=True))
    main(["train", "--free", *logs, "--robot", str(robot), *common, "--model", str(model)])
    assert "trained on 4 logs" in capsys.readouterr().out
    log = str(folder / "free" / TEST)
    main(["detect", log, "--robot", str(robot), *common, "--model", str(model), "--payload", "0"])
    assert "0 alarms in 38" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "columns", "alike"), [("ur5", "ur5", {(3, 4), (4, 5)}), ("ur10e", "ur10e", {(4, 5)})]
)
def test_exchanged_joints_of_real_logs_are_named(data_dir, name, columns, alike):
    """All columns of two wrist joints may be exchanged: these look alike, and are not named."""
    from tauguard import read_logs
    from tauguard.detectors.calibration.column_order import misreadings, order_findings
    from tauguard.detectors.calibration.initial_arm import initial_arm
    from tauguard.detectors.calibration.recording import Recording, moving

    read = read_logs((data_dir / name / "free",), columns, robot=data_dir / name / f"{name}.urdf")
    own, _ = moving(read)
    arm, _ = initial_arm(read.numbers, list(own.values()), (), "auto")
    assert not order_findings(arm, own)
    for a, b in ((0, 2), (3, 4), (4, 5)):
        order = [b if j == a else a if j == b else j for j in range(6)]
        names = (arm.robot.joint_names[a], arm.robot.joint_names[b])
        for fields in (("current",), ("q", "qd", "current")):
            mixed = {
                log: Recording(
                    replace(trace, **{key: getattr(trace, key)[:, order].copy() for key in fields})
                )
                for log, trace in ((log, one.trace) for log, one in own.items())
            }
            if (a, b) in alike and "q" in fields:
                traces_of = [one.trace for one in mixed.values()]
                changes = {tuple(key): change for change, *key in misreadings(arm, traces_of)}
                assert changes[a, b, "columns"] > -1, changes
                assert not order_findings(arm, mixed)
                continue
            assert order_findings(arm, mixed)[0].where == names


def test_a_stranger_s_log_with_three_kinds_of_wrong_columns(data_dir):
    """Currents of two joints exchanged, one wrapped position, one joint's current negated."""
    import tauguard as tg

    robot = data_dir / "ur5" / "ur5.urdf"
    free = tg.read_logs(data_dir / "ur5" / "free", "ur5", robot=robot)
    traces = {}
    for name, log in free.items():
        trace = log.trace
        q, current = trace.q.copy(), trace.current[:, [0, 2, 1, 3, 4, 5]]
        current[:, 3] *= -1
        about = np.median(q[:, 0])  # of a vertical axis, whose zero is anywhere
        q[:, 0] = np.mod(q[:, 0] - about, 2 * np.pi) - np.pi
        traces[name] = replace(trace, q=q, current=current)
    logs = tg.read_logs(traces, robot=robot)
    with pytest.raises(tg.findings.RefusedError) as stop:
        tg.calibrate(logs)
    names = free.joint_names
    findings = stop.value.findings
    assert all(names[0] in finding.where for finding in findings.of("wrapped"))
    assert findings.of("wrapped")
    where = {finding.where for finding in findings.of("order")}
    assert {(names[1], names[2]), (names[3],)} <= where
    assert any(names[3] in finding.where for finding in findings.of("signs"))
