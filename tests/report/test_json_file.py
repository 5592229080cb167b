"""Figures as JSON: plain values, and null where there is no number."""

import json

import numpy as np

from tauguard.report.json_file import write_json


def test_what_is_not_finite_is_null_and_loses_no_other_figure(tmp_path):
    row = {"a": np.float64("nan"), "b": [np.inf, 1.5], "c": np.array([[1.0, -np.inf]]), "d": "nan"}
    write_json(tmp_path / "x.json", {"rows": [row], "n": np.int64(3), "yes": np.True_})
    back = json.loads((tmp_path / "x.json").read_text())
    kept = {"a": None, "b": [None, 1.5], "c": [[1.0, None]], "d": "nan"}
    assert back == {"rows": [kept], "n": 3, "yes": True}
