"""The map over processes: answers in the order of the jobs, however many processes there are."""

import math

import pytest

from studies.workers import Workers


@pytest.mark.parametrize("count", [1, 2])
def test_answers_come_in_the_order_of_the_jobs(count):
    jobs = [float(k * k) for k in range(40)]
    with Workers(count) as each:
        assert list(each(math.sqrt, jobs)) == [float(k) for k in range(40)]


def test_an_error_in_a_job_is_raised():
    with Workers(2) as each, pytest.raises(ValueError, match=r"math domain|nonnegative"):
        list(each(math.sqrt, [1.0, -1.0]))
