"""Convex hulls: corners, faces and edges of points, and checks of meshes for convexity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.errors import InputError
from pin_nonideal.types import Array

# Largest sine of the angle between two triangles of one face; normals have fewer digits than corners.
ONE_FACE = 1e-9
# Largest depth of a mesh surface inside its hull, relative to the size of the mesh: files have single
# precision.
SINGLE_PRECISION = 1e-6
# Distance of equal corners, relative to the size of the hull.
ONE_CORNER = 1e-12
# Number of mesh points that are compared with all faces of the hull at once, to bound memory.
AT_ONCE = 1000


@dataclass(frozen=True)
class ConvexHull:
    """A convex solid with flat faces.

    Attributes:
        points: corners, (n, 3).
        planes: outward normal and offset of each face, n . x = offset, (f, 4).
        edges: indices of the two corners and the two faces of each edge, (e, 4).
    """

    points: Array
    planes: Array
    edges: NDArray[np.int64]


def convex_hull(points: Array, what: str) -> ConvexHull:
    """Compute the convex hull of points; coplanar triangles are merged into one face.

    Args:
        points: points, (n, 3).
        what: name of the argument in messages.

    Raises:
        InputError: the points span no solid.
    """
    from scipy.spatial import ConvexHull as Qhull  # imported on first use, since the import is slow
    from scipy.spatial import QhullError

    try:
        hull = Qhull(points)
    except (QhullError, ValueError) as error:
        raise InputError(
            f"{what} must span a solid, at least four points out of one plane; got {len(points)}"
        ) from error
    face = _faces(hull.equations[:, :3], hull.neighbors)
    edges = [
        (*(corner for j, corner in enumerate(hull.simplices[i]) if j != k), face[i], face[other])
        for i, beside in enumerate(hull.neighbors)
        for k, other in enumerate(beside)
        if i < other and face[i] != face[other]
    ]
    meetings = np.array(edges, dtype=np.int64)
    corners, numbers = np.unique(meetings[:, :2], return_inverse=True)
    meetings[:, :2] = numbers.reshape(-1, 2)
    planes = np.empty((face.max() + 1, 4))
    planes[face, :3] = hull.equations[:, :3]
    planes[face, 3] = -hull.equations[:, 3]
    return ConvexHull(np.asarray(points[corners]), planes, meetings)


def _faces(normals: Array, neighbors: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the face index of each triangle, from 0."""
    face = np.full(len(normals), -1)
    count = 0
    for first in range(len(normals)):
        if face[first] >= 0:
            continue
        face[first], left = count, [first]
        while left:
            for other in neighbors[left.pop()]:
                if face[other] < 0 and np.linalg.norm(normals[other] - normals[first]) < ONE_FACE:
                    face[other] = count
                    left.append(other)
        count += 1
    return face


def shrunk(points: Array, by: float, what: str) -> Array:
    """Compute the corners of the hull of points with its faces moved inward.

    Args:
        points: points, (n, 3).
        by: inward displacement of the faces [m].
        what: name of the argument in messages.

    Raises:
        InputError: the hull is too thin.
    """
    from scipy.spatial import HalfspaceIntersection

    planes = convex_hull(points, what).planes
    middle = points.mean(axis=0)
    room = planes[:, 3] - planes[:, :3] @ middle
    if not by < room.min():
        raise InputError(
            f"{what} is too thin to round its edges by {by:g} m; give a rounding below {room.min():.3g} m"
        )
    halves = np.column_stack([planes[:, :3], by - planes[:, 3]])
    corners = HalfspaceIntersection(halves, middle).intersections
    grid = ONE_CORNER * float(np.ptp(points, axis=0).max())
    _, first_of_each = np.unique(np.round((corners - middle) / grid), axis=0, return_index=True)
    return np.asarray(corners[np.sort(first_of_each)])


def check_convex(points: Array, triangles: NDArray[np.int64], what: str) -> None:
    """Check that a mesh is the surface of its convex hull.

    Args:
        points: points, (n, 3).
        triangles: indices of the corners of each triangle, (m, 3).
        what: name of the argument in messages.

    Raises:
        InputError: a part of the surface lies inside the hull, or is missing.
    """
    from scipy.spatial import ConvexHull as Qhull

    planes = convex_hull(points, what).planes
    places = np.vstack([points[np.unique(triangles)], points[triangles].mean(axis=1)])
    size = float(np.ptp(points, axis=0).max())
    inside = max(
        float(-(part @ planes[:, :3].T - planes[:, 3]).max(axis=1).min())
        for part in np.array_split(places, len(places) // AT_ONCE + 1)
    )
    if inside > SINGLE_PRECISION * size:
        raise InputError(
            f"{what} is a mesh that must be convex; its surface lies {inside:.3g} m inside its convex hull: "
            "split it into convex parts, or make a convex mesh of it"
        )
    a, b, c = points[triangles].transpose(1, 0, 2)
    area = 0.5 * float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum())
    whole = float(Qhull(points).area)
    if area < (1.0 - SINGLE_PRECISION) * whole:
        raise InputError(
            f"{what} is a mesh that must be closed; {1.0 - area / whole:.2g} of its convex hull's surface is "
            "missing: fill its holes, or make a convex mesh of it"
        )
