"""Projection onto the constraints: the core's Newton method for nearby states, a global search for others."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from contextlib import suppress
from copy import copy

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from pin_nonideal.core_loader import core
from pin_nonideal.description.contacts.point_names import NO_POINTS
from pin_nonideal.errors import InputError, NonFiniteError, PinNonidealError
from pin_nonideal.types import Array, Model

from .closure_search import ClosureSearch, mass_function, metric
from .errors import open_loops, penetration_error, refuse_deep_starts, velocity_error, widest_loop
from .held_entries import (
    NOTHING_HELD,
    Held,
    changes,
    coordinate_notes,
    holding,
    moved_mask,
    moves,
    polish_free,
    require_rounding,
    with_entries,
)
from .loop_closure import CLOSURE_TOLERANCE, FAR_MOVE, Closure
from .report import ProjectionReport, report_of
from .rows import gap_rows, holonomic_rows, residuals_at, rows_at
from .scales import chain, coordinate, largest_body, slides

# Largest remaining rate of consistent rows, relative to 1 + |v|.
RATE_TOLERANCE = 1e-6
# Newton's method returns the nearest state, to rounding, if no coordinate moves by more than this fraction of
# its unit.
MAX_NEWTON_MOVE = 1e-6
# Factor of MAX_NEWTON_MOVE in ambient coordinates; a tangent displacement is never ten times as long.
AMBIENT_FACTOR = 0.1
# Largest residual from which Newton's method is tried, relative to the length of the mechanism.
NEWTON_REACH = 1e-3
# Displacements above this fraction of a unit are reported.
REPORTED_MOVE = 1e-3
# Penetration up to this fraction of the size of the scene is rounding error.
PENETRATION_ROUNDING = 1e-12
# Largest initial penetration, relative to the length of the mechanism or to 1 m if the mechanism is longer.
# Deeper penetration cannot be rounding error of a pose.
MAX_PENETRATION = 1e-2
# Maximum number of degrees of freedom for a search, which takes minutes above it. Newton's method is then
# tried from any residual.
MANY_FREEDOMS = 300


class Projection:
    """Projection onto the constraints of one scene.

    Args:
        model: pinocchio.Model.
        program: the core's program.
        q0: configuration that defines the length of the mechanism if its model has no lengths, (nq,).
        immovable_contacts: names of contacts that no joint moves.
        is_start: whether a run may start at q0. If not, user functions are not called at q0, and the first
            start defines the length.
        contact_of: contact of the user that errors name in place of a contact point.

    Attributes:
        unit: unit displacement of each coordinate, (nv,): a radian, or the length of the mechanism.
        length: length of the mechanism [m]: the longest chain of joints and frames.
    """

    def __init__(
        self,
        model: Model,
        program: core.Program,
        q0: Array,
        immovable_contacts: Collection[str] = (),
        is_start: bool = True,
        contact_of: Mapping[str, str] = NO_POINTS,
    ) -> None:
        self._contact_of = contact_of
        self.model, self.program = model, program
        self._slides = slides(model)
        self._chain = chain(model)
        self._measured = self._chain > 0.0 or is_start
        self._gaps = gap_rows(program, immovable_contacts)
        self._loops = holonomic_rows(program)
        self._measure(self._chain or (self._length_at(q0) if self._measured else 0.0))
        self._has_gaps = bool(self._gaps.any())

    def _measure(self, length: float) -> None:
        """Set the length of the mechanism; zero is replaced by 1 m."""
        self.length = length or 1.0
        self.unit = np.where(self._slides, self.length, 1.0)
        self._closed = CLOSURE_TOLERANCE * min(1.0, self.length)

    def measure_at(self, q: Array) -> None:
        """Compute the length of the mechanism at its first start, if it is not known yet.

        Args:
            q: configuration of the start, (nq,).
        """
        if not self._measured:
            self._measured = True
            self._measure(self._length_at(q))

    def nearest(
        self, q: Array, v: Array, t: float, held: Held = NOTHING_HELD
    ) -> tuple[Array, Array, ProjectionReport]:
        """Return the nearest state with phi(q, t) = 0 and A v + phi_t = 0.

        Args:
            q: configuration, (nq,).
            v: velocity, (nv,).
            t: time [s].
            held: entries of q and v to hold.

        Returns:
            q (nq,), v (nv,), and the report of their displacements.

        Raises:
            LoopClosureError: no configuration that satisfies the constraints is found.
            InputError: a contact starts with deep penetration, or the constraints do not admit the held
                entries together.
            InconsistentConstraintsError: no velocity satisfies the constraints.
            NonFiniteError: the velocity on the constraints is above the largest number.
        """
        if not self.program.rows:
            return (
                q,
                v,
                report_of(
                    self.model,
                    self.unit,
                    mass_function(self.model, self.program.runner()),
                    (q, v),
                    (q, v),
                    held,
                ),
            )
        self.measure_at(q)
        runner = self.program.runner()
        phi = residuals_at(runner, q, v, t)
        allowed = MAX_PENETRATION * min(1.0, self.length)
        refuse_deep_starts(phi, self.program, allowed, t, self._contact_of)
        on, v_on, before, after, rate = runner.project(q, v, t, self._reached())
        iterations, is_nearest, is_closed = 0, True, after <= self._closed
        if not (is_closed and self._is_nearby(q, on) and self._stays_outside(runner, q, on, t)):
            closure, is_nearest = self._search(runner, q, t, on if is_closed else None)
            iterations = closure.iterations
            on, v_on, after, rate = self._polished(runner, closure.q, v, t)
            is_closed = after <= self._closed or closure.gap <= CLOSURE_TOLERANCE
            self._require_met(runner, q, closure.q, is_closed, is_nearest, t)
        if held.q is not None and held.q.any():
            on, search = self._hold(runner, q, on, held.q, held.firm_q, t)
            if search is not None:
                iterations, is_nearest = iterations + search[0], search[1]
            _, v_on, _, _, rate = runner.project(on, v, t, np.inf)
        if not np.isfinite(v_on).all():
            raise NonFiniteError("v: the velocity on the constraints overflows; give a slower one")
        if not rate <= RATE_TOLERANCE * min(1.0, self.length) * (1.0 + _largest(v_on)):
            raise velocity_error(rows_at(runner, on, v_on, t)[3], self.program, t, self._contact_of)
        mass = mass_function(self.model, runner)
        if held.v is not None and changes(v, v_on, held.v):
            with suppress(*(() if held.firm_v else (InputError,))):
                v_on = holding(
                    self.model,
                    self.program,
                    on,
                    v,
                    held.v,
                    ~self._gaps,
                    metric(mass(on), self.unit),
                    self.unit,
                    t,
                )
        return (
            on,
            v_on,
            report_of(self.model, self.unit, mass, (q, v), (on, v_on), held, before, iterations, is_nearest),
        )

    def _hold(
        self, runner: core.Runner, q: Array, on: Array, held: NDArray[np.bool_], firm: bool, t: float
    ) -> tuple[Array, tuple[int, bool] | None]:
        """Return the configuration near q with held coordinates.

        Args:
            runner: a workspace of the core.
            q: given configuration, (nq,).
            on: nearest configuration on the constraints, (nq,).
            held: mask of named coordinates, (nv,).
            firm: whether an error is raised if coordinates cannot be held; otherwise `on` is returned.
            t: time [s].

        Returns:
            The configuration, (nq,), and (steps of the search, whether it confirms the closure as nearest),
            or None without a search.

        Raises:
            InputError: the constraints do not admit the named coordinates together.
        """
        search = None
        if moves(self.model, q, on, held, self.unit):
            closure, nearest = self._search(runner, q, t, None, ~held)
            search = closure.iterations, nearest
            polished = polish_free(self.model, runner, closure.q, ~held, self._loops, t)
            phi = self._residuals(runner, polished, t)
            if _largest(phi[self._loops]) <= self._closed and self._is_outside(polished, phi):
                on = polished
            elif firm:
                require_rounding(self.model, q, on, held, REPORTED_MOVE * self.unit, t)
        return with_entries(self.model, on, q, held & ~moved_mask(self.model, q, on, self.unit)), search

    def _require_met(
        self, runner: core.Runner, q: Array, projected: Array, is_closed: bool, nearest: bool, t: float
    ) -> None:
        """Check that a search ended on the constraints, and near its start if only contacts were violated.

        Args:
            runner: a workspace of the core.
            q: start of the search, (nq,).
            projected: end of the search, (nq,).
            is_closed: whether all constraints are satisfied at the end.
            nearest: whether the search confirms the end as nearest.
            t: time [s].

        Raises:
            LoopClosureError: loops stay open.
            InputError: the loops are closed at q, but no short displacement removes the penetration.
        """
        phi, now = self._residuals(runner, q, t), self._residuals(runner, projected, t)
        inside = not self._is_outside(q, phi) and widest_loop(phi, self.program)[1] <= self._closed
        far = (np.abs(pin.difference(self.model, q, projected)) > FAR_MOVE * self.unit).any()
        if inside and (not is_closed or (far and not nearest)):
            raise penetration_error(phi, self.program, t, self._contact_of)
        if not is_closed:
            raise open_loops(now, self.program, t, self._contact_of)

    def _polished(
        self, runner: core.Runner, q: Array, v: Array, t: float
    ) -> tuple[Array, Array, float, float]:
        """Polish the result of a search to rounding; return the state, its largest residual and rate.

        If polishing moves far or causes penetration, the result of the search is kept.
        """
        on, v_on, _, after, rate = runner.project(q, v, t, np.inf)
        stays = self._is_nearby(q, on) and self._is_outside(on, self._residuals(runner, on, t))
        if self._has_gaps and not stays and self._is_outside(q, self._residuals(runner, q, t)):
            on = q
        return on, v_on, after, rate

    def nearest_of_each(
        self, q: Array, v: Array, t: float, threads: int, numbers: tuple[list[tuple[str, int, str]], Array]
    ) -> tuple[Array, Array, dict[int, PinNonidealError | core.CoreFailure]]:
        """Return the result of `nearest` for each of many states; Newton's method uses several threads.

        States for which Newton's method does not suffice are projected one after another.

        Args:
            q: configurations, (n, nq).
            v: velocities, (n, nv).
            t: time [s].
            threads: number of native threads.
            numbers: numbers of the program that differ between runs, see `compilation.parameter_overrides`.

        Returns:
            q (n, nq), v (n, nv), and the exceptions of `nearest` by index of the state.
        """
        failures: dict[int, PinNonidealError | core.CoreFailure] = {}
        if not self.program.rows:
            return q, v, failures
        self.measure_at(q[0])
        names, values = numbers
        found_q, found_v, after, rate = core.nearest_states(
            self.program, q, v, t=t, max_residual=self._reached(), threads=threads, names=names, values=values
        )
        on, v_on = found_q.reshape(q.shape), found_v.reshape(v.shape)
        met = rate <= RATE_TOLERANCE * min(1.0, self.length) * (1.0 + np.abs(v_on).max(axis=1, initial=0.0))
        met &= np.isfinite(v_on).all(axis=1)
        hardly = np.abs(on - q).max(axis=1, initial=0.0) <= AMBIENT_FACTOR * MAX_NEWTON_MOVE * self.unit.min(
            initial=np.inf
        )
        sure = (after <= self._closed) & met & hardly
        if self._has_gaps:
            sure &= (after <= PENETRATION_ROUNDING) & (on == q).all(axis=1)
        for i in map(int, np.flatnonzero(~sure)):
            copied = copy(self)
            if names:
                copied.program = core.with_numbers(self.program, names, values[i : i + 1])
            is_valid = after[i] <= self._closed and met[i] and self._is_nearby(q[i], on[i])
            if not (is_valid and copied._stays_outside(copied.program.runner(), q[i], on[i], t)):
                try:
                    on[i], v_on[i], _ = copied.nearest(q[i], v[i], t)
                except (PinNonidealError, core.CoreFailure) as failure:
                    failures[i] = failure
        return on, v_on, failures

    def _length_at(self, q: Array) -> float:
        """Return the length of a mechanism without lengths: its largest sliding coordinate, residual or body.

        The depth of a penetration is not a length of the mechanism, although it may be the only residual of a
        start in contact.
        """
        away = pin.difference(self.model, pin.neutral(self.model), q)[self._slides]
        phi = residuals_at(self.program.runner(), q, np.zeros(self.model.nv), 0.0)
        phi = phi[~(self._gaps & (phi <= PENETRATION_ROUNDING))]
        return max(_largest(away), _largest(phi), largest_body(self.model))

    def _reached(self) -> float:
        """Return the largest residual from which Newton's method is tried."""
        return np.inf if self.model.nv > MANY_FREEDOMS else NEWTON_REACH * self.length

    def _residuals(self, runner: core.Runner, q: Array, t: float) -> Array:
        """Return the residuals of all rows, (m,)."""
        return residuals_at(runner, q, np.zeros(self.model.nv), t)

    def _is_outside(self, q: Array, phi: Array) -> bool:
        """Check if no contact penetrates by more than rounding."""
        away = pin.difference(self.model, pin.neutral(self.model), q)[self._slides]
        size = max(1.0, self.length, _largest(away))
        return bool(phi[self._gaps].min(initial=0.0) >= -PENETRATION_ROUNDING * size)

    def _stays_outside(self, runner: core.Runner, q: Array, on: Array, t: float) -> bool:
        """Check if no contact penetrates before and after a displacement."""
        return not self._has_gaps or all(self._is_outside(x, self._residuals(runner, x, t)) for x in (q, on))

    def _is_nearby(self, q: Array, on: Array) -> bool:
        return bool((np.abs(pin.difference(self.model, q, on)) <= MAX_NEWTON_MOVE * self.unit).all())

    def _search(
        self,
        runner: core.Runner,
        q: Array,
        t: float,
        newton: Array | None,
        free: NDArray[np.bool_] | None = None,
    ) -> tuple[Closure, bool]:
        """Return the nearest closure, and whether the search confirms it as nearest.

        If a search would take minutes, the result `newton` of Newton's method is returned. `free` is the mask
        of coordinates that may move, (nv,); all when None.
        """
        if free is not None and not free.any():
            return Closure(q, np.inf, 0.0, False, 0), False
        if (
            newton is not None
            and self.model.nv > MANY_FREEDOMS
            and self._is_outside(newton, self._residuals(runner, newton, t))
        ):
            return Closure(newton, 0.0, 0.0, False, 0), False
        return self._closure_search(runner, t).nearest(q, free)

    def _closure_search(self, runner: core.Runner, t: float) -> ClosureSearch:
        return ClosureSearch(
            self.model, runner, t, self.unit, self.length, self._slides, self._gaps, self._loops
        )

    def _furthest(self, move: Array) -> int:
        """Return the coordinate with the largest displacement relative to its unit."""
        return int(np.argmax(np.abs(move) / self.unit))

    def notes(self, q: Array, on: Array, held: NDArray[np.bool_] | None = None) -> list[str]:
        """Return notes on a notable displacement of a configuration, or no note.

        Args:
            q: given configuration, (nq,).
            on: configuration at the start of the run, (nq,).
            held: mask of named coordinates, (nv,), or None.
        """
        if held is not None:
            return coordinate_notes(self.model, q, on, held, self.unit)
        move = pin.difference(self.model, q, on)
        if not (np.abs(move) > REPORTED_MOVE * self.unit).any():
            return []
        dof = self._furthest(move)
        unit = "m" if self._slides[dof] else "rad"
        return [
            "the initial configuration did not satisfy the constraints and was moved onto them: "
            f'"{coordinate(self.model, dof)}" by {move[dof]:.3g} {unit}, the others by less; '
            "Scene.project(report=True) returns details"
        ]


def closure_nearby(
    model: Model,
    program: core.Program,
    runner: core.Runner,
    q: Array,
    enough: float,
    *,
    is_nearest: bool = True,
) -> tuple[Array, float]:
    """Return the configuration near q with the smallest residual found, closed or not.

    Args:
        model: pinocchio.Model.
        program: the core's program.
        runner: a workspace of the program.
        q: configuration, (nq,).
        enough: residual up to which no search is needed [m or rad].
        is_nearest: whether a search continues from the first closure to the nearest.

    Returns:
        The configuration, (nq,), and its largest residual [m or rad].
    """
    zero = np.zeros(model.nv)
    projection = Projection(model, program, q)
    try:
        on, _, before, after, _ = runner.project(q, zero, 0.0, projection._reached())
    except core.CoreFailure:
        before = after = np.inf
    if min(before, after) > enough:
        search = projection._closure_search(runner, 0.0)
        on = (search.nearest(q)[0] if is_nearest else search.first(q)).q
        before, after = np.inf, _largest(residuals_at(runner, on, zero, 0.0))
    return (on, after) if after <= before else (q, before)


def _largest(values: Array) -> float:
    return float(np.abs(values).max(initial=0.0))
