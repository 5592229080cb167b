"""The hard cases in the bytes that the fuzz targets read (input.hpp): ``corpus.py FOLDER``.

Writes a folder a target, a file a case. A number is the byte 7 and its eight bytes.
"""

import struct
import sys
from pathlib import Path

import numpy as np

from tauguard.hard_cases import load_cases

#: First byte of a case: the target's own choice, then how hulls are chosen (see rigid.cpp).
HULL, IN_SPACE = 3, 0
ABSURD = (0.0, -0.0, 5e-324, 1e-300, 1.0, 1e6, 1e100, 1e160, 1e300, float("inf"), float("nan"))


def numbers(values):
    """The bytes of an array of numbers."""
    return b"".join(b"\x07" + struct.pack("<d", x) for x in np.asarray(values, float).ravel())


def hull(points):
    """The bytes of a hull of up to nine points."""
    return bytes([HULL, len(points) - 1]) + numbers(points)


def fits(case):
    """Whether both hulls have so few points as a target reads."""
    return max(len(case.given["a"]), len(case.given["b"])) <= 9


def convex(case):
    """The bytes of a pair of convex bodies, resting, on a straight way, or each on its own."""
    bodies = bytes([IN_SPACE]) + hull(case.given["a"]) + hull(case.given["b"])
    if case.kind == "convex_sweep":
        return [b"\x01" + bodies + numbers(case.given["displacement"])]
    return [bytes([target]) + bodies for target in (0, 2)]


def streams(rng):
    """Samples with one absurd number each, for the three kinds of detector."""
    for kind in range(3):
        for absurd in ABSURD:
            usual = b"\x05\x00" * 20
            bad = b"\x05\x01" + bytes([int(rng.integers(256))]) + numbers([absurd])
            yield bytes([int(rng.integers(256)), kind, 15]) + (usual + bad) * 10


def corpus():
    """Pairs of a target and bytes."""
    for case in load_cases():
        if case.kind in ("vertex_face", "edge_edge"):
            ends = numbers(case.given["x_t0"]) + numbers(case.given["x_t1"])
            yield "cloth", bytes([case.kind == "edge_edge", 7]) + ends
            faces = b"\x02\x02\x01\x01\x00\x01\x02\x01\x02\x03"  # a mesh of the four points
            yield "cloth", faces + numbers(case.given["x_t0"]) + numbers(case.given["x_t1"])
        elif case.kind in ("convex_overlap", "convex_sweep") and fits(case):
            yield from (("rigid", data) for data in convex(case))
    yield from (("streams", data) for data in streams(np.random.default_rng(0)))
    for core in range(6):
        for absurd in ABSURD:
            yield "contacts", bytes([core]) + numbers([1, absurd, 1]) + bytes([5 - core])


def main():
    """See the top of the file."""
    for number, (target, data) in enumerate(corpus()):
        folder = Path(sys.argv[1], target)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"case-{number:03d}").write_bytes(data)


if __name__ == "__main__":
    main()
