"""Bitwise comparison of runs."""

from __future__ import annotations

import dataclasses

import numpy as np

import pin_nonideal as pn


def assert_same_run(one, other):
    """Assert equal arrays, names, events and counters; scene and wall time may differ."""
    for field in dataclasses.fields(pn.Trajectory):
        first, second = getattr(one, field.name), getattr(other, field.name)
        if field.name in ("scene", "contact_points"):  # `points` has the values of the second one
            continue
        if field.name in ("dense", "user_events", "points"):
            assert_same_parts(first, second, field.name)
            continue
        if isinstance(first, np.ndarray):
            np.testing.assert_array_equal(first, second, err_msg=field.name, strict=True)
        elif isinstance(first, dict):
            assert list(first) == list(second), field.name
            for name, column in first.items():
                np.testing.assert_array_equal(column, second[name], err_msg=name, strict=True)
        elif field.name == "stats":
            assert dataclasses.replace(first, wall_s=0.0) == dataclasses.replace(second, wall_s=0.0)
        else:
            assert first == second, field.name


def assert_same_parts(one, other, name):
    """Assert bitwise equal arrays of dense output, or of the events of each function."""
    pairs = (
        zip(one, other, strict=True) if isinstance(one, list) else [(one, other)] if one is not None else []
    )
    assert (one is None) == (other is None), name
    for first, second in pairs:
        for key, x in vars(first).items():
            if isinstance(x, np.ndarray):
                np.testing.assert_array_equal(x, getattr(second, key), err_msg=f"{name}.{key}", strict=True)
            elif key in ("names", "contacts"):
                assert x == getattr(second, key), f"{name}.{key}"
