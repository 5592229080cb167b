"""The page's table of ``info`` is what comes out: every key, its shape, in every environment."""

import re
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from tauguard.environments import ENVIRONMENTS

PAGE = Path(__file__).resolve().parents[2] / "docs" / "howto" / "environments.md"


def table(terms):
    text = PAGE.read_text().partition("## Read `info`")[2]
    lines = next(part for part in text.split("\n\n") if part.startswith("| key")).splitlines()[2:]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    assert all(len(row) == 3 and row[2] for row in cells)
    names = [re.fullmatch(r"`(\w+)`(?: \((.+)\))?", row[0]).groups("") for row in cells]
    shapes = {key: tuple(re.findall(r"\w+", shape)) for key, shape in names}
    del shapes["reward_NAME"]
    return shapes | {f"reward_{term}": () for term in terms}


@pytest.mark.parametrize("name", sorted(ENVIRONMENTS))
@pytest.mark.parametrize("keywords", [{}, {"checkers": ("mujoco",), "obstacles": ("person",)}])
def test_the_table_has_every_key_and_its_shape(name, keywords):
    env = gym.make(f"tauguard:{name}", detector="observer", **keywords)
    arm, stated = env.unwrapped, table(env.unwrapped.task.terms)
    sizes = {"n": len(arm.scene.joint_names), "k": len(arm.regions), "3": 3}
    sizes["checkers"] = len(keywords.get("checkers", ()))
    if not keywords:
        del stated["contacts"]
    expected = {key: tuple(sizes[part] for part in shape) for key, shape in stated.items()}
    for info in (env.reset(seed=0)[1], env.step(env.action_space.sample())[-1]):
        assert {key: np.shape(value) for key, value in info.items()} == expected


def test_native_copies_put_a_row_a_copy_in_front():
    envs = gym.make_vec(
        "tauguard:tauguard/Reach-v0", num_envs=2, vectorization_mode="vector_entry_point"
    )
    info = envs.reset(seed=0)[1]
    keys = {key for key in info if not key.startswith("_")}
    assert keys == set(table(envs.unwrapped.task.terms)) - {"contacts"}
    assert all(len(info[key]) == 2 for key in keys)
