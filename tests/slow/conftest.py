"""Fixtures of the slow tests: the seed, and the counts that the run prints at its end."""

import pytest


@pytest.fixture(scope="session")
def slow_seed(request) -> int:
    """The seed of every random input: ``--slow-seed``."""
    return request.config.getoption("--slow-seed")


@pytest.fixture
def counts(record_property):
    """``counts(name=value, ...)`` keeps figures of a test for the summary."""
    return lambda **found: record_property("counts", found)
