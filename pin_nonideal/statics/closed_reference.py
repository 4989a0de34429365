"""A reference motion on the constraints of a scene: some coordinates are given, and the others follow."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.description.scene_spec import SceneSpec
from pin_nonideal.errors import InputError, PinNonidealError
from pin_nonideal.scene.scene import Scene, compiled_scene
from pin_nonideal.states.errors import widest_loop
from pin_nonideal.states.held_entries import Held, polish_free
from pin_nonideal.states.reference_motion import TIME_ROUNDING, ReferenceMotion
from pin_nonideal.states.rows import MIN_SINGULAR_VALUE, holonomic_rows, residuals_at, rows_at
from pin_nonideal.states.scales import coordinate, slides
from pin_nonideal.types import Array, Model

from .inverse_dynamics import torques_of_motion
from .residual import AtRest

Mask = NDArray[np.bool_]

# Velocities of a coordinate below this fraction of the admitted velocities depend on coordinates chosen
# earlier.
MIN_INDEPENDENT_VELOCITY = 1e-6
MAX_MOVE = 0.1  # move of a given coordinate between two closures, in rad or relative to the scene's length
LOG_ROUNDING = 1e-3  # largest move of a given coordinate, in rad or relative to the scene's length
# Largest change of a given velocity, relative to the largest given velocity. Differences of logged positions
# stay below this bound.
RATE_ROUNDING = 0.1
CLOSURE_TOL = 1e-9  # residual of a reference on the constraints, relative to the scene's length or 1 m


class ClosedReference:
    """A reference motion on the constraints, and the torques that drive it.

    As many given coordinates as the constraints leave free are kept, driven ones first. The other coordinates
    follow from the constraints at every time.

    Args:
        compiled: the compiled scene without actuation and contacts; its constraints hold positions.
        times: sample times [s], (nt,).
        q: configurations, (nt, nq); coordinates that are not given are guesses.
        v: velocities, (nt, nv), or None.
        stated: mask of the stated coordinates, (nv,).
        driven: mask of the driven degrees of freedom, (nv,).
        who: prefix of error messages.
        rounding: rounding error of times at the ends, see `ReferenceMotion`.

    Raises:
        InputError: the given coordinates do not determine the motion, no configuration on the constraints has
            them, or given coordinates or velocities violate the constraints.
    """

    def __init__(
        self,
        compiled: CompiledScene,
        times: Array,
        q: Array,
        v: Array | None,
        stated: Mask,
        driven: Mask,
        who: str,
        rounding: float = TIME_ROUNDING,
    ) -> None:
        self._compiled, self._driven, self._who = compiled, driven, who
        self._program, self._model = compiled.program, compiled.model
        self._runner, self._rows = self._program.runner(), holonomic_rows(self._program)
        self._allowed = CLOSURE_TOL * max(1.0, compiled.projection.length)
        still = np.zeros(compiled.model.nv)
        try:
            start = compiled.project(q[0], still, float(times[0]), Held(q=stated & driven))[0]
        except PinNonidealError:
            self._free = ~(stated & driven)
            start = self._configuration_on(q[0], float(times[0]))  # raises an error that names the loop
        basis = AtRest(compiled, still, float(times[0]), start).free(start)
        self._free = ~self._independent_mask(basis, [stated & driven, stated])
        on = np.array(q)
        on[0] = self._configuration_on(start, float(times[0]))
        unit = np.where(slides(compiled.model), compiled.projection.length or 1.0, 1.0)
        for k in range(1, len(on)):
            on[k] = self._follow_sample(on[k - 1], q[k], stated, times[k - 1 : k + 1], unit)
        self._require_reference(on, q, times, stated, unit)
        on_rates = None if v is None else np.array(v)
        if v is not None and on_rates is not None:
            for k, t in enumerate(times.tolist()):
                on_rates[k] = self._velocity(on[k], on_rates[k], t)
            self._require_rates(on, on_rates, v, times, stated, unit)
        self._motion = ReferenceMotion(compiled.model, times, on, on_rates, rounding)

    def __call__(self, t: float) -> tuple[Array, Array, Array]:
        """Return q (nq,), v (nv,) and a (nv,) on the constraints at time t [s]."""
        q, v, a = self._motion(t)
        q = self._configuration_on(q, t)
        v = self._velocity(q, v, t)
        A, b, _, _ = rows_at(self._runner, q, v, t)
        a = np.array(a)
        a[self._free] += self._solve_dependent(A, b - A @ a, t)
        return q, v, a

    def torques(self, q: Array, v: Array, a: Array, t: float) -> Array:
        """Return the torques of the driven joints for a motion on the constraints, (nv,)."""
        name, dofs = self._model.name or "scene", np.flatnonzero(self._driven).tolist()
        rest = AtRest(self._compiled, np.zeros(len(v)), t, q)
        return torques_of_motion(rest, q, v, a, dofs, name).tau

    def _follow_sample(self, before: Array, q: Array, stated: Mask, times: Array, unit: Array) -> Array:
        """Return a sample on the constraints, followed from the sample before it in short moves, (nq,).

        Args:
            before: the sample before it, on the constraints, (nq,).
            q: the sample, (nq,).
            stated: mask of its given coordinates, (nv,).
            times: times of both samples [s].
            unit: unit displacement of each coordinate, (nv,).
        """

        def way() -> Array:
            return np.where(stated, pin.difference(self._model, before, q), 0.0)

        count = max(1, int(np.ceil(np.abs(way() / unit).max(initial=0.0) / MAX_MOVE)))
        for left in range(count, 0, -1):
            t = float(times[1] - (left - 1) / count * (times[1] - times[0]))
            before = self._configuration_on(pin.integrate(self._model, before, way() / left), t)
        return before

    def _require_reference(self, on: Array, q: Array, times: Array, stated: Mask, unit: Array) -> None:
        """Check that given coordinates keep their values, up to the rounding error of a log.

        Raises:
            InputError: a given coordinate has moved farther.
        """
        model, still = self._model, np.zeros(self._model.nv)
        for t, now, reference in zip(times.tolist(), on, q, strict=True):
            away = np.where(stated, pin.difference(model, now, reference), 0.0)
            if np.abs(away / unit).max(initial=0.0) > LOG_ROUNDING:
                given = pin.integrate(model, now, away)
                phi = residuals_at(self._runner, given, still, t)
                raise self._open(f"q at t = {t:g} s", "(m or rad)", phi, away, unit)

    def _require_rates(
        self, on: Array, on_rates: Array, v: Array, times: Array, stated: Mask, unit: Array
    ) -> None:
        """Check that given velocities keep their values, up to the errors of differences.

        Raises:
            InputError: a given velocity has changed more.
        """
        allowed = LOG_ROUNDING + RATE_ROUNDING * float(np.abs(v[:, stated] / unit[stated]).max(initial=0.0))
        for t, q, now, reference in zip(times.tolist(), on, on_rates, v, strict=True):
            away = np.where(stated, reference - now, 0.0)
            if np.abs(away / unit).max(initial=0.0) > allowed:
                rate = rows_at(self._runner, q, now + away, t)[3]
                raise self._open(f"v at t = {t:g} s", "(m/s or rad/s)", rate, away, unit)

    def _open(self, what: str, unit: str, rows: Array, away: Array, scale: Array) -> InputError:
        """Return the error of a sample that violates the constraints.

        Args:
            what: name of the sample in messages.
            unit: unit of residuals or rates.
            rows: residuals or rates of the sample, (m,).
            away: difference of the sample from the one on the constraints, (nv,).
            scale: unit displacement of each coordinate, (nv,).
        """
        name, gap = widest_loop(rows, self._program)
        worst = int(np.argmax(np.abs(away / scale)))
        return InputError(
            f'{self._who}: {what} opens "{name}" by {gap:.2g} {unit}, and the constraints change '
            f'"{coordinate(self._model, worst)}" by {abs(away[worst]):.2g}; give samples that satisfy '
            "the constraints, or only as many joints by name as the constraints leave free, "
            f"{np.sum(~self._free)} here"
        )

    def _independent_mask(self, basis: Array, groups: list[Mask]) -> Mask:
        """Return the mask of coordinates that determine the motion, (nv,), from the first groups first."""
        chosen, left = np.zeros(len(basis), dtype=bool), basis.copy()
        for group in groups:
            while chosen.sum() < basis.shape[1]:
                sizes = np.where(group & ~chosen, np.linalg.norm(left, axis=1), 0.0)
                best = int(np.argmax(sizes))
                if sizes[best] < MIN_INDEPENDENT_VELOCITY:
                    break
                chosen[best] = True
                along = left[best] / sizes[best]
                left = left - np.outer(left @ along, along)
        if chosen.sum() < basis.shape[1]:
            loose = coordinate(self._model, int(np.argmax(np.linalg.norm(left, axis=1))))
            raise InputError(
                f'{self._who}: q must determine the motion with feedforward "constrained"; the constraints '
                f'leave "{loose}" free beside the joints that q names; name further joints'
            )
        return chosen

    def _configuration_on(self, q: Array, t: float) -> Array:
        """Return the configuration on the constraints with the independent coordinates of q, (nq,)."""
        on = polish_free(self._model, self._runner, q, self._free, self._rows, t)
        phi = residuals_at(self._runner, on, np.zeros(len(self._free)), t)
        if not np.abs(phi[self._rows]).max(initial=0.0) <= self._allowed:
            name, gap = widest_loop(phi, self._program)
            raise InputError(
                f"{self._who}: no configuration on the constraints has the reference at t = {t:g} s: "
                f'"{name}" stays open by {gap:.2g} (m or rad); give q within the reach of the constraints'
            )
        return on

    def _velocity(self, q: Array, v: Array, t: float) -> Array:
        """Return the velocity on the constraints with the independent entries of v, (nv,)."""
        A, _, _, rate = rows_at(self._runner, q, v, t)
        closed = np.array(v)
        closed[self._free] -= self._solve_dependent(A, rate, t)
        return closed

    def _solve_dependent(self, A: Array, b: Array, t: float) -> Array:
        """Solve A x = b for the dependent coordinates."""
        own = A[np.ix_(self._rows, self._free)]
        x, _, rank, _ = np.linalg.lstsq(own, b[self._rows], rcond=MIN_SINGULAR_VALUE)
        if rank < own.shape[1]:
            raise InputError(
                f"{self._who}: the reference passes a singular position at t = {t:g} s, where the given "
                "coordinates do not determine the others"
            )
        return np.asarray(x)


def without_drives(model: Model, q0: Array, spec: SceneSpec, who: str) -> CompiledScene:
    """Return a compiled scene with the constraints, laws and forces of another, without contacts and drives.

    Args:
        model: pinocchio.Model.
        q0: initial configuration, (nq,).
        spec: descriptions of the other scene.
        who: prefix of error messages.

    Raises:
        InputError: a constraint holds no position.
    """
    scene = Scene(
        model,
        constraints=spec.constraints,
        laws=spec.laws,
        forces=spec.forces,
        q0=q0,
        terms=spec.terms,
        assembly_tolerance=spec.assembly_tolerance,
    )
    compiled = compiled_scene(scene)
    for c in compiled.program.constraints:
        if not np.all(c.holonomic):
            raise InputError(
                f'{who}: feedforward "constrained" needs constraints of positions; "{c.name}" constrains '
                'velocities only; use feedforward "rnea" or "gravity"'
            )
    return compiled
