"""Forces of a scene at rest, and the motions that its constraints admit."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.core_loader import core
from pin_nonideal.states.rows import (
    MIN_SINGULAR_VALUE,
    gap_rows,
    minimum_norm,
    residuals_at,
    row_lengths,
    rows_at,
)
from pin_nonideal.states.scales import slides
from pin_nonideal.types import Array, Model


class Balance(NamedTuple):
    """Forces on a scene at rest.

    Attributes:
        F: applied forces and laws at rest, without dry friction [N or N m], (nv,).
        A: rows of all constraints and contacts, zero for open contacts, (m, nv).
        lam: multipliers of least norm that minimize |F + A^T lam| in the metric of M^-1, (m,).
        free: orthonormal basis of the velocities that the rows admit, (nv, k).
        left: free^T F, which is zero in equilibrium, (k,).
    """

    F: Array
    A: Array
    lam: Array
    free: Array
    left: Array


# A contact touches if its gap is below this fraction of the scene's length, or of 1 m if the scene is
# shorter, as at starts of runs.
TOUCHING_GAP = 1e-10
# A coordinate cannot move if its mobility is below this fraction of its mobility without constraints.
# Mobilities are squares of rates: rounding leaves 1e-32, and linkages of usual proportions 1e-10.
MIN_MOBILITY = 1e-20


class AtRest:
    """Forces of a scene at rest at any configuration, without dry friction.

    Functions of time are frozen: driven constraints keep their value at time t.

    Args:
        compiled: the compiled scene.
        tau: torques that replace the scene's actuation, (nv,), or None.
        t: time [s].
        q: configuration that defines the open contacts, (nq,).

    Attributes:
        gaps: mask of rows of unilateral contacts, (m,).
        touching: gap up to which a contact touches [m].
        open: mask of rows of open contacts, which exert no force, (m,).
        only_slides: whether all coordinates are lengths.
    """

    def __init__(self, compiled: CompiledScene, tau: Array | None, t: float, q: Array) -> None:
        self.compiled, self.tau, self.t = compiled, tau, t
        self.program = compiled.program
        self.runner = self.program.runner()
        self.still = np.zeros(compiled.model.nv)
        self._slides = slides(compiled.model)
        self.only_slides = bool(self._slides.all())
        self._smooth = [core.Mode.unloaded] * len(self.program.element_sizes)
        self.gaps = gap_rows(self.program)
        self.touching = TOUCHING_GAP * max(1.0, compiled.projection.length)
        self.begin(q)

    def begin(self, q: Array) -> None:
        """Close the contacts that touch at a configuration, and open all others.

        Args:
            q: configuration, (nq,).
        """
        self.open = self.gaps
        self.touch(q)

    def touch(self, q: Array) -> bool:
        """Close the contacts that touch at a configuration; return whether any contact was closed.

        Args:
            q: configuration, (nq,).
        """
        if not self.open.any():
            return False
        before = self.open
        self.open = before & (residuals_at(self.runner, q, self.still, self.t) > self.touching)
        return bool((before != self.open).any())

    def release(self, rows: NDArray[np.bool_]) -> None:
        """Open contacts.

        Args:
            rows: mask of their rows, (m,).
        """
        self.open = self.open | (self.gaps & rows)

    def gaps_at(self, q: Array) -> Array:
        """Return the gaps of the open contacts [m], (k,).

        Args:
            q: configuration, (nq,).
        """
        return residuals_at(self.runner, q, self.still, self.t)[self.open]

    def forces(self, q: Array) -> Array:
        """Compute applied forces and laws at rest, without dry friction, (nv,).

        Args:
            q: configuration, (nq,).
        """
        now = self.runner.solve(q, self.still, self.t, self.tau, self._smooth, frozen=True)
        return np.asarray(now.F + now.C)

    def undriven(self, q: Array) -> Array:
        """Compute applied forces and laws at rest, without actuation and torques, (nv,).

        Args:
            q: configuration, (nq,).
        """
        now = self.runner.solve(q, self.still, self.t, self.still, self._smooth, frozen=True)
        return np.asarray(now.F + now.C)

    def rows(self, q: Array) -> Array:
        """Return the rows of all constraints and closed contacts, (m, nv); rows of rounding errors are zero.

        Args:
            q: configuration, (nq,).
        """
        return self.scaled_rows(q, self.root(q))[0]

    def directions(self, q: Array) -> tuple[Array, Array, Array]:
        """Return the slip directions of friction elements; directions of rounding errors are zero.

        Args:
            q: configuration, (nq,).

        Returns:
            The directions, (d, nv), their greatest lengths, (d,), and the directions in the metric of M^-1,
            (d, nv).
        """
        D = self.runner.slip_rows(q, self.still, self.t).reshape(-1, len(self.still))
        lengths = row_lengths(self.runner, q, self.still, self.t)[self.program.rows :]
        scaled = np.linalg.solve(self.root(q), D.T).T
        short = (np.linalg.norm(scaled, axis=1) <= MIN_SINGULAR_VALUE * lengths)[:, None]
        return np.where(short, 0.0, D), lengths, np.where(short, 0.0, scaled)

    def root(self, q: Array) -> Array:
        """Return the lower Cholesky factor of M = root root^T, (nv, nv).

        Args:
            q: configuration, (nq,).
        """
        return np.asarray(np.linalg.cholesky(self.mass(q)))

    def scaled_rows(self, q: Array, root: Array) -> tuple[Array, Array, Array]:
        """Return rows A, their greatest lengths, and the rows over these lengths in the metric of M^-1.

        Args:
            q: configuration, (nq,).
            root: Cholesky factor of M = root root^T, (nv, nv).

        Returns:
            A (m, nv), lengths (m,), and scaled rows (m, nv).
        """
        A = rows_at(self.runner, q, self.still, self.t)[0]
        lengths = row_lengths(self.runner, q, self.still, self.t)[: len(A)]
        scaled = np.linalg.solve(root, A.T).T / np.where(lengths > 0.0, lengths, 1.0)[:, None]
        short = self.open | (np.linalg.norm(scaled, axis=1) <= MIN_SINGULAR_VALUE)
        return np.where(short[:, None], 0.0, A), lengths, np.where(short[:, None], 0.0, scaled)

    def balance(self, q: Array) -> Balance:
        """Return the forces at one configuration.

        Args:
            q: configuration, (nq,).
        """
        F, root = self.forces(q), self.root(q)
        A, lengths, scaled = self.scaled_rows(q, root)
        lam = minimum_norm(scaled.T, np.asarray(np.linalg.solve(root, -F)), lengths)
        free = _free_basis(scaled, root)
        return Balance(F, A, lam, free, free.T @ F)

    def free(self, q: Array) -> Array:
        """Return an orthonormal basis of the velocities that the rows admit, (nv, k).

        Args:
            q: configuration, (nq,).
        """
        root = self.root(q)
        return _free_basis(self.scaled_rows(q, root)[2], root)

    def mass(self, q: Array) -> Array:
        """Return the mass matrix M(q), (nv, nv).

        Args:
            q: configuration, (nq,).
        """
        n = len(self.still)
        return np.asarray(self.runner.terms(q, self.still)[0].reshape(n, n))

    def units(self, M: Array, free: Array, dofs: Collection[int] | None = None) -> Array:
        """Return unit displacements of coordinates: 1 rad for angles, and a length for slides, (k,).

        The length is the root mean square radius of gyration along the motions that the constraints admit,
        over the coordinates that can move. This length is independent of the unit of length and of the mount.
        The length is 1 if all these coordinates are angles or all are slides.

        Args:
            M: mass matrix, (nv, nv).
            free: basis of the motions that the constraints admit, (nv, r).
            dofs: the k coordinates; all when None.
        """
        own = list(range(len(M)) if dofs is None else dofs)
        along = self._slides[own]
        if not along.any() or along.all():
            return np.ones(len(own))
        light = np.einsum("ij,ji->i", free, np.linalg.solve(free.T @ M @ free, free.T))[own]
        movable = light > MIN_MOBILITY * np.diag(np.linalg.inv(M))[own]
        slides_light, turns_light = light[along & movable], light[~along & movable]
        if not len(slides_light) or not len(turns_light):
            return np.ones(len(own))
        return np.where(along, np.sqrt(slides_light.mean() / turns_light.mean()), 1.0)


def _free_basis(scaled: Array, root: Array) -> Array:
    """Return an orthonormal basis of the velocities that scaled rows admit, M = root root^T."""
    if not len(scaled):
        return np.eye(len(root))
    _, values, turned = np.linalg.svd(scaled)
    rank = int((values > MIN_SINGULAR_VALUE).sum())
    return np.asarray(np.linalg.qr(np.linalg.solve(root.T, turned[rank:].T))[0])


def weight(model: Model) -> float:
    """Compute the norm of the weight of free bodies in the metric of M^-1 [sqrt(kg) m/s^2].

    Args:
        model: pinocchio.Model.
    """
    mass = sum(body.mass for body in model.inertias)
    return float(np.sqrt(mass) * np.linalg.norm(model.gravity.linear))
