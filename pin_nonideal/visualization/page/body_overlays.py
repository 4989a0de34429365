"""What a reader of a replay may choose to see of bodies: boxes of inertia, collision shapes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin

from pin_nonideal.types import GeometryModel, Table

from .visuals import LINK_COLORS, Visual, visuals_of

# Collision shapes with more triangles are left out.
MAX_TRIANGLES = 20_000


def inertia_box(inertia: pin.Inertia) -> Table:
    """The even box of the same mass and inertia: edges [m] and orientation (x, y, z, w) in its frame."""
    moments, axes = np.linalg.eigh(np.asarray(inertia.inertia))
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] *= -1.0
    squares = 6.0 * (moments.sum() - 2.0 * moments) / (inertia.mass or 1.0)
    return {
        "edges": np.sqrt(np.maximum(squares, 0.0)).tolist(),
        "turn": pin.Quaternion(axes).coeffs().tolist(),
    }


def collisions_of(collision_model: GeometryModel | None) -> list[Visual]:
    """Collision shapes, unless they have too many triangles in total."""
    if collision_model is None:
        return []
    overlays, room = [], MAX_TRIANGLES
    for visual in visuals_of(collision_model, MAX_TRIANGLES):
        if visual.shape.kind != "plane" and len(visual.shape.triangles) <= room:
            room -= len(visual.shape.triangles)
            overlays.append(visual)
    return overlays


def colored_collisions(collision_model: GeometryModel | None) -> list[Visual]:
    """Return collision shapes in place of visuals: in the color of their link, unless they override it.

    Args:
        collision_model: shapes, or None.
    """
    if collision_model is None:
        return []
    own = {item.name for item in collision_model.geometryObjects if item.overrideMaterial}
    return [
        shape if shape.name in own else replace(shape, color=LINK_COLORS[shape.joint % len(LINK_COLORS)])
        for shape in collisions_of(collision_model)
    ]
