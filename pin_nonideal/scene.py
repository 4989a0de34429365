"""Scene: a model with what holds it, rubs it and drives it, analysed once into the core's program."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from .checks import array, number, sequence
from .closure import close_loops
from .configurations import configuration
from .constraints import KnifeEdge, Rolling, UserConstraint
from .contacts import PointContact
from .equation import Solution
from .errors import (
    FrictionParadoxError,
    InconsistentConstraintsError,
    InputError,
    LoopClosureError,
    NonFiniteError,
    RunError,
    SingularMassError,
    StepSizeError,
)
from .laws import JointFriction
from .lowering import Lowering, core, unique_names

Array = NDArray[np.float64]

# A gap that stays above this after projection [m or rad] is a loop that does not close.
CLOSURE_TOLERANCE = 1e-8
# Rows below this part of the largest entry of A at random states vanish structurally, and rows whose directions
# differ by less are copies: rounding of the kinematics.
STRUCTURAL = 1e-11
# The derivatives of a user's constraint are compared with differences, which carry about this relative error.
DERIVATIVE_TOLERANCE = 1e-4


class Scene:
    """A Pinocchio model with constraints, laws, contacts, forces and actuation.

    Everything is checked when the scene is made; rows that can never act are found then and left out.

    Args:
        model: pinocchio.Model.
        constraints: descriptions of `pin_nonideal.constraints`, or Pinocchio's RigidConstraintModel,
            PointAnchorConstraintModel and FrameAnchorConstraintModel.
        laws: descriptions of `pin_nonideal.laws`.
        contacts: descriptions of `pin_nonideal.contacts`.
        forces: descriptions of `pin_nonideal.forces`.
        actuation: None, a constant torque (nv,), a function (t, q, v) -> tau, or a description of
            `pin_nonideal.actuation`.
        q0: initial configuration, (nq,); the neutral one when None.  Frames held to the world are held where
            they are here.
        v0: initial velocity, (nv,); zero when None.
        visual_model: pinocchio.GeometryModel for the replay.
        collision_model: pinocchio.GeometryModel.
        name: shown in messages and pages; the model's own when None.
        notes: remarks of the loader, shown by `report`.
        source: where the robot comes from.
        licence: its licence.

    Raises:
        InputError, UnknownNameError: something does not fit the model.
        InconsistentConstraintsError: rows that vanish ask for an acceleration.

    Attributes:
        constraint_slices: rows of `lam` of each constraint and contact, by name.
        anchor_frames: (name, frame id, frame id or None) of what joins two frames.
        element_names: names of the frictional elements, in the order of `modes`.
        law_names: names of the laws, in the order of the ledger's columns.
        dropped: (name, row, reason) of rows that can never act.
    """

    def __init__(
        self,
        model: Any,
        *,
        constraints: Sequence[Any] = (),
        laws: Sequence[Any] = (),
        contacts: Sequence[Any] = (),
        forces: Sequence[Any] = (),
        actuation: Any = None,
        q0: ArrayLike | None = None,
        v0: ArrayLike | None = None,
        visual_model: Any = None,
        collision_model: Any = None,
        name: str | None = None,
        notes: Sequence[str] = (),
        source: str | None = None,
        licence: str | None = None,
    ) -> None:
        if not isinstance(model, pin.Model):
            raise InputError(f"Scene: model must be a pinocchio.Model; got {type(model).__name__}")
        self.model = model
        self.name = name or model.name or "scene"
        self.constraints, self.laws = sequence("constraints", constraints), sequence("laws", laws)
        self.contacts, self.forces = sequence("contacts", contacts), sequence("forces", forces)
        self.actuation = actuation
        self.visual_model, self.collision_model = visual_model, collision_model
        self.notes, self.source, self.licence = list(notes), source, licence
        self._check_model()
        self.q0 = pin.neutral(model) if q0 is None else self._configuration(q0, "q0")
        self.v0 = np.zeros(model.nv) if v0 is None else self._velocity(v0, "v0")
        self.dropped: list[tuple[str, int, str]] = []
        self._lowered = self._lower()
        self._builder = self._lowered.builder
        self.constraint_slices = self._lowered.slices
        self.anchor_frames = self._lowered.anchors
        self.element_names = list(self._lowered.friction_names)
        self.law_names = list(self._lowered.law_names)
        self.z0 = self._lowered.z0
        self._builder.finish()
        self._check_user_constraints()
        self._drop_rows()
        self._runner = self._builder.runner()
        self._nv = int(model.nv)
        self._closed: tuple[Array, Array] | None = None

    def __repr__(self) -> str:
        return (
            f'<Scene "{self.name}": nv {self.model.nv}, {len(self.constraints)} constraints, '
            f"{len(self.laws)} laws, {len(self.contacts)} contacts>"
        )

    # --- analysis ---------------------------------------------------------------------------------------------

    def _check_model(self) -> None:
        model = self.model
        for i in range(1, model.njoints):
            Y, name = model.inertias[i], model.names[i]
            parts = ("mass", Y.mass), ("center of mass", Y.lever), ("inertia", Y.inertia)
            for what, value in parts:
                array(f'Scene: the {what} moved by joint "{name}"', value, np.shape(value))
            if Y.mass < 0.0:
                raise InputError(
                    f'Scene: the mass moved by joint "{name}" must not be negative; got {Y.mass:g} kg'
                )
            array(f'Scene: the place of joint "{name}"', model.jointPlacements[i].homogeneous, (4, 4))
        for frame in model.frames:
            array(f'Scene: the place of frame "{frame.name}"', frame.placement.homogeneous, (4, 4))
        array("Scene: the gravity of the model", model.gravity.vector, (6,))
        armature = array("Scene: the armature of the model", model.armature, (model.nv,))
        if (armature < 0.0).any():
            raise InputError(
                f"Scene: the armature of the model must not be negative; got {armature.min():g} kg m^2"
            )

    def _lower(self) -> Any:
        low = Lowering(self.model, self.q0)
        taken: set[str] = set()
        constraint_names = unique_names(self.constraints, taken)
        contact_names = unique_names(self.contacts, taken)
        law_names = unique_names(self.laws, set())
        for c, name in zip(self.constraints, constraint_names, strict=True):
            low.constraint(c, name)
        for c, name in zip(self.contacts, contact_names, strict=True):
            if not isinstance(c, PointContact):
                raise InputError(f"a contact must be a PointContact; got {c!r}")
            low.contact(c, name)
        by_name = dict(zip(constraint_names, self.constraints, strict=True))
        for law, name in zip(self.laws, law_names, strict=True):
            low.law(law, name, by_name)
        for c, name in zip(self.contacts, contact_names, strict=True):
            low.contact_friction(c, name)
        for f in self.forces:
            low.force(f)
        low.actuation(self.actuation)
        if low.out.unprojected:
            names = ", ".join(f'"{n}"' for n in low.out.unprojected)
            self.notes.append(f"{names}: no residual and no rate, so drift of these rows cannot be projected away")
        return low.out

    def _random_states(self, count: int) -> list[tuple[Array, Array]]:
        generator = np.random.default_rng(1)
        n = self.model.nv
        return [
            (pin.integrate(self.model, self.q0, generator.standard_normal(n)), generator.standard_normal(n))
            for _ in range(count)
        ]

    def _drop_rows(self) -> None:
        """Leaves out rows that vanish at every state and rows that are copies of others."""
        m = max((s.stop for s in self.constraint_slices.values()), default=0)
        if m == 0:
            return
        runner = self._builder.runner()
        blocks = self._lowered.blocks
        fixed = np.zeros(m, dtype=bool)  # rows that may look special at a few states and times only
        for name, block in blocks.items():
            fixed[self.constraint_slices[name]] = block in self._lowered.opaque
        if fixed.all():
            return
        samples = []
        for q, v in self._random_states(3):
            A, b, phi, _ = runner.rows(q, v, 0.37)
            samples.append((A.reshape(m, -1), b, phi))
        wide = np.hstack([A for A, _, _ in samples])
        right = np.column_stack([b for _, b, _ in samples])
        length = np.linalg.norm(wide, axis=1)
        tiny = STRUCTURAL * max(float(length.max()), 1e-300)
        keep = np.ones(m, dtype=bool)
        owner = {row: name for name, s in self.constraint_slices.items() for row in range(s.start, s.stop)}
        for row in map(int, np.flatnonzero((length <= tiny) & ~fixed)):
            name, local = owner[row], row - self.constraint_slices[owner[row]].start
            asked = float(np.abs(right[row]).max())
            if asked > 1e-9 * max(1.0, float(np.abs(right).max())):
                raise InconsistentConstraintsError(
                    f'row {local} of constraint "{name}" moves nothing and asks for the acceleration {asked:.1e}; '
                    "the joints leave that direction no freedom: drop the row or free a joint"
                )
            gap = max(abs(float(phi[row])) for _, _, phi in samples)
            if gap > CLOSURE_TOLERANCE:
                raise LoopClosureError(
                    f'loop "{name}" does not close: gap {gap:.2g} in row {local}, a direction in which no joint '
                    "moves; mend the frames' placement",
                    gaps={name: gap},
                )
            keep[row] = False
            self.dropped.append((name, local, "vanishes"))
        self._drop_copies(wide, right, length, keep & ~fixed, keep, owner)
        self.dropped.sort(key=lambda item: self.constraint_slices[item[0]].start + item[1])
        for name, s in self.constraint_slices.items():
            rows = np.flatnonzero(keep[s]).tolist()
            if len(rows) < s.stop - s.start:
                self._builder.keep_rows(blocks[name], rows)
        self._builder.finish()

    def _drop_copies(
        self, wide: Array, right: Array, length: Array, candidates: Any, keep: Any, owner: dict[int, str]
    ) -> None:
        rows = np.flatnonzero(candidates & (length > 0.0))
        unit = np.hstack([wide[rows], right[rows]]) / length[rows, None]
        probe = unit @ np.random.default_rng(2).standard_normal(unit.shape[1])
        unit *= np.sign(probe)[:, None]  # a copy may be turned around
        order = np.argsort(np.abs(probe), kind="stable")
        for place, i in enumerate(order):
            if not keep[rows[i]]:
                continue
            for j in order[place + 1 :]:
                if abs(abs(probe[j]) - abs(probe[i])) > 1e-9 * (1.0 + abs(probe[i])):
                    break
                if keep[rows[j]] and np.abs(unit[i] - unit[j]).max() <= STRUCTURAL * (1.0 + np.abs(unit[i]).max()):
                    first, second = sorted((int(rows[i]), int(rows[j])))
                    keep[second] = False
                    name = owner[second]
                    reason = f'copy of a row of "{owner[first]}"'
                    self.dropped.append((name, second - self.constraint_slices[name].start, reason))

    def _check_user_constraints(self) -> None:
        """d residual/dt = rate and d rate/dt = A a - b, once, by central differences."""
        mine = [(n, c) for n, c in zip(self.constraint_slices, self.constraints, strict=False)
                if isinstance(c, UserConstraint) and (c.residual is not None or c.rate is not None)]
        if not mine:
            return
        runner, h, t = self._builder.runner(), 1e-5, 0.21
        generator = np.random.default_rng(3)
        n = self.model.nv
        for name, c in mine:
            rows = self.constraint_slices[name]
            q = pin.integrate(self.model, self.q0, 0.1 * generator.standard_normal(n))
            v, a = self.v0 + generator.standard_normal(n), generator.standard_normal(n)
            A, b, _, rate = (x[rows] for x in self._rows(runner, q, v, t))
            ends = []
            for s in (h, -h):
                ahead = pin.integrate(self.model, q, s * v + 0.5 * s * s * a)
                ends.append(self._rows(runner, ahead, v + s * a, t + s))
            scale = 1.0 + float(np.abs(A).max()) * (1.0 + float(np.abs(v).max())) ** 2 + float(np.abs(b).max())
            if c.residual is not None:
                difference = (ends[0][2] - ends[1][2])[rows] / (2.0 * h)
                self._compare(name, "d residual/dt", difference, "rate", rate, scale)
            difference = (ends[0][3] - ends[1][3])[rows] / (2.0 * h)
            self._compare(name, "d rate/dt", difference, "A a - b", A @ a - b, scale)

    def _rows(self, runner: Any, q: Array, v: Array, t: float) -> tuple[Array, Array, Array, Array]:
        A, b, phi, rate = runner.rows(q, v, t)
        return A.reshape(-1, self.model.nv), b, phi, rate

    def _compare(self, name: str, left: str, x: Array, right: str, y: Array, scale: float) -> None:
        miss = np.abs(x - y)
        if float(miss.max(initial=0.0)) > DERIVATIVE_TOLERANCE * scale:
            k = int(np.argmax(miss))
            raise InputError(
                f'UserConstraint "{name}": {left} must equal {right}; row {k}: {x[k]:.6g} by differences against '
                f"{y[k]:.6g}; mend the function, the residual or the rate"
            )

    # --- states -----------------------------------------------------------------------------------------------

    def _configuration(self, q: ArrayLike, what: str) -> Array:
        return configuration(self.model, q, what)

    def _velocity(self, v: ArrayLike, what: str) -> Array:
        return np.array(array(what, v, (self.model.nv,)))

    def initial_state(self) -> tuple[Array, Array]:
        """The scene's initial state with its loops closed.

        Returns:
            q (nq,), v (nv,).

        Raises:
            LoopClosureError: the loops cannot be closed.
        """
        if self._closed is None:
            self._closed = self._project(self.q0, self.v0, 0.0)
        return self._closed[0].copy(), self._closed[1].copy()

    def project(
        self, q: ArrayLike | None = None, v: ArrayLike | None = None, t: float = 0.0
    ) -> tuple[Array, Array]:
        """Nearest consistent state: phi(q, t) = 0 and A v + phi_t = 0.

        Near the constraints this is Newton's method in the metric of M; from far away damped steps lead there,
        from several starts when needed.

        Args:
            q: configuration, (nq,); the scene's initial one when None.
            v: velocity, (nv,); the scene's initial one when None.
            t: time [s].

        Returns:
            q (nq,), v (nv,).

        Raises:
            LoopClosureError: the constraints cannot be met from here; `gaps` names each gap.
            InputError: wrong shapes or numbers.
        """
        if q is None and v is None and t == 0.0:
            return self.initial_state()
        q_in = self.q0 if q is None else self._configuration(q, "q")
        v_in = self.v0 if v is None else self._velocity(v, "v")
        return self._project(q_in, v_in, number("t", t))

    def _project(self, q: Array, v: Array, t: float) -> tuple[Array, Array]:
        runner = self._builder.runner()
        if not self.constraint_slices:
            return q, v
        try:
            phi = self._rows(runner, q, v, t)[2]
            if float(np.abs(phi).max(initial=0.0)) > 1e-3:
                q, _ = close_loops(self.model, self._holonomic(runner, t), self._mass(runner), q)
            q, v = runner.project(q, v, t)
            _, _, phi, rate = self._rows(runner, q, v, t)
            gap = float(np.abs(phi).max(initial=0.0))
            if gap > CLOSURE_TOLERANCE:
                q, _ = close_loops(self.model, self._holonomic(runner, t), self._mass(runner), q)
                q, v = runner.project(q, v, t)
                _, _, phi, rate = self._rows(runner, q, v, t)
                gap = float(np.abs(phi).max(initial=0.0))
        except core.CoreFailure as failure:
            raise self.failure(str(failure)) from None
        if not gap <= CLOSURE_TOLERANCE:
            gaps = {n: float(np.abs(phi[s]).max(initial=0.0)) for n, s in self.constraint_slices.items()}
            open_loops = {n: g for n, g in gaps.items() if not g <= CLOSURE_TOLERANCE}
            text = "; ".join(f'loop "{n}" does not close: gap {g:.2g}' for n, g in open_loops.items())
            raise LoopClosureError(
                f"{text} after several starts; check the lengths and frames, or start nearer", gaps=gaps, time=t
            )
        speed = 1.0 + float(np.abs(v).max(initial=0.0))
        if not float(np.abs(rate).max(initial=0.0)) <= 1e-6 * speed:
            worst = max(self.constraint_slices, key=lambda n: float(np.abs(rate[self.constraint_slices[n]]).max()))
            raise InconsistentConstraintsError(
                f'no velocity satisfies the constraints at t = {t:.2f} s: "{worst}" misses its rate by '
                f"{float(np.abs(rate).max()):.1e}",
                time=t,
            )
        return q, v

    def _holonomic(self, runner: Any, t: float) -> Any:
        zero = np.zeros(self.model.nv)
        nonholonomic = self._nonholonomic()

        def rows(q: Array) -> tuple[Array, Array]:
            A, _, phi, _ = self._rows(runner, q, zero, t)
            A[nonholonomic] = 0.0
            return A, phi

        return rows

    def _nonholonomic(self) -> Any:
        rows = np.zeros(max((s.stop for s in self.constraint_slices.values()), default=0), dtype=bool)
        for name, c in zip(self.constraint_slices, self.constraints, strict=False):
            s = self.constraint_slices[name]
            if isinstance(c, KnifeEdge) or (isinstance(c, UserConstraint) and c.residual is None):
                rows[s] = True
            elif isinstance(c, Rolling):
                rows[s.start : s.start + 2] = True
        return rows

    def _mass(self, runner: Any) -> Any:
        zero = np.zeros(self.model.nv)
        n = self.model.nv
        return lambda q: runner.terms(q, zero)[0].reshape(n, n)

    # --- one instant ------------------------------------------------------------------------------------------

    def solve(
        self, q: ArrayLike, v: ArrayLike, t: float = 0.0, *, tau: ArrayLike | None = None,
        modes: Sequence[int] | None = None,
    ) -> Solution:
        """Eq. (40) at one state: acceleration, both parts of the force of constraint, multipliers, modes.

        Args:
            q: configuration, (nq,).
            v: velocity, (nv,).
            t: time [s].
            tau: joint torques instead of the scene's actuation, (nv,).
            modes: mode of each frictional element, +1, -1 or 0; by velocity and complementarity when None.

        Returns:
            The Solution; `lam` holds all rows in the order of `constraint_slices`, zero for dropped ones.

        Raises:
            InputError: wrong shapes or numbers.
            InconsistentConstraintsError, FrictionParadoxError, SingularMassError: there is no solution.
        """
        if modes is not None:
            asked = np.asarray(modes)
            if asked.shape != (len(self.element_names),) or not np.isin(asked, (-1, 0, 1)).all():
                raise InputError(
                    f"modes must hold {len(self.element_names)} numbers out of -1, 0, 1; got {modes}"
                )
            modes = [int(m) for m in asked]
        out = self._call(self._runner.solve, q, v, t, tau, modes)
        return Solution(
            out["a"], out["F_ideal"], out["F_nonideal"], out["lam"], out["rank"],
            np.array(out["modes"], dtype=np.int8),
        )

    def acceleration(
        self, q: ArrayLike, v: ArrayLike, tau: ArrayLike | None = None, t: float = 0.0
    ) -> Array:
        """Just the acceleration, for loops of one's own.

        Args:
            q: configuration, (nq,).
            v: velocity, (nv,).
            tau: joint torques instead of the scene's actuation, (nv,).
            t: time [s].

        Returns:
            a, (nv,).

        Raises:
            InputError: wrong shapes or numbers.
            InconsistentConstraintsError, FrictionParadoxError, SingularMassError: there is no solution.
        """
        a = np.empty(self._nv)
        try:  # arrays of the right shape go straight to the core, which checks sizes, lengths and finiteness
            self._runner.acceleration(q, v, t, tau, a)
        except (TypeError, ValueError, core.CoreFailure):
            self._call(self._runner.acceleration, q, v, t, tau, a)
        return a

    def _call(self, function: Any, q: ArrayLike, v: ArrayLike, t: float, tau: ArrayLike | None, *rest: Any) -> Any:
        q_in, v_in = self._configuration(q, "q"), self._velocity(v, "v")
        torque = None if tau is None else np.array(array("tau", tau, (self.model.nv,)))
        try:
            return function(q_in, v_in, number("t", t), torque, *rest)
        except core.CoreFailure as failure:
            raise self.failure(str(failure)) from None

    def new_runner(self) -> Any:
        """A workspace of the core for one run."""
        return self._builder.runner()

    def roll_out(self, q: Array, v: Array, options: dict[str, Any], threads: int) -> Any:
        """Runs of many states in native threads, as the core returns them.

        Args:
            q: configurations, (n, nq).
            v: velocities, (n, nv).
            options: of the runs.
            threads: number of threads.
        """
        return core.rollout(self._builder, q, v, self.z0, options, threads)

    # --- words ------------------------------------------------------------------------------------------------

    def failure(self, text: str) -> RunError:
        """The core's failure as the exception that names what is to blame.

        Args:
            text: kind, time, value and indices, as the core wrote them.
        """
        kind, time_text, value_text, *rest = text.split()
        t, value, items = float(time_text), float(value_text), [int(x) for x in rest]
        names = list(self._lowered.blocks)
        if kind == "0":
            return self._singular(items[0], t)
        if kind == "1":
            blamed = [names[i] if i < len(names) else self.element_names[i - len(names)] for i in items]
            quoted = " and ".join(f'"{n}"' for n in blamed)
            blame = f"constraints {quoted} contradict each other" if len(blamed) > 1 else (
                f"constraint {quoted} contradicts itself"
            )
            return InconsistentConstraintsError(
                f"{blame}: residual {abs(value):.1e} m/s^2 at t = {t:.2f} s", time=t
            )
        if kind == "2":
            return NonFiniteError(f"acceleration is not finite at t = {t:.4g} s", time=t)
        if kind == "3":
            element = ", ".join(self.element_names[i] for i in items) or ", ".join(self.law_names)
            return FrictionParadoxError(
                f'friction of "{element}" has no solution or several at t = {t:.4g} s: '
                f"det(I - d lam'/d lam) = {value:.3g}; reduce mu, or use reaction=\"ideal\"",
                element=element, determinant=value, time=t,
            )
        if kind == "5":
            return StepSizeError(
                f"the step size fell below rounding at t = {t:.6g} s: the motion is singular there, or stiff; look at "
                'the last samples, loosen rtol and atol, or use "Radau"',
                time=t,
            )
        return RunError(f"the run failed at t = {t:.6g} s", time=t)

    def _singular(self, dof: int, t: float) -> SingularMassError:
        joint = next(i for i, j in enumerate(self.model.joints) if i and j.idx_v <= dof < j.idx_v + j.nv)
        bodies = [f.name for f in self.model.frames if f.parentJoint == joint and f.type == pin.FrameType.BODY]
        links = ", ".join(f'"{b}"' for b in bodies) or "its body"
        return SingularMassError(
            f'the mass matrix must be positive definite; it is singular at joint "{self.model.names[joint]}" '
            f"(t = {t:.4g} s): give {links} mass and inertia, or the joint an armature",
            time=t,
        )

    def report(self) -> str:
        """What the scene is made of: joints, constraints, rows, rank, mobility, and what was left out."""
        model = self.model
        q, v = self.initial_state()
        self._runner.solve(q, v, 0.0, None, [1] * len(self.element_names))
        rank = self._runner.rank
        rows = max((s.stop for s in self.constraint_slices.values()), default=0)
        lines = [f"{self.name}: {model.njoints - 1} joints, nq {model.nq}, nv {model.nv}"]
        for i in range(1, model.njoints):
            j = model.joints[i]
            kind = j.shortname().removeprefix("JointModel")
            lines.append(f"  joint {model.names[i]}: {kind}, on {model.names[model.parents[i]]}")
        for name, s in self.constraint_slices.items():
            lines.append(f"  constraint {name}: {s.stop - s.start} rows")
        for name in self.law_names:
            lines.append(f"  law {name}")
        lines.append(f"rows {rows}, rank {rank}, mobility {model.nv - rank}")
        for name, row, reason in self.dropped:
            lines.append(f"  left out: row {row} of {name}: {reason}")
        if rows - len(self.dropped) > rank:
            lines.append(f"  redundant: {rows - len(self.dropped) - rank} further rows, decided at every step")
        lines.append("skipped: " + (", ".join(self._skipped()) or "nothing"))
        lines += [f"note: {n}" for n in self.notes]
        for key in ("source", "licence"):
            if getattr(self, key):
                lines.append(f"{key}: {getattr(self, key)}")
        return "\n".join(lines)

    def _skipped(self) -> list[str]:
        skipped = []
        if not self.constraint_slices:
            skipped.append("rows and their factorization (no constraint)")
        if not self.law_names:
            skipped.append("laws C (none)")
        depends = any(isinstance(law, JointFriction) and law.mu for law in self.laws)
        depends |= any(getattr(law, "reaction", None) for law in self.laws if not isinstance(law, JointFriction))
        if not depends and not any(c.mu for c in self.contacts):
            skipped.append("reactions (no law reads them)")
        if not self.forces and self.actuation is None:
            skipped.append("given forces (none)")
        return skipped

