"""Forces of a scene at rest, and the motions that its constraints allow."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.core_loader import core
from pin_nonideal.scene.scene import Scene, compiled_scene
from pin_nonideal.states.rows import DEPENDENT, gap_rows, holonomic_rows, row_lengths, rows_at, shortest
from pin_nonideal.states.scales import slides
from pin_nonideal.types import Array


class Balance(NamedTuple):
    """What acts on a scene at rest.

    Attributes:
        F: given forces and laws at rest, without dry friction [N or N m], (nv,).
        A: rows of all constraints and contacts, zero where these are open, (m, nv).
        lam: multipliers that leave the least of F + A^T lam in the metric of M^-1, those of least norm, (m,).
        free: velocities that the rows allow, orthonormal columns, (nv, k).
        left: free^T F, which is zero in equilibrium, (k,).
    """

    F: Array
    A: Array
    lam: Array
    free: Array
    left: Array


# A contact touches if its gap is below this part of the scene's length, and of one meter, as at starts of
# runs.
TOUCHING = 1e-10


class AtRest:
    """A scene at rest: its forces at any configuration, without dry friction.

    Functions of time stand still: constraints that they move hold the places of that time.

    Args:
        scene: the scene.
        tau: torques in place of the scene's actuation, (nv,), or None.
        t: time [s].
        q: configuration that tells which contacts are open, (nq,).

    Attributes:
        gaps: rows of contacts that may open, (m,).
        touching: gap up to which they touch [m].
        open: those of open contacts, which give no force, (m,).
    """

    def __init__(self, scene: Scene, tau: Array | None, t: float, q: Array) -> None:
        self.scene, self.tau, self.t = scene, tau, t
        self.program = compiled_scene(scene).program
        self.runner = self.program.runner()
        self.still = np.zeros(scene.model.nv)
        self._slides = slides(scene.model)
        self._smooth = [core.Mode.unloaded] * len(scene.element_names)
        self.gaps = gap_rows(self.program)
        self.touching = TOUCHING * max(1.0, compiled_scene(scene).projection.length)
        self.begin(q)

    def begin(self, q: Array) -> None:
        """Holds the contacts that touch at a configuration, and no others.

        Args:
            q: configuration, (nq,).
        """
        self.open = self.gaps
        self.touch(q)

    def touch(self, q: Array) -> bool:
        """Holds the contacts that touch at a configuration too; returns whether there are more than before.

        Args:
            q: configuration, (nq,).
        """
        if not self.open.any():
            return False
        before = self.open
        self.open = before & (rows_at(self.runner, q, self.still, self.t)[2] > self.touching)
        return bool((before != self.open).any())

    def release(self, rows: NDArray[np.bool_]) -> None:
        """Opens contacts.

        Args:
            rows: their rows, (m,).
        """
        self.open = self.open | (self.gaps & rows)

    def gaps_at(self, q: Array) -> Array:
        """Gaps of the open contacts [m], (k,).

        Args:
            q: configuration, (nq,).
        """
        return rows_at(self.runner, q, self.still, self.t)[2][self.open]

    def forces(self, q: Array) -> Array:
        """Given forces and laws at rest, without dry friction, (nv,).

        Args:
            q: configuration, (nq,).
        """
        now = self.runner.solve(q, self.still, self.t, self.tau, self._smooth, frozen=True)
        return np.asarray(now.F + now.C)

    def undriven(self, q: Array) -> Array:
        """Those forces without the scene's actuation or the torques in its place, (nv,).

        Args:
            q: configuration, (nq,).
        """
        now = self.runner.solve(q, self.still, self.t, self.still, self._smooth, frozen=True)
        return np.asarray(now.F + now.C)

    def rows(self, q: Array) -> Array:
        """Rows of all constraints and closed contacts, (m, nv); a row that rounding alone makes is zero.

        Args:
            q: configuration, (nq,).
        """
        return self.scaled_rows(q, self.root(q))[0]

    def directions(self, q: Array) -> tuple[Array, Array, Array]:
        """Slip directions of frictional elements; a direction that rounding alone makes is zero.

        Args:
            q: configuration, (nq,).

        Returns:
            The directions, (d, nv), their greatest lengths, (d,), and the directions in the metric of M^-1,
            (d, nv).
        """
        D = self.runner.slip_rows(q, self.still, self.t).reshape(-1, len(self.still))
        lengths = row_lengths(self.runner, q, self.still, self.t)[self.program.rows :]
        scaled = np.linalg.solve(self.root(q), D.T).T
        short = (np.linalg.norm(scaled, axis=1) <= DEPENDENT * lengths)[:, None]
        return np.where(short, 0.0, D), lengths, np.where(short, 0.0, scaled)

    def root(self, q: Array) -> Array:
        """Lower triangular, M = root root^T, (nv, nv).

        Args:
            q: configuration, (nq,).
        """
        return np.asarray(np.linalg.cholesky(self.mass(q)))

    def scaled_rows(self, q: Array, root: Array) -> tuple[Array, Array, Array]:
        """Rows A, their greatest lengths, and the rows over these in the metric of M^-1, M = root root^T.

        Args:
            q: configuration, (nq,).
            root: see above, (nv, nv).

        Returns:
            A (m, nv), lengths (m,), and scaled rows (m, nv).
        """
        A = rows_at(self.runner, q, self.still, self.t)[0]
        lengths = row_lengths(self.runner, q, self.still, self.t)[: len(A)]
        scaled = np.linalg.solve(root, A.T).T / np.where(lengths > 0.0, lengths, 1.0)[:, None]
        short = self.open | (np.linalg.norm(scaled, axis=1) <= DEPENDENT)
        return np.where(short[:, None], 0.0, A), lengths, np.where(short[:, None], 0.0, scaled)

    def balance(self, q: Array) -> Balance:
        """What acts at one configuration.

        Args:
            q: configuration, (nq,).
        """
        F, root = self.forces(q), self.root(q)
        A, lengths, scaled = self.scaled_rows(q, root)
        lam = shortest(scaled.T, np.asarray(np.linalg.solve(root, -F)), lengths)
        free = _free(scaled, root)
        return Balance(F, A, lam, free, free.T @ F)

    def free(self, q: Array) -> Array:
        """Velocities that the rows allow, orthonormal columns, (nv, k).

        Args:
            q: configuration, (nq,).
        """
        root = self.root(q)
        return _free(self.scaled_rows(q, root)[2], root)

    def mass(self, q: Array) -> Array:
        """M(q), (nv, nv).

        Args:
            q: configuration, (nq,).
        """
        n = len(self.still)
        return np.asarray(self.runner.terms(q, self.still)[0].reshape(n, n))

    def units(self, M: Array, free: Array, dofs: Collection[int] | None = None) -> Array:
        """Moves of coordinates that compare with a radian: 1, and of slides a length, (k,).

        The length is the root mean radius of gyration by the motions that the constraints allow, so that
        neither the unit of length nor the mount changes it; 1 where nothing turns or nothing slides.

        Args:
            M: mass matrix, (nv, nv).
            free: those motions, (nv, r).
            dofs: the coordinates, k of them; all when None.
        """
        own = list(range(len(M)) if dofs is None else dofs)
        along = self._slides[own]
        if not along.any() or along.all():
            return np.ones(len(own))
        light = np.einsum("ij,ji->i", free, np.linalg.solve(free.T @ M @ free, free.T))[own]
        slide, turn = light[along].mean(), light[~along].mean()
        return np.where(along, np.sqrt(slide / turn) if min(slide, turn) > 0.0 else 1.0, 1.0)


def _free(scaled: Array, root: Array) -> Array:
    """Orthonormal columns that span the velocities that scaled rows allow, M = root root^T."""
    if not len(scaled):
        return np.eye(len(root))
    _, values, turned = np.linalg.svd(scaled)
    rank = int((values > DEPENDENT).sum())
    return np.asarray(np.linalg.qr(np.linalg.solve(root.T, turned[rank:].T))[0])


def weight(scene: Scene) -> float:
    """Length of the weight of all bodies in the metric of M^-1, if each could move freely [sqrt(kg) m/s^2].

    Args:
        scene: the scene.
    """
    mass = sum(body.mass for body in scene.model.inertias)
    return float(np.sqrt(mass) * np.linalg.norm(scene.model.gravity.linear))


def restricts_velocity_only(scene: Scene) -> bool:
    """Whether some row restricts the velocity and not the position, as that of a knife edge does.

    Args:
        scene: the scene.
    """
    return not bool(holonomic_rows(compiled_scene(scene).program).all())
