"""Optional content of a replay: signals to plot, boxes of inertia, collision shapes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from pin_nonideal.types import Array, Table

from .coordinates import positions, velocities
from .mode_timeline import has_open_contact
from .signals import Plot
from .visuals import Visual, visuals_of

if TYPE_CHECKING:
    from pin_nonideal.scene.scene import Scene
    from pin_nonideal.trajectory.trajectory import Trajectory

# Number of points of all signals, and minimum and maximum number of points of one signal.
POINTS, LEAST, MOST = 120_000, 100, 800
# Maximum number of triangles of collision shapes on a page.
TRIANGLES = 20_000


@dataclass(frozen=True)
class Signal:
    """Curve that can be plotted.

    Attributes:
        label: name of the curve.
        unit: unit of the curve.
        t: times [s], (k,).
        values: values of the curve, (k,).
    """

    label: str
    unit: str
    t: Array
    values: Array


def signals_of(run: Trajectory, finer: Trajectory) -> list[Signal]:
    """Return all scalars of a run that can be plotted, thinned with their extremes.

    Args:
        run: run of the replay.
        finer: the same run with more samples, for curves that are not linear between samples.
    """
    model, found, smooth = run.scene.model, [], []  # found: curves that are linear between samples
    if getattr(run, "dense", None) is not None:
        run = finer
    for item in positions(model, finer.q):
        smooth.append((f"{item.label}, position", item.unit, item.values))
    for item in velocities(model, finer.v):
        smooth.append((f"{item.label}, velocity", item.unit, item.values))
    for name, values in (run.contact_forces or {}).items() if has_open_contact(run) else ():
        found.append((f"{name}, force", "N", np.linalg.norm(values, axis=1)))
    if run.a is not None:
        found += [(f"{x.label}, acceleration", x.unit, x.values) for x in velocities(model, run.a, "/s²")]
    for name, values in (run.energy or {}).items():
        found.append((f"energy: {name}", "J", values))
    for name, values in (run.power or {}).items():
        found.append((f"power: {name}", "W", values))
    if run.lam is not None:
        for name, rows in run.scene.constraint_slices.items():
            found.append((f"{name}, |lam|", "N, N m", np.linalg.norm(run.lam[:, rows], axis=1)))
    limits = getattr(run, "limits", None)
    if limits is not None:
        found += [(f"{x}, limit", "N, N m", limits[:, k]) for k, x in enumerate(run.element_names)]
    each = int(np.clip(POINTS // max(len(found) + len(smooth), 1), LEAST, MOST))
    return [
        _thinned(label, unit, values, np.asarray(source.t, dtype=float), each)
        for source, items in ((finer, smooth), (run, found))
        for label, unit, values in items
    ]


def _thinned(label: str, unit: str, values: Array, t: Array, points: int) -> Signal:
    plot = Plot(label, unit, t, {label: values}).thinned(points // 2)
    return Signal(label, unit, plot.t, plot.curves[label])


def inertia_box(inertia: pin.Inertia) -> Table:
    """Return the homogeneous box of equal mass and inertia: edges [m] and orientation (x, y, z, w)."""
    moments, axes = np.linalg.eigh(np.asarray(inertia.inertia))
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] *= -1.0
    squares = 6.0 * (moments.sum() - 2.0 * moments) / (inertia.mass or 1.0)
    return {
        "edges": np.sqrt(np.maximum(squares, 0.0)).tolist(),
        "turn": pin.Quaternion(axes).coeffs().tolist(),
    }


def collisions_of(scene: Scene) -> list[Visual]:
    """Return the collision shapes up to the maximum total number of triangles."""
    if scene.collision_model is None:
        return []
    found, room = [], TRIANGLES
    for visual in visuals_of(scene.collision_model):
        if visual.shape.kind != "plane" and len(visual.shape.triangles) <= room:
            room -= len(visual.shape.triangles)
            found.append(visual)
    return found
