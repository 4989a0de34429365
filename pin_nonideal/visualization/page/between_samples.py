"""States between the samples of a run: cubics through q and v, and their closed loops."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from pin_nonideal.core_loader import core
from pin_nonideal.errors import PinNonidealError
from pin_nonideal.scene.scene import compiled_scene
from pin_nonideal.types import Array

if TYPE_CHECKING:
    from pin_nonideal.trajectory.trajectory import Trajectory

# Residual of closed loops, relative to the size of the mechanism or to 1 rad: far below a pixel.
CLOSURE_TOL = 1e-6


class Cubics:
    """The cubics between the samples of a run.

    The cubic with the q and v of both samples at its ends runs in the tangent space at sample k, where the
    rate at k + 1 is d difference/d q_1 times v.

    Args:
        run: the run.
    """

    def __init__(self, run: Trajectory) -> None:
        self.run, self.model = run, run.scene.model
        self.t = np.asarray(run.t, dtype=np.float64)
        joints = list(self.model.joints)[1:]
        # Degree of freedom and first entry in q of joints that turn without end.
        self._turns = np.array([(j.idx_v, j.idx_q) for j in joints if (j.nq, j.nv) == (2, 1)], dtype=int)
        self._turns = self._turns.reshape(-1, 2)
        self._lines = np.array([(j.idx_v, j.idx_q) for j in joints if (j.nq, j.nv) == (1, 1)], dtype=int)
        self._lines = self._lines.reshape(-1, 2)
        self._flat = len(self._turns) + len(self._lines) == len(joints) == self.model.nv
        # Steps of the intervals, and rates at their ends, each computed once.
        self._known = np.zeros(len(self.t), dtype=bool)
        self._differences = np.zeros((2, 0 if self._flat else len(self.t), self.model.nv))

    def configurations(self, k: NDArray[np.int64], s: Array) -> Array:
        """Configurations on the cubics, (n, nq).

        Args:
            k: samples, (n,).
            s: parts of the way to the next sample, 0 to 1, (n,).
        """
        xi, _ = self._at(k, s)
        q = self.run.q[k]
        if not self._flat:
            each = [pin.integrate(self.model, *pair) for pair in zip(q, xi, strict=True)]
            return np.array(each).reshape(-1, self.model.nq)
        result = np.array(q)
        dof, first = self._lines.T
        result[:, first] += xi[:, dof]
        dof, first = self._turns.T
        cos, sin = np.cos(xi[:, dof]), np.sin(xi[:, dof])
        result[:, first] = q[:, first] * cos - q[:, first + 1] * sin
        result[:, first + 1] = q[:, first] * sin + q[:, first + 1] * cos
        return result

    def velocities(self, k: NDArray[np.int64], s: Array) -> Array:
        """Velocities on the cubics, (n, nv); arguments as for `configurations`."""
        xi, rate = self._at(k, s)
        if self._flat:
            return rate
        every = zip(self.run.q[k], xi, rate, strict=True)
        argument = pin.ArgumentPosition.ARG1
        each = [pin.dIntegrate(self.model, q, x, argument) @ own for q, x, own in every]
        return np.array(each).reshape(-1, self.model.nv)

    def closed(self, k: NDArray[np.int64], s: Array, size: float, unseen: float) -> tuple[Array, Array]:
        """Compute configurations on the cubics with closed loops, and the displacements that close the loops.

        Newton's method of the core closes the loops in a microsecond per frame.

        Args:
            k: samples, (n,).
            s: parts of the way to the next sample, 0 to 1, (n,).
            size: size of the mechanism [m].
            unseen: residual that is too small to be seen [m or rad].

        Returns:
            The configurations, (n, nq), and the largest displacement of a coordinate that closes the loops
            [m or rad], (n,).  If the loops cannot be closed, the configuration stays on the cubic, and the
            displacement is zero if its residual is too small to be seen, else NaN.
        """
        q = self.configurations(k, s)
        if not self.run.scene.constraint_slices or not len(q):
            return q, np.zeros(len(q))
        program = compiled_scene(self.run.scene).program
        if program.first_gap == 0:  # contacts that may open are not loops
            return q, np.zeros(len(q))
        part = s[:, None]
        v = (1.0 - part) * self.run.v[k] + part * self.run.v[k + 1]
        t = self.t[k] + s * (self.t[k + 1] - self.t[k])
        on, after = _closest(program, q, v, t, np.inf)
        moved, tolerance = np.abs(on - q).max(axis=1, initial=0.0), CLOSURE_TOL * min(1.0, size)
        failed = np.flatnonzero(~(after <= tolerance))
        if len(failed):
            on[failed] = q[failed]
            _, residual = _closest(program, q[failed], v[failed], t[failed], -1.0)
            moved[failed] = np.where(residual <= unseen, 0.0, np.nan)
        return on, moved

    def _at(self, k: NDArray[np.int64], s: Array) -> tuple[Array, Array]:
        """Return displacements from the samples to the cubics, and their rates in time, (n, nv) each."""
        run = self.run
        q0, q1, v0, v1 = run.q[k], run.q[k + 1], run.v[k], run.v[k + 1]
        h, part = (self.t[k + 1] - self.t[k])[:, None], s[:, None]
        step, end_rate = self._steps(q0, q1, v1) if self._flat else self._curved_steps(k)
        dof = self._turns[:, 0]  # a continuous joint may turn more than once in a long step
        mean_turn = h * (v0 + v1)[:, dof] / 2.0
        step[:, dof] += 2.0 * np.pi * np.round((mean_turn - step[:, dof]) / (2.0 * np.pi))
        back = 1.0 - part
        xi = h * part * back**2 * v0 + part**2 * (3.0 - 2.0 * part) * step - h * part**2 * back * end_rate
        chord = np.divide(step, h, out=np.zeros_like(step), where=h > 0.0)
        rate = (
            back * (1.0 - 3.0 * part) * v0 + 6.0 * part * back * chord - part * (2.0 - 3.0 * part) * end_rate
        )
        return xi, rate

    def _steps(self, q0: Array, q1: Array, v1: Array) -> tuple[Array, Array]:
        """Return differences of configurations, and end rates in the tangent space at q0, (n, nv) each."""
        steps = np.empty(v1.shape)
        dof, first = self._lines.T
        steps[:, dof] = q1[:, first] - q0[:, first]
        dof, first = self._turns.T
        x0, y0, x1, y1 = q0[:, first], q0[:, first + 1], q1[:, first], q1[:, first + 1]
        steps[:, dof] = np.arctan2(x0 * y1 - y0 * x1, x0 * x1 + y0 * y1)
        return steps, v1

    def _curved_steps(self, k: NDArray[np.int64]) -> tuple[Array, Array]:
        """Return differences and rates at their ends, as `_steps`, for joints on any manifold."""
        steps, rates = self._differences
        for one in np.unique(k[~self._known[k]]):
            pair = self.run.q[one], self.run.q[one + 1]
            steps[one] = pin.difference(self.model, *pair)
            rates[one] = pin.dDifference(self.model, *pair, pin.ARG1) @ self.run.v[one + 1]
        self._known[k] = True
        return steps[k], rates[k]


def _closest(program: core.Program, q: Array, v: Array, t: Array, max_residual: float) -> tuple[Array, Array]:
    """Return configurations with closed loops, (n, nq), and their largest residuals or NaN, (n,).

    Configurations with residuals above `max_residual` are returned unchanged.
    """
    if not any(block.moves_in_time for block in program.bilateral):
        no_values: Any = np.zeros((len(q), 0))
        closed, _, after, _ = core.nearest_states(
            program, q, v, t=float(t[0]), max_residual=max_residual, threads=1, names=[], values=no_values
        )
        return np.array(closed).reshape(q.shape), np.asarray(after)
    projected, residual, runner = q.copy(), np.full(len(q), np.nan), program.runner()
    for i in range(len(q)):
        with suppress(PinNonidealError, core.CoreFailure):
            projected[i], _, _, residual[i], _ = runner.project(q[i], v[i], float(t[i]), max_residual)
    return projected, residual
