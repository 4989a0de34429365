"""Plots of one quantity against another as a page carries them, with the times of their points."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pin_nonideal.types import Array, Table

from .binary import Payload
from .signal_list import without_rounding
from .signals import Plot
from .xy_plots import Relation, available, is_relation, relations_of

if TYPE_CHECKING:
    from pin_nonideal.trajectory.trajectory import Trajectory

# Maximum number of points of one curve, of all curves together, and of the limits of a law.
MAX_CURVE_POINTS, MAX_POINTS, MAX_LIMIT_POINTS = 1_500, 60_000, 300


def names_relation(run: Trajectory, item: Any) -> bool:
    """Check if an item of `plots` names a relation and not a joint.

    Args:
        run: the run.
        item: entry of `plots`.
    """
    return is_relation(item) and item not in list(run.scene.model.names)


def stored_relations(
    payload: Payload, run: Trajectory, finer: Trajectory, requested: list[str]
) -> list[Table]:
    """Return the relations of a run: the requested ones, which are shown, and others for the reader's choice.

    Args:
        payload: payload that stores their points.
        run: the run.
        finer: the same run with more samples, for phase planes.
        requested: names, as `relations_of` takes them.
    """
    more = [name for name in available(run) if name not in requested]
    each = min(MAX_CURVE_POINTS, MAX_POINTS // max(len(requested) + len(more), 1))
    stored = []
    for name in [*requested, *more]:
        source = finer if name.split(" ", 1)[0] == "phase" else run
        for relation in relations_of(source, name):
            stored.append(_store(payload, source, name, relation, each) | {"shown": name in requested})
    return stored


def _store(payload: Payload, run: Trajectory, name: str, relation: Relation, points: int) -> Table:
    curves = [_curve(payload, run, label, *pair, points) for label, pair in relation.curves.items()]
    bounds = [_bound(payload, label, *pair) for label, pair in relation.bounds.items()]
    quantity, _, unit = relation.y.partition(" ")
    return {
        "name": name,
        "title": relation.title,
        "x": relation.x,
        "y": unit if quantity in relation.title.lower() else relation.y,
        "note": relation.note,
        "curves": curves,
        "bounds": bounds,
    }


def _curve(payload: Payload, run: Trajectory, label: str, x: Array, y: Array, points: int) -> Table:
    """Return the points of a curve with their times; NaN separates the parts of a broken curve."""
    t = np.asarray(run.t, dtype=float)
    if len(x) > len(t):  # the curve has breaks
        at = np.flatnonzero(np.isnan(x)) - np.arange(len(x) - len(t))
        t = np.insert(t, at, t[at])
    thin = Plot(label, "", t, {"x": x, "y": y}).thinned(max(points // 4, 25))
    values = {key: without_rounding(part, 1e-12 * _largest_value(part)) for key, part in thin.curves.items()}
    return {"label": label, "t": payload.add(thin.t, "f8")} | {k: payload.curve(v) for k, v in values.items()}


def _bound(payload: Payload, label: str, x: Array, y: Array) -> Table:
    """Return the points of a law, in the order of x."""
    chosen = np.unique(np.linspace(0, len(x) - 1, MAX_LIMIT_POINTS).astype(int))
    order = chosen[np.argsort(x[chosen], kind="stable")]
    return {"label": label, "x": payload.add(x[order]), "y": payload.add(y[order])}


def _largest_value(values: Array) -> float:
    return float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
