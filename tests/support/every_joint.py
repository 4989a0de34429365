"""Arm with joints of every kind, and invalid inputs for it."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from .random_trees import tree

NAN, INF = float("nan"), float("inf")


def arm():
    model = tree(
        ["revolute x", "prismatic y", "spherical", "endless z", "free flyer"],
        np.random.default_rng(0),
        parents=[0, 1, 2, 3, 0],
    )
    model.name = "arm"
    return model


MODEL = arm()
Q, V = pin.neutral(MODEL), np.zeros(MODEL.nv)


def scaled(index, size, factor):
    """Return Q with a part of another length."""
    q = Q.copy()
    q[index : index + size] *= factor
    return q


def with_entry(x, index, value):
    """Return the array with one entry changed."""
    x = np.array(x, dtype=float)
    x[index] = value
    return x
