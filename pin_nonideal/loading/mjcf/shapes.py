"""Geoms of a compiled MJCF model as visual and collision shapes."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
import pinocchio as pin

from pin_nonideal.types import Array, CollisionGeometry, GeometryModel

from .mujoco_types import MjModel, Mujoco
from .tree import Tree, placement

PLANE, HFIELD, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX, MESH, SDF = range(9)  # MuJoCo's mjtGeom
SHOWN_GROUPS = 3  # MuJoCo's viewer shows the groups 0, 1 and 2


def geom_names(m: MjModel) -> list[str]:
    """Return the names of the geoms; geoms without a name are numbered.

    Args:
        m: mujoco.MjModel.
    """
    file_names = [m.names[adr : m.names.index(b"\0", adr)].decode() for adr in m.name_geomadr]
    used_names = set(file_names)
    return [
        name or next(n for n in (f"geom_{i}", f"geom_{i}_") if n not in used_names)
        for i, name in enumerate(file_names)
    ]


def read_shapes(mujoco: Mujoco, tree: Tree, left_out: Collection[int], *, visual: bool) -> GeometryModel:
    """Return the visual geoms, or the collision geoms.

    Args:
        mujoco: Python package.
        tree: compiled model with meshes, and its tree.
        left_out: geoms whose shape is missing.
        visual: whether to return the geoms of MuJoCo's viewer, or the collision geoms with their pairs.
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
        for one, two in colliding_pairs(mujoco, m, list(indices)):
            result.addCollisionPair(pin.CollisionPair(indices[one], indices[two]))
    return result


def _shape(m: MjModel, g: int, *, solid: bool) -> CollisionGeometry:
    """Return a coal geometry, or None for signed distance functions of plugins."""
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


def _triangles(vertices: Array, faces: Array, *, solid: bool) -> CollisionGeometry:
    """Return a mesh; the bounding volume hierarchy, which takes most time, is built for collisions only."""
    import coal

    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(len(faces), len(vertices))
    mesh.addVertices(np.array(vertices, dtype=float))
    mesh.addTriangles(np.array(faces, dtype=np.uint64))
    if solid:
        mesh.endModel()
    return mesh


def _height_field(m: MjModel, data: int, *, solid: bool) -> CollisionGeometry:
    """Return a height field as the triangles of its surface, with MuJoCo's diagonals."""
    rows, columns = int(m.hfield_nrow[data]), int(m.hfield_ncol[data])
    start, (x, y, height, _) = int(m.hfield_adr[data]), m.hfield_size[data]
    z = height * np.array(m.hfield_data[start : start + rows * columns], dtype=float)
    across, along = np.meshgrid(np.linspace(-x, x, columns), np.linspace(-y, y, rows))
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    lower = np.column_stack([corner, corner + 1, corner + columns + 1])
    upper = np.column_stack([corner, corner + columns + 1, corner + columns])
    return _triangles(
        np.column_stack([across.ravel(), along.ravel(), z]), np.vstack([lower, upper]), solid=solid
    )


def colliding_pairs(mujoco: Mujoco, m: MjModel, geoms: Sequence[int]) -> list[tuple[int, int]]:
    """Return the pairs of geoms that can collide in MuJoCo by masks, bodies and exclusions.

    Args:
        mujoco: Python package.
        m: mujoco.MjModel.
        geoms: indices of the candidate geoms.
    """
    g = np.array(geoms, dtype=int)
    named = {frozenset(pair) for pair in zip(m.pair_geom1.tolist(), m.pair_geom2.tolist(), strict=True)}
    types, affinities, body = m.geom_contype[g], m.geom_conaffinity[g], m.geom_bodyid[g].astype(int)
    weld = m.body_weldid[body]
    parent = m.body_weldid[m.body_parentid[weld]]
    masks = (types[:, None] & affinities[None, :]) | (affinities[:, None] & types[None, :])
    kin = weld[:, None] == weld[None, :]
    if not m.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT:
        child = (parent[:, None] == weld[None, :]) & (weld[None, :] != 0)
        kin |= child | child.T
    signature = (np.minimum(body[:, None], body[None, :]) << 16) + np.maximum(body[:, None], body[None, :])
    free = (masks != 0) & ~kin & ~np.isin(signature, m.exclude_signature)
    index = {int(one): k for k, one in enumerate(g)}
    for one, two in map(tuple, named):
        if one in index and two in index:
            free[index[one], index[two]] = free[index[two], index[one]] = True
    return [(int(g[i]), int(g[k])) for i, k in np.argwhere(np.triu(free, 1))]
