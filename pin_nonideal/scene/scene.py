"""Scene: a model with constraints, contacts, laws, forces and actuation, compiled once for the core."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, overload

import pinocchio as pin
from numpy.typing import ArrayLike

from pin_nonideal.compilation.report import report
from pin_nonideal.compilation.summary import Description, describe
from pin_nonideal.equation import Solution
from pin_nonideal.errors import InputError, short_repr
from pin_nonideal.states.report import ProjectionReport
from pin_nonideal.types import Array, State
from pin_nonideal.validation import choice, number

from .base import compiled_scene, scene_origin, scene_states, with_origin
from .editable import EditableScene
from .stepping import Stepper
from .text import html_summary, notes_of

__all__ = ["Scene", "compiled_scene", "scene_origin", "scene_states", "with_origin"]


class Scene(EditableScene):
    """A Pinocchio model with constraints, laws, contacts, forces and actuation.

    The constructor checks all descriptions and removes rows that can never act.

    Args:
        model: pinocchio.Model.
        constraints: descriptions of `description.constraints`, or Pinocchio's RigidConstraintModel,
            PointAnchorConstraintModel and FrameAnchorConstraintModel.
        laws: descriptions of `description.laws`.
        contacts: descriptions of `description.contacts`, and `GeometryContact`s.
        forces: descriptions of `description.forces`.
        actuation: None, constant torques, (nv,) or by joint name, a function (t, q, v) -> tau, a description
            of `pin_nonideal.description.actuation`, or a list of such drives. The torques of a list add, and
            each joint is commanded by one drive: a drive by joint name commands the joints that it names, and
            other drives command all joints.
        q0: initial configuration; the neutral one when None. Anchors without a second frame hold their frame
            at its placement in q0. A configuration is an array (nq,), a table by joint name such
            as {"crank": 1.0, "base": {"xyz": [0, 0, 1], "rpy": [0, 0, 1.57]}}, or the name of a reference
            configuration. Joints missing in a table keep their neutral value, and in `solve`, `project` and
            `simulate` their value in the scene's initial state. Projection onto the constraints holds the
            entries of a table, and the other joints follow with the least displacement.
        v0: initial velocity, an array (nv,), or a table by joint name; zero when None. Entries of a table are
            held while the others follow the constraints.
        visual_model: pinocchio.GeometryModel for the replay, or a function that creates it on first access.
        collision_model: pinocchio.GeometryModel, or a function that creates it on first access.
        name: name in messages and pages; the model's name when None.
        notes: remarks of the loader, shown by `report`.
        source: origin of the robot.
        licence: licence of the robot.
        terms: provider of M(q), the bias forces and the kinematics: "core", the core's pass over the tree, or
            "pinocchio", Pinocchio's crba, nonLinearEffects and computeJointJacobians.
        impact: restitution law. "newton": a gap opens with e times the rate at which it closed. "poisson":
            after the impulse that stops the approach, a contact applies e times that impulse again. Without
            friction, both laws agree if all closing gaps have the same e.
        assembly_tolerance: accuracy of the frames of loops [m or rad]. A residual up to it is no error in a
            direction in which no joint moves.

    Raises:
        InputError, UnknownNameError: a description does not fit the model.
        InconsistentConstraintsError: a vanishing row has a nonzero right-hand side.

    Attributes:
        q0: initial configuration, (nq,), read-only: loops are closed and frames are held from it.
        v0: initial velocity, (nv,), read-only.
        constraint_slices: rows of `lam` of each constraint and contact, by name.
        anchor_frames: (name, frame id, frame id or None) of constraints between two frames.
        contact_names: names of the contacts, in the order of `closed`; each stop of a JointLimit is one.
        element_names: names of the friction elements, in the order of `modes`.
        law_names: names of the laws, in the order of the ledger's columns.
        dropped: (name, row, reason) of rows that can never act.
        contact_friction: sliding, spinning and rolling coefficients of the collision geometry in the robot's
            file, by name.
    """

    def __repr__(self) -> str:
        return (
            f'<Scene "{self.name}": nv {self.model.nv}, {len(self.constraints)} constraints, '
            f"{len(self.laws)} laws, {len(self.contacts)} contacts>"
        )

    def _repr_html_(self) -> str:
        return html_summary(self)

    # --- states ---------------------------------------------------------------------------------------------

    def initial_state(self) -> tuple[Array, Array]:
        """Return the scene's initial state with closed loops.

        Returns:
            q (nq,), v (nv,).

        Raises:
            LoopClosureError: the loops cannot be closed.
            InputError: a coordinate is too large to move.
        """
        q, v, _ = self._states.closed_initial()
        return q, v

    @overload
    def project(
        self,
        q: State | None = None,
        v: State | None = None,
        t: float = 0.0,
        *,
        report: Literal[False] = False,
    ) -> tuple[Array, Array]: ...
    @overload
    def project(
        self, q: State | None = None, v: State | None = None, t: float = 0.0, *, report: Literal[True]
    ) -> tuple[Array, Array, ProjectionReport]: ...
    def project(
        self, q: State | None = None, v: State | None = None, t: float = 0.0, *, report: bool = False
    ) -> tuple[Array, Array] | tuple[Array, Array, ProjectionReport]:
        """Project a state: phi(q, t) = 0, A v + phi_t = 0, and no penetration of contacts.

        The projected configuration minimizes d^T M(q) d for the displacement d from q in tangent coordinates.
        M(q) is the mass matrix at q. The projected velocity minimizes d^T M d for its change d. Units, row
        scales and duplicate constraints do not affect the result. If the displacement is long, the nearest
        closure from several starts is selected. `ProjectionReport.nearest` states if the search confirms it
        as nearest. Closures in gimbal lock (nearly singular M) are selected only if no other closure is
        found.

        Args:
            q: configuration, (nq,) or by joint name; the scene's initial configuration when None.
            v: velocity, (nv,) or by joint name; the scene's initial velocity when None. The projection holds
                named entries of q and v, and changes the other entries as little as possible. If the
                constraints do not admit the named entries of q, these are treated as rounded: they may move
                by 1e-3 rad, or by 1e-3 of the mechanism's length.
            t: time [s].
            report: whether to return a `ProjectionReport` as well, with the displacements of q and v.

        Returns:
            q (nq,), v (nv,), and with `report` the report.

        Raises:
            LoopClosureError: no closure is found from this state; `gaps` names each gap.
            InputError: wrong shapes or numbers, or named entries that the constraints do not admit together.
                Further causes are a contact with deep initial penetration or without a short displacement out
                of it, and a coordinate at which floating-point numbers are more than 1 mm or 1 mrad apart.
        """
        with_report = choice("report", report, (True, False))
        projected = self._states.project(q, v, number("t", t))
        return projected if with_report else projected[:2]

    # --- one instant ----------------------------------------------------------------------------------------

    def solve(
        self,
        q: State,
        v: State,
        t: float = 0.0,
        *,
        tau: ArrayLike | None = None,
        modes: Sequence[int] | None = None,
        several: str = "error",
    ) -> Solution:
        """Solve Eq. (40) at one state: acceleration, both parts of the constraint force, multipliers, modes.

        Args:
            q: configuration, (nq,) or by joint name.
            v: velocity, (nv,) or by joint name.
            t: time [s].
            tau: joint torques instead of the scene's actuation, (nv,) or by joint name.
            modes: mode of each friction element: +1 or -1 slips, 0 sticks, 2 is without friction, as in an
                open contact. The mode of a pair of shapes holds at all of its points. None determines the
                modes by velocity and complementarity.
            several: behavior if the laws admit several motions: "error", or "continue" with the motion of
                least friction. An element at rest that the laws allow to stick or to slip sticks in both
                cases.

        Returns:
            The Solution; `lam` holds all rows in the order of `constraint_slices`, and zero for rows that
            never act.

        Raises:
            InputError: wrong shapes or numbers.
            InconsistentConstraintsError, FrictionParadoxError, SingularMassError: there is no solution.
        """
        unilateral = any(getattr(contact, "unilateral", True) for contact in self.contacts)
        return self._evaluator.solve(q, v, t, tau, modes, several, unilateral)

    def acceleration(
        self,
        q: State,
        v: State,
        tau: ArrayLike | None = None,
        t: float = 0.0,
        *,
        several: str = "error",
    ) -> Array:
        """Return the acceleration alone, for user-written integration loops.

        Args:
            q: configuration, (nq,) or by joint name.
            v: velocity, (nv,) or by joint name.
            tau: joint torques instead of the scene's actuation, (nv,) or by joint name.
            t: time [s].
            several: "error" or "continue" if the laws admit several motions, as in `solve`.

        Returns:
            a, (nv,).

        Raises:
            InputError: wrong shapes or numbers.
            InconsistentConstraintsError, FrictionParadoxError, SingularMassError: there is no solution.
        """
        return self._evaluator.acceleration(q, v, tau, t, several)

    # --- terms ----------------------------------------------------------------------------------------------

    def describe(self) -> Description:
        """Return tables of joints, constraints, contacts, laws, forces and actuation.

        `str` formats the tables as text; `to_dict()` returns plain values.
        """
        return describe(self._compiled, self.name)

    def mass_matrix(self, q: State | None = None) -> Array:
        """Return the mass matrix M(q) of the tree, without constraints, (nv, nv).

        Args:
            q: configuration, (nq,) or by joint name; None for the scene's closed initial configuration.
        """
        return self._queries.mass_matrix(q)

    def bias_forces(self, q: State | None = None, v: State | None = None) -> Array:
        """Return Coriolis, centrifugal and gravity forces b of M a + b = tau, (nv,), as nonLinearEffects.

        Args:
            q: configuration, (nq,) or by joint name; None for the scene's closed initial configuration.
            v: velocity, (nv,) or by joint name; zero when None.
        """
        return self._queries.bias_forces(q, v)

    def jacobian(self, name: str, q: State | None = None, t: float = 0.0) -> Array:
        """Return rows A of one constraint or contact, A a = b, in the order and scale of `lam`, (rows, nv).

        Rows that can never act are included. A pair of shapes has a row for each contact point.

        Args:
            name: name of the constraint or contact.
            q: configuration, (nq,) or by joint name; None for the scene's closed initial configuration.
            t: time [s].

        Raises:
            UnknownNameError: no constraint or contact has that name.
        """
        return self._queries.jacobian(name, q, t)

    def energies(self, q: State | None = None, v: State | None = None) -> dict[str, float]:
        """Return energies by name [J]: "kinetic", "potential" (gravity, zero at the world's origin), "total".

        Spring energy is not included: a run's ledger counts it as work of applied forces.

        Args:
            q: configuration, (nq,) or by joint name; None for the scene's closed initial configuration.
            v: velocity, (nv,) or by joint name; zero when None.
        """
        return self._queries.energies(q, v)

    # --- steps ----------------------------------------------------------------------------------------------

    def step(
        self,
        q: State,
        v: State,
        tau: ArrayLike | None,
        dt: float,
        *,
        t: float = 0.0,
        method: str = "semi_implicit_euler",
    ) -> tuple[Array, Array]:
        """Take one step from any state, for controllers and learning loops.

        The result is the final state of `simulate(scene, dt, q, v, method=method, dt=dt)`, including friction
        and contact events inside the step.

        Args:
            q: configuration on the constraints, (nq,) or by joint name.
            v: velocity on the constraints, (nv,) or by joint name.
            tau: joint torques, (nv,) or by joint name [N m or N]; those of the scene's actuation when None.
            dt: length of the step [s].
            t: time at the start of the step [s].
            method: method of the core with a fixed step: "semi_implicit_euler", "rk4" or "moreau".

        Returns:
            q (nq,) and v (nv,) at the end of the step.

        Raises:
            InputError: an argument does not fit.
            RunError: the run stops inside the step.
        """
        return self._stepper.step(q, v, tau, dt, t, method)

    def stepper(
        self,
        period: float,
        q: State | None = None,
        v: State | None = None,
        *,
        t0: float = 0.0,
        tau: ArrayLike | None = None,
        method: str = "semi_implicit_euler",
        dt: float | None = None,
        rtol: float | None = None,
        atol: float | None = None,
    ) -> Stepper:
        """Return a run that advances period by period with user torques and keeps its state between calls.

        Args:
            period: duration of each call of `Stepper.step` [s].
            q: initial configuration, (nq,) or by joint name, projected onto the constraints; the scene's when
                None.
            v: initial velocity, (nv,) or by joint name; the scene's when None.
            t0: initial time [s].
            tau: joint torques that replace the scene's actuation from the start, (nv,), or None.
            method: method of the core, adaptive or with a fixed step.
            dt: step of fixed-step methods [s]; the period must be a multiple of it. None for the period.
            rtol: relative tolerance of adaptive methods, 1e-8 when None.
            atol: absolute tolerance, 1e-10 when None.

        Returns:
            The Stepper, at its initial state.

        Raises:
            InputError: an argument does not fit.
            RunError: no motion exists from the initial state.
        """
        return self._stepper.stepper(period, q, v, t0, tau, method, dt, rtol, atol)

    # --- text -----------------------------------------------------------------------------------------------

    def report(self) -> str:
        """Return a text with joints, constraints, rows, rank, mobility and removed rows of the scene."""
        rank = self._evaluator.rank(*self.initial_state())
        return report(self._compiled, self.name, rank, notes_of(self, self._states.start_notes()))


def require_scene(who: str, scene: object) -> None:
    """Check that an argument is a scene.

    Args:
        who: name of the function, for messages.
        scene: the argument.

    Raises:
        InputError: the argument is not a Scene; the message states how a name or a model becomes a scene.
    """
    if isinstance(scene, Scene):
        return
    remedy = f"; pass pn.load({short_repr(scene)})" if isinstance(scene, str) else ""
    remedy = "; pass pn.Scene(model)" if isinstance(scene, pin.Model) else remedy
    raise InputError(f"{who}: scene must be a Scene; got {type(scene).__name__}{remedy}")
