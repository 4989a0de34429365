"""Forces of a scene at rest, and the motions that its constraints allow."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pin_nonideal.core import core
from pin_nonideal.scene import Scene, program_of
from pin_nonideal.states.rows import holonomic_rows, rows_at
from pin_nonideal.types import Array

# Rows whose singular value is below this part of the largest depend on the others.
DEPENDENT = 1e-9


class Balance(NamedTuple):
    """What acts on a scene at rest.

    Attributes:
        F: given forces and laws at rest, without dry friction [N or N m], (nv,).
        A: rows of all constraints and contacts, (m, nv).
        lam: multipliers that leave the least of F + A^T lam, those of least norm, (m,).
        free: velocities that the rows allow, orthonormal columns, (nv, k).
        left: free^T F, which is zero in equilibrium, (k,).
    """

    F: Array
    A: Array
    lam: Array
    free: Array
    left: Array


class AtRest:
    """A scene at rest: its forces at any configuration, without dry friction.

    Args:
        scene: the scene.
        tau: torques in place of the scene's actuation, (nv,), or None.
        t: time [s].
    """

    def __init__(self, scene: Scene, tau: Array | None, t: float) -> None:
        self.scene, self.tau, self.t = scene, tau, t
        self.program = program_of(scene)
        self.runner = self.program.runner()
        self.still = np.zeros(scene.model.nv)
        self._smooth = [core.Mode.unloaded] * len(scene.element_names)

    def forces(self, q: Array) -> Array:
        """Given forces and laws at rest, without dry friction, (nv,).

        Args:
            q: configuration, (nq,).
        """
        now = self.runner.solve(q, self.still, self.t, self.tau, self._smooth)
        return np.asarray(now.F + now.C)

    def undriven(self, q: Array) -> Array:
        """Those forces without the scene's actuation or the torques in its place, (nv,).

        Args:
            q: configuration, (nq,).
        """
        now = self.runner.solve(q, self.still, self.t, self.still, self._smooth)
        return np.asarray(now.F + now.C)

    def rows(self, q: Array) -> Array:
        """Rows of all constraints and contacts, (m, nv).

        Args:
            q: configuration, (nq,).
        """
        return rows_at(self.runner, q, self.still, self.t)[0]

    def balance(self, q: Array) -> Balance:
        """What acts at one configuration.

        Args:
            q: configuration, (nq,).
        """
        F, A = self.forces(q), self.rows(q)
        free = null_space(A)
        lam = np.linalg.lstsq(A.T, -F, rcond=DEPENDENT)[0] if len(A) else np.zeros(0)
        return Balance(F, A, lam, free, free.T @ F)

    def mass(self, q: Array) -> Array:
        """M(q), (nv, nv).

        Args:
            q: configuration, (nq,).
        """
        n = len(self.still)
        return np.asarray(self.runner.terms(q, self.still)[0].reshape(n, n))


def null_space(A: Array) -> Array:
    """Orthonormal columns that span what all rows allow, (nv, k); rows count by their direction alone.

    Args:
        A: rows, (m, nv).
    """
    size = np.linalg.norm(A, axis=1)
    rows = A[size > 0.0] / size[size > 0.0, None]
    if not len(rows):
        return np.eye(A.shape[1])
    _, values, turned = np.linalg.svd(rows)
    rank = int((values > DEPENDENT * values[0]).sum())
    return np.asarray(turned[rank:].T)


def restricts_velocity_only(scene: Scene) -> bool:
    """Whether some row restricts the velocity and not the position, as that of a knife edge does.

    Args:
        scene: the scene.
    """
    return not bool(holonomic_rows(program_of(scene)).all())
