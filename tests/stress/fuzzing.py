"""Property-based runs: few examples in the normal test command, many with `-m stress`."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pin_nonideal.errors import PinNonidealError

few_and_many = pytest.mark.parametrize("examples", [25, pytest.param(3000, marks=pytest.mark.stress)])


def for_all(check, *strategies, examples):
    """Call `check` on reproducible examples of the strategies; the smallest failing example is shown.

    The check returns None for a named error, else any other value.  If all examples are rejected, or all are
    accepted, the test fails.
    """
    quiet = settings(
        max_examples=examples,
        derandomize=True,
        deadline=None,
        database=None,
        suppress_health_check=list(HealthCheck),
    )
    outcomes = set()

    def call(drawn):
        outcomes.add(check(*drawn) is not None)

    given(st.tuples(*strategies))(quiet(call))()
    assert outcomes == {True, False}, "all were taken" if outcomes == {True} else "all were refused"


def result_or_named_error(call):
    """Return the result of the call, or None for an error of this package; other errors propagate."""
    try:
        return call()
    except PinNonidealError as error:
        message = str(error)
    assert len(message.split()) > 3  # requirement, given value, remedy
    return None


class Odd:
    """An object without a meaning for any argument."""

    def __repr__(self):
        return "Odd()"


NUMBERS = [0, 1, -1, 3, 0.0, -0.0, 0.5, -2.5, 1e-3, 5e-324, 1e300, float("nan"), float("inf"), -float("inf")]
NAMES = [
    "",
    " ",
    "x",
    "xyz",
    "xx",
    "y",
    "crank_joint",
    "coupler_tip",
    "rocker_tip",
    "universe",
    "tip",
    "\0",
    "µ" * 50,
]
ARRAYS = [
    np.zeros(0), np.zeros(3), np.ones((2, 2)), np.full(3, np.nan), np.zeros(3, dtype=complex),
    np.array(["a"]), np.array(1.0), np.zeros((3, 0)), np.array([None]), np.eye(3), np.ones(6),
]  # fmt: skip
scalars = st.one_of(
    st.none(),
    st.booleans(),
    st.sampled_from(NUMBERS),
    st.sampled_from(NAMES),
    st.text(max_size=4),
    st.binary(max_size=3),
)
junk = st.one_of(
    scalars,
    st.sampled_from(ARRAYS),
    st.just(Odd()),
    st.just(len),
    st.just(lambda *_: None),
    st.just(lambda *_: [1.0, 0.0, 0.0]),
    st.lists(scalars, max_size=4),
    st.tuples(scalars, scalars),
    st.dictionaries(st.sampled_from(NAMES), scalars, max_size=2),
)
