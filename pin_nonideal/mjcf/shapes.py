"""Geoms of a compiled MJCF model as shapes for the replay and for collisions."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
import pinocchio as pin

from pin_nonideal.types import GeometryModel

from .tree import Tree, placement

PLANE, HFIELD, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX, MESH, SDF = range(9)  # of MuJoCo's mjtGeom
SHOWN_GROUPS = 3  # MuJoCo's viewer shows the groups 0, 1 and 2


def geom_names(m: Any) -> list[str]:
    """Names of the geoms; those without one are numbered.

    Args:
        m: mujoco.MjModel.
    """
    given = [m.names[adr : m.names.index(b"\0", adr)].decode() for adr in m.name_geomadr]
    taken = set(given)
    return [
        name or next(n for n in (f"geom_{i}", f"geom_{i}_") if n not in taken) for i, name in enumerate(given)
    ]


def read_shapes(tree: Tree, left_out: Collection[int], *, visual: bool) -> GeometryModel:
    """The geoms that are drawn, or those that can collide.

    Args:
        tree: the compiled model, meshes included, and its tree.
        left_out: geoms whose shape was not found.
        visual: those that MuJoCo's viewer shows; otherwise those that can collide, with their pairs.
    """
    m, result = tree.compiled, pin.GeometryModel()
    paired = {int(g) for g in (*m.pair_geom1, *m.pair_geom2)}
    indices: dict[int, int] = {}
    for g, name in enumerate(geom_names(m)):
        color = np.array(m.mat_rgba[m.geom_matid[g]] if m.geom_matid[g] >= 0 else m.geom_rgba[g], dtype=float)
        solid = bool(m.geom_contype[g] or m.geom_conaffinity[g]) or g in paired
        shown = m.geom_group[g] < SHOWN_GROUPS and color[3] > 0.0
        shape = None if g in left_out or not (shown if visual else solid) else _shape(m, g, solid=not visual)
        if shape is None:
            continue
        body = int(m.geom_bodyid[g])
        joint, place = tree.on_body(body, placement(m.geom_pos[g], m.geom_quat[g]))
        frame = tree.model.getFrameId(tree.body_names[body], pin.FrameType.BODY) if body else 0
        item = pin.GeometryObject(name, joint, frame, place, shape)
        item.meshColor = color
        indices[g] = result.addGeometryObject(item)
    if not visual:
        for one, two in _pairs(m, list(indices)):
            result.addCollisionPair(pin.CollisionPair(indices[one], indices[two]))
    return result


def _shape(m: Any, g: int, *, solid: bool) -> Any:
    """A coal geometry, None for what has none (signed distance functions of plugins)."""
    import coal

    kind, (a, b, c) = int(m.geom_type[g]), m.geom_size[g]
    if kind == PLANE:
        return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
    if kind == SPHERE:
        return coal.Sphere(a)
    if kind == CAPSULE:
        return coal.Capsule(a, 2.0 * b)
    if kind == ELLIPSOID:
        return coal.Ellipsoid(np.array([a, b, c]))
    if kind == CYLINDER:
        return coal.Cylinder(a, 2.0 * b)
    if kind == BOX:
        return coal.Box(2.0 * a, 2.0 * b, 2.0 * c)
    data = int(m.geom_dataid[g])
    if kind == MESH:
        start, first = int(m.mesh_vertadr[data]), int(m.mesh_faceadr[data])
        vertices = m.mesh_vert[start : start + m.mesh_vertnum[data]]
        return _triangles(vertices, m.mesh_face[first : first + m.mesh_facenum[data]], solid=solid)
    return _height_field(m, data, solid=solid) if kind == HFIELD else None


def _triangles(vertices: Any, faces: Any, *, solid: bool) -> Any:
    """A mesh; the tree of its bounding boxes, which takes longest, only where it may collide."""
    import coal

    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(len(faces), len(vertices))
    mesh.addVertices(np.array(vertices, dtype=float))
    mesh.addTriangles(np.array(faces, dtype=np.uint64))
    if solid:
        mesh.endModel()
    return mesh


def _height_field(m: Any, data: int, *, solid: bool) -> Any:
    """A height field as the triangles of its surface."""
    rows, columns = int(m.hfield_nrow[data]), int(m.hfield_ncol[data])
    start, (x, y, height, _) = int(m.hfield_adr[data]), m.hfield_size[data]
    z = height * np.array(m.hfield_data[start : start + rows * columns], dtype=float)
    across, along = np.meshgrid(np.linspace(-x, x, columns), np.linspace(-y, y, rows))
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    lower = np.column_stack([corner, corner + 1, corner + columns])
    upper = np.column_stack([corner + 1, corner + columns + 1, corner + columns])
    return _triangles(
        np.column_stack([across.ravel(), along.ravel(), z]), np.vstack([lower, upper]), solid=solid
    )


def _pairs(m: Any, geoms: list[int]) -> list[tuple[int, int]]:
    """Pairs of geoms that MuJoCo lets collide: by their masks, not of one body or a body and its parent."""
    named = {frozenset(pair) for pair in zip(m.pair_geom1.tolist(), m.pair_geom2.tolist(), strict=True)}
    barred = set(m.exclude_signature.tolist())
    result = []
    for k, one in enumerate(geoms):
        for two in geoms[k + 1 :]:
            masks = (
                m.geom_contype[one] & m.geom_conaffinity[two] or m.geom_contype[two] & m.geom_conaffinity[one]
            )
            b1, b2 = sorted((int(m.geom_bodyid[one]), int(m.geom_bodyid[two])))
            w1, w2 = int(m.body_weldid[b1]), int(m.body_weldid[b2])
            p1, p2 = (int(m.body_weldid[m.body_parentid[w]]) for w in (w1, w2))
            kin = w1 == w2 or (w1 and w2 and (p1 == w2 or p2 == w1))
            free = masks and not kin and (b1 << 16) + b2 not in barred
            if free or frozenset((one, two)) in named:
                result.append((one, two))
    return result
