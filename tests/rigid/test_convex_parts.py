"""Convex parts of a mesh."""

import sys

import numpy as np
import pytest

from tauguard.rigid import MeshTree, convex_parts


def test_bad_arguments(monkeypatch):
    tree = MeshTree([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    with pytest.raises(ValueError, match="mesh: a list, expected a MeshTree"):
        convex_parts([])
    for concavity in (0, 2, np.nan):
        with pytest.raises(ValueError, match=r"concavity: .* expected a number from 0.01 to 1"):
            convex_parts(tree, concavity)
    with pytest.raises(ValueError, match="most: 0, expected"):
        convex_parts(tree, most=0)
    monkeypatch.setitem(sys.modules, "coacd", None)
    with pytest.raises(ModuleNotFoundError, match=r"pip install 'tauguard\[meshes\]'"):
        convex_parts(tree)
