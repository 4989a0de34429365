"""Contacts of the core: the points of pairs of shapes, and what a run records of those that touch."""

from __future__ import annotations

from typing import Any

import numpy as np

import pin_nonideal as pn
from pin_nonideal.description.contacts.pair_of_shapes import PairOfShapes
from pin_nonideal.scene.scene import compiled_scene


def points_of(scene: pn.Scene) -> list[Any]:
    """Return the descriptions of all contacts of the core, in the order of their rows."""
    contacts = compiled_scene(scene).spec.contacts
    return [point for c in contacts for point in (c.points if isinstance(c, PairOfShapes) else (c,))]


def point_loads(run: pn.Trajectory) -> np.ndarray:
    """Return the normal forces of the points of pairs of shapes that touch in a run [N], (nt, n)."""
    assert run.points is not None
    return run.points.loads


def closed_points(run: pn.Trajectory) -> np.ndarray:
    """Return which points of pairs of shapes are closed at each sample, (nt, n)."""
    assert run.points is not None
    return run.points.closed
