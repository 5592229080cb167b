"""Batches of bodies: what is refused, and that the message names the first offender."""

import numpy as np
import pytest

from tauguard.rigid import Boxes, Hulls, Parallelepipeds, Tetrahedra


def boxes(n=4):
    return {
        "center": np.zeros((n, 3)),
        "half_extents": np.ones((n, 3)),
        "rotation": np.tile(np.eye(3), (n, 1, 1)),
    }


def test_nan_names_argument_and_row():
    vertices = np.zeros((5, 4, 3))
    vertices[3, 1, 2] = np.nan
    with pytest.raises(ValueError, match=r"vertices: nan in row 3"):
        Tetrahedra(vertices)
    with pytest.raises(ValueError, match=r"edges: inf in row 1"):
        Parallelepipeds(np.zeros((2, 3)), [np.eye(3), np.eye(3) * np.inf])


def test_wrong_shape_says_what_fits():
    with pytest.raises(ValueError, match=r"vertices: shape \(4, 3\), expected \(N, 4, 3\)"):
        Tetrahedra(np.zeros((4, 3)))
    with pytest.raises(ValueError, match=r"edges: shape \(3, 3, 3\), expected \(2, 3, 3\)"):
        Parallelepipeds(np.zeros((2, 3)), np.zeros((3, 3, 3)))


def test_negative_half_extent():
    given = boxes()
    given["half_extents"][2, 1] = -1e-300
    with pytest.raises(ValueError, match=r"half_extents: -1e-300 in row 2"):
        Boxes(**given)


@pytest.mark.parametrize("entry", [1e-5, 1e200])
def test_rotation_that_is_none(entry):
    given = boxes()
    given["rotation"][1, 0, 1] = entry
    given["rotation"][3] = 2 * np.eye(3)
    with pytest.raises(ValueError, match=r"rotation: row 1 is not orthonormal"):
        Boxes(**given)


def test_flat_and_nearly_orthonormal_boxes_are_legal():
    given = boxes()
    given["half_extents"][:, 2] = 0.0
    given["rotation"] = given["rotation"] + 1e-7
    assert len(Boxes(**given)) == 4


@pytest.mark.parametrize(
    ("offsets", "message"),
    [
        ([0, 3, 3, 6], "hull 1 is empty"),
        ([0, 4, 2, 6], "hull 1 is empty"),
        ([0, 3, 5], "run from 0 to 5, expected 0 to 6"),
        ([1, 6], "run from 1 to 6"),
        ([0.0, 6.0], "expected .* integers"),
    ],
)
def test_offsets_must_partition_the_vertices(offsets, message):
    with pytest.raises(ValueError, match=message):
        Hulls(np.zeros((6, 3)), offsets)


@pytest.mark.parametrize("form", [np.array, np.ndarray.tolist], ids=["arrays", "lists"])
def test_hulls_of_several_arrays_say_how_to_join_them(form):
    clouds = [np.eye(3), np.concatenate([np.eye(3), np.zeros((1, 3))])]
    arrays = [form(cloud) for cloud in clouds]
    with pytest.raises(ValueError, match=r"vertices: 2 arrays, expected one \(M, 3\)"):
        Hulls(arrays, [0, 3, 7])
    joined = Hulls(np.concatenate(arrays), np.cumsum([0, *map(len, arrays)]))  # as it says
    assert len(joined) == 2
