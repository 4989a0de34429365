"""From descriptions to the compiled core: names become indices, user functions become checked ones."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from .actuation import HoldPosition, SampledControl, Table
from .checks import array, axis_triad, unit_axis
from .compiled import load_core
from .configurations import configuration
from .constraints import (
    Distance,
    FrameAnchor,
    HingeAnchor,
    JointCoupling,
    KnifeEdge,
    PointAnchor,
    PrescribedMotion,
    Rolling,
    UserConstraint,
)
from .contacts import PointContact
from .errors import InputError, RunError, UnknownNameError, UserFunctionError, nearest
from .forces import JointSpring, SpringDamper, UserForce, Wrench
from .laws import Drag, JointFriction, LuGre, SigmoidFriction, UserFriction, UserLaw
from .timefunctions import Constant, Polynomial, Sinusoid, Spline

Array = NDArray[np.float64]
Frame = tuple[int, list[float], list[float]]

core = load_core()

# A rational gear ratio with a larger denominator than this leaves the angle of endless joints undetermined.
LARGEST_GEAR = 64


@dataclass
class Lowered:
    """A scene as the core knows it.

    Attributes:
        builder: the core's program under construction.
        slices: rows of `lam` of each constraint and contact, by name.
        blocks: the core's block of each constraint and contact, by name.
        anchors: (name, frame id 1, frame id 2 or None for the world) of what joins two frames.
        friction_names: names of the frictional elements, in the core's order.
        law_names: names of the laws, in the core's order (columns of the ledger).
        opaque: blocks whose rows a few samples do not show, given by Python functions or functions of time.
        unprojected: names of user constraints without residual and rate.
        z0: initial states of laws.
    """

    builder: Any
    slices: dict[str, slice] = field(default_factory=dict)
    blocks: dict[str, int] = field(default_factory=dict)
    anchors: list[tuple[str, int, int | None]] = field(default_factory=list)
    friction_names: list[str] = field(default_factory=list)
    law_names: list[str] = field(default_factory=list)
    opaque: set[int] = field(default_factory=set)
    unprojected: list[str] = field(default_factory=list)
    z0: Array = field(default_factory=lambda: np.zeros(0))


@dataclass
class ReactionNames:
    """Names that a law may ask reactions for.

    Attributes:
        slices: rows of each constraint and contact.
        blocks: the core's block of each.
        joints: index of each joint.
    """

    slices: dict[str, slice]
    blocks: dict[str, int]
    joints: dict[str, int]


class Reactions:
    """What the constraints exert at the instant of a law's call; valid during the call only.

    Attributes:
        lam: multipliers of all rows, in the order and scale of the descriptions, (m,).
    """

    def __init__(self, view: Any, names: ReactionNames) -> None:
        self._view, self._names = view, names

    @property
    def lam(self) -> Array:
        """Multipliers of all rows, (m,)."""
        result: Array = self._view.lam
        return result

    def __getitem__(self, name: str) -> Array:
        """Multipliers of one constraint or contact.

        Args:
            name: its name.

        Raises:
            UnknownNameError: no constraint has that name.
        """
        slices = self._names.slices
        if name not in slices:
            raise UnknownNameError(f'no constraint "{name}" in this scene{nearest(name, slices)}')
        return self.lam[slices[name]]

    def wrench(self, name: str) -> Array:
        """[force; moment] that a joint or an anchor exerts, (6,) [N; N m].

        A joint's is what it exerts on the body that it moves, in the joint frame's axes, about its origin; an
        anchor's is what it exerts on the body of frame1, in the axes of frame2.

        Args:
            name: of a joint of the model, or of a constraint.

        Raises:
            UnknownNameError: there is no such joint or constraint.
        """
        known = self._names
        if name in known.blocks:
            result: Array = self._view.of_block(known.blocks[name])
            return result
        if name in known.joints:
            result = self._view.of_joint(known.joints[name])
            return result
        raise UnknownNameError(f'no joint or constraint "{name}" in this scene{nearest(name, [*known.blocks, *known.joints])}')


def checked(function: Callable[..., Any], who: str, *shapes: tuple[int, ...]) -> Callable[..., Any]:
    """The user's function with its result made contiguous, and errors that name it.

    Args:
        function: what the user passed.
        who: words for messages.
        shapes: shape of its result, or of each part of a tuple of results.
    """

    def call(*arguments: Any) -> Any:
        try:
            value = function(*arguments)
        except RunError:
            raise
        except Exception as error:
            raise UserFunctionError(f"{who} raised {type(error).__name__}: {error}") from error
        parts = (value,) if len(shapes) == 1 else value
        if not isinstance(parts, (tuple, list)) or len(parts) != len(shapes):
            raise UserFunctionError(f"{who} must return {len(shapes)} values; got {type(value).__name__}")
        results = []
        for part, shape in zip(parts, shapes, strict=True):
            try:
                result = np.array(part, dtype=float, order="C")
            except (TypeError, ValueError):
                raise UserFunctionError(f"{who} must return numbers of shape {shape}; got {part!r}") from None
            if result.shape != shape and result.size == math.prod(shape):
                result = result.reshape(shape)
            if result.shape != shape:
                raise UserFunctionError(f"{who} must return shape {shape}; got shape {result.shape}")
            if not np.isfinite(result).all():
                raise UserFunctionError(f"{who} must return finite numbers; got {result}")
            results.append(result)
        return results[0] if len(shapes) == 1 else tuple(results)

    return call


class Lowering:
    """Writes one scene into the core's builder.

    Args:
        model: pinocchio.Model.
        q0: configuration at which `frame2=None` and lengths left out are read, (nq,).
    """

    def __init__(self, model: Any, q0: Array) -> None:
        self.model = model
        self.q0 = q0
        data = model.createData()
        pin.framesForwardKinematics(model, data, q0)
        self.data = data
        try:
            self.out = Lowered(core.Builder(model))
        except ValueError as error:
            raise InputError(str(error)) from None
        self._rows = 0
        joints = {name: i for i, name in enumerate(model.names) if i}
        self._reaction_names = ReactionNames(self.out.slices, self.out.blocks, joints)

    # --- names ------------------------------------------------------------------------------------------------

    def frame_id(self, name: str, who: str) -> int:
        """Index of a frame, or of the frame of a joint."""
        if self.model.existFrame(name):
            return int(self.model.getFrameId(name))
        names = [f.name for f in self.model.frames]
        raise UnknownNameError(f'{who}: no frame "{name}" in model "{self.model.name}"{nearest(name, names)}')

    def frame(self, name: str, who: str) -> Frame:
        """A frame as the core takes it: joint, orientation by rows, place."""
        if not self.model.existFrame(name) and self.model.existJointName(name):
            return (int(self.model.getJointId(name)), np.eye(3).ravel().tolist(), [0.0, 0.0, 0.0])
        frame = self.model.frames[self.frame_id(name, who)]
        placement = frame.placement
        return (int(frame.parentJoint), placement.rotation.ravel().tolist(), placement.translation.tolist())

    def placed(self, frame: Frame) -> pin.SE3:
        """Where a frame is in the world at q0."""
        joint, R, p = frame
        return self.data.oMi[joint] * pin.SE3(np.reshape(R, (3, 3)), np.array(p))

    def joint(self, name: str, who: str, *, freedoms: tuple[int, ...] = (1,)) -> int:
        """Index of a joint with an allowed number of degrees of freedom."""
        model = self.model
        if not model.existJointName(name) or name == "universe":
            if model.existFrame(name, pin.FrameType.FIXED_JOINT):
                raise InputError(f'{who}: joint "{name}" is fixed (locked) and cannot move; unlock it or leave it out')
            raise UnknownNameError(
                f'{who}: no joint "{name}" in model "{model.name}"{nearest(name, list(model.names)[1:])}'
            )
        index = int(model.getJointId(name))
        if model.joints[index].nv not in freedoms:
            degrees = "1 degree" if freedoms == (1,) else f"{' or '.join(map(str, freedoms))} degrees"
            raise InputError(
                f'{who}: joint "{name}" must have {degrees} of freedom; '
                f"it has {model.joints[index].nv}"
            )
        return index

    def pair(self, description: Any, who: str) -> tuple[Frame, Frame]:
        """Both frames of an anchor.  The world stands in for a missing second frame, in world axes."""
        first = self.frame(description.frame1, who)
        if description.frame2 is not None:
            return first, self.frame(description.frame2, who)
        here = self.placed(first)
        joint, R, p = first
        level = np.reshape(R, (3, 3)) @ here.rotation.T  # equals the world's axes at q0
        return (joint, level.ravel().tolist(), p), (0, np.eye(3).ravel().tolist(), here.translation.tolist())

    def _place(self, description: Any, frame2: str | None) -> tuple[Frame, Frame]:
        """Frame on a plane: the plane's frame, or the world's origin."""
        name = description.frame
        who = _who(description)
        plane = self.frame(frame2, who) if frame2 is not None else (0, np.eye(3).ravel().tolist(), [0.0] * 3)
        return self.frame(name, who), plane

    def _add(self, name: str, block: int, rows: int, frames: tuple[str, str | None] | None = None) -> None:
        self.out.blocks[name] = block
        self.out.slices[name] = slice(self._rows, self._rows + rows)
        self._rows += rows
        if frames is not None:
            try:
                ids = (self.frame_id(frames[0], ""), None if frames[1] is None else self.frame_id(frames[1], ""))
            except UnknownNameError:
                return
            self.out.anchors.append((name, *ids))

    # --- constraints ------------------------------------------------------------------------------------------

    def constraint(self, c: Any, name: str) -> None:
        """One constraint description.

        Args:
            c: the description, or a constraint model of Pinocchio.
            name: its unique name.

        Raises:
            InputError, UnknownNameError: what it refers to does not exist or does not fit.
        """
        add = self.out.builder
        who = _who(c, name)
        if isinstance(c, PointAnchor):
            f1, f2 = self.pair(c, who)
            axes = ["xyz".index(a) for a in c.axes]
            self._add(name, add.add_point(name, f1, f2, axes), len(axes), (c.frame1, c.frame2))
        elif isinstance(c, FrameAnchor):
            f1, f2 = self.pair(c, who)
            self._add(name, add.add_frame(name, f1, f2), 6, (c.frame1, c.frame2))
        elif isinstance(c, HingeAnchor):
            f1, f2 = self.pair(c, who)
            axis = self.hinge_axis(c, who)
            t1, t2, u = axis_triad(axis)
            normal1 = [-x for x in t2]
            self._add(name, add.add_hinge(name, f1, f2, u, normal1, t1), 5, (c.frame1, c.frame2))
        elif isinstance(c, Distance):
            self._distance(c, name, who)
        elif isinstance(c, JointCoupling):
            self._coupling(c, name, who)
        elif isinstance(c, PrescribedMotion):
            joint = self.joint(c.joint, who)
            period = 2.0 * math.pi if self.model.joints[joint].nq == 2 else 0.0
            block = add.add_motion(name, joint, time_function(c.function, who), period)
            self.out.opaque.add(block)
            self._add(name, block, 1)
        elif isinstance(c, KnifeEdge):
            self._add(name, add.add_knife(name, self.frame(c.frame, who), list(unit_axis(who, c.axis))), 1)
        elif isinstance(c, Rolling):
            f1, f2 = self._place(c, c.plane)
            t1, t2, n = axis_triad(unit_axis(who, c.normal))
            axle = [0.0, 0.0, 1.0] if c.axis is None else list(unit_axis(who, c.axis))
            block = add.add_rolling(name, f1, f2, c.radius, c.axis is None, axle, t1, t2, n)
            self._add(name, block, 3)
        elif isinstance(c, UserConstraint):
            self._user_constraint(c, name, who)
        else:
            self._pinocchio(c, name)

    def hinge_axis(self, c: HingeAnchor, who: str) -> tuple[float, float, float]:
        """The hinge's axis in the axes of frame2 (of the world without one)."""
        axis = unit_axis(who, c.axis)
        if c.frame2 is not None:
            return axis
        x, y, z = (float(x) for x in self.placed(self.frame(c.frame1, who)).rotation @ np.array(axis))
        return (x, y, z)

    def _distance(self, c: Distance, name: str, who: str) -> None:
        f1, f2 = self.pair(c, who)
        length = c.length
        if length is None:
            gap = float(np.linalg.norm(self.placed(f1).translation - self.placed(f2).translation))
            if gap == 0.0:
                raise InputError(f"{who}: the frames start at the same place; a distance must be positive")
            length = Constant(gap)
        elif not callable(length):
            length = Constant(length)
        block = self.out.builder.add_distance(name, f1, f2, time_function(length, who))
        if not isinstance(length, Constant):
            self.out.opaque.add(block)
        self._add(name, block, 1, (c.frame1, c.frame2))

    def _coupling(self, c: JointCoupling, name: str, who: str) -> None:
        j1, j2 = self.joint(c.joint1, who), self.joint(c.joint2, who)
        endless = [self.model.joints[j].nq == 2 for j in (j1, j2)]
        period, position = 0.0, True
        turn = 2.0 * math.pi
        if endless[0] and endless[1]:
            gear = Fraction(c.ratio).limit_denominator(LARGEST_GEAR)
            position = abs(float(gear) - c.ratio) < 1e-12
            period = turn / gear.denominator
        elif endless[0]:
            period = turn
        elif endless[1]:
            period = turn * abs(c.ratio)
        block = self.out.builder.add_coupling(name, j1, j2, c.ratio, c.offset, period, position)
        self._add(name, block, 1)

    def _user_constraint(self, c: UserConstraint, name: str, who: str) -> None:
        model, size = self.model, c.size
        function = checked(c.function, f"{who}: function", (size, model.nv), (size,))
        local = threading.local()

        def rows(t: float, q: Array, v: Array) -> Any:
            if not hasattr(local, "data"):
                local.data = model.createData()
            data = local.data
            pin.forwardKinematics(model, data, q, v, np.zeros(model.nv))
            pin.computeJointJacobians(model, data)
            pin.updateFramePlacements(model, data)
            return function(t, q, v, data)

        residual = None if c.residual is None else checked(c.residual, f"{who}: residual", (size,))
        rate = None if c.rate is None else checked(c.rate, f"{who}: rate", (size,))
        if residual is not None and rate is None:
            held = residual

            def rate(t: float, q: Array, v: Array) -> Array:
                step = 1e-6 * max(1.0, abs(t))
                moving = (held(t + step, q) - held(t - step, q)) / (2.0 * step)
                result: Array = rows(t, q, v)[0] @ v + moving
                return result

        if residual is None and rate is None:
            self.out.unprojected.append(name)
        block = self.out.builder.add_user(name, size, rows, residual, rate)
        self.out.opaque.add(block)
        self._add(name, block, size)

    def _pinocchio(self, c: Any, name: str) -> None:
        kind = type(c).__name__
        known = ("RigidConstraintModel", "PointAnchorConstraintModel", "FrameAnchorConstraintModel")
        if kind not in known:
            raise InputError(
                f"a constraint must be one of this package's or of Pinocchio's {', '.join(known)}; got {c!r}"
            )
        f1, f2 = (
            (int(joint), placement.rotation.ravel().tolist(), placement.translation.tolist())
            for joint, placement in ((c.joint1_id, c.joint1_placement), (c.joint2_id, c.joint2_placement))
        )
        if kind == "PointAnchorConstraintModel" or (
            kind == "RigidConstraintModel" and c.type == pin.ContactType.CONTACT_3D
        ):
            self._add(name, self.out.builder.add_point(name, f1, f2, [0, 1, 2]), 3)
        else:
            self._add(name, self.out.builder.add_frame(name, f1, f2), 6)

    # --- contacts and laws ------------------------------------------------------------------------------------

    def contact(self, c: PointContact, name: str) -> None:
        """The normal row of a contact; its friction follows all rows (`contact_friction`)."""
        f1, f2, _, _, n = self._contact_frames(c)
        block = self.out.builder.add_contact(name, f1, f2, list(n), c.radius)
        self._add(name, block, 1)

    def _contact_frames(self, c: PointContact) -> Any:
        f1, f2 = self._place(c, c.plane)
        return (f1, f2, *axis_triad(unit_axis(_who(c), c.normal)))

    def contact_friction(self, c: PointContact, name: str) -> None:
        """Coulomb friction along the plane of a contact."""
        if c.mu == 0.0:
            return
        f1, f2, t1, t2, n = self._contact_frames(c)
        law = self._law(name)
        block = self.out.builder.add_contact_slip(name, f1, f2, c.radius, t1, t2, n)
        numbers = _numbers(mu=c.mu, static_ratio=c.static_ratio)
        anchor = self.out.blocks[name]
        self.out.builder.add_friction(name, law, block, "contact", "total", -1, anchor, [0.0, 0.0, 1.0], numbers, None)
        self.out.friction_names.append(name)

    def _law(self, name: str) -> int:
        self.out.law_names.append(name)
        return int(self.out.builder.add_law(name))

    def law(self, law: Any, name: str, constraints: dict[str, Any]) -> None:
        """One law description.

        Args:
            law: the description.
            name: its unique name.
            constraints: descriptions of the constraints by name.

        Raises:
            InputError, UnknownNameError: what it refers to does not exist or does not fit.
        """
        add = self.out.builder
        who = _who(law, name)
        nv, names = self.model.nv, self._reaction_names
        if isinstance(law, JointFriction):
            if law.joint in constraints and not self.model.existJointName(law.joint):
                self._anchor_friction(law, name, constraints[law.joint], who)
            else:
                self._joint_friction(law, name, constraints, who)
        elif isinstance(law, SigmoidFriction):
            dof = self.model.joints[self.rubbing_joint(law.joint, who, constraints)].idx_v
            add.add_sigmoid(self._law(name), dof, law.phi1, law.phi2, law.phi3)
        elif isinstance(law, LuGre):
            dof = self.model.joints[self.rubbing_joint(law.joint, who, constraints)].idx_v
            numbers = (law.stiffness, law.damping, law.viscous, law.coulomb, law.stiction, law.stribeck_velocity)
            add.add_bristle(self._law(name), dof, *numbers)
            self.out.z0 = np.concatenate([self.out.z0, np.zeros(1)])
        elif isinstance(law, Drag):
            add.add_drag(self._law(name), self.frame(law.frame, who), law.coefficient, law.exponent)
        elif isinstance(law, UserLaw):
            shapes = ((nv,), (law.states,)) if law.states else ((nv,),)
            function = checked(law.function, f"{who}: function", *shapes)

            def call(t: float, q: Array, v: Array, view: Any, *z: Array) -> Any:
                return function(t, q, v, None if view is None else Reactions(view, names), *z)

            add.add_user_law(self._law(name), law.states, law.reaction or "none", call)
            self.out.z0 = np.concatenate([self.out.z0, np.zeros(law.states)])
        elif isinstance(law, UserFriction):
            direction = checked(law.direction, f"{who}: direction", (nv,))
            limit = checked(law.limit, f"{who}: limit", ())

            def bound(t: float, q: Array, v: Array, view: Any) -> float:
                value = float(limit(t, q, v, Reactions(view, names)))
                if value < 0.0:
                    raise UserFunctionError(f"{who}: limit must not be negative; got {value:g}")
                return value

            block = add.add_user_slip(name, direction)
            add.add_friction(name, self._law(name), block, "user", "total", -1, -1, [0.0, 0.0, 1.0], _numbers(), bound)
            self.out.friction_names.append(name)
        else:
            raise InputError(f"a law must be JointFriction, SigmoidFriction, LuGre, Drag, UserLaw or UserFriction; got {law!r}")

    def rubbing_joint(
        self, name: str, who: str, constraints: dict[str, Any], *, freedoms: tuple[int, ...] = (1,)
    ) -> int:
        """Index of a joint that a friction law may act on: one that moves, and is no mimic joint."""
        joint = self.joint(name, who, freedoms=freedoms)
        for c in constraints.values():
            if isinstance(c, JointCoupling) and c.joint1 == name and (c.name or "").endswith("mimic"):
                raise InputError(
                    f'{who}: joint "{name}" is a mimic joint, driven by "{c.joint2}"; '
                    f'put the friction on "{c.joint2}"'
                )
        return joint

    def _joint_friction(self, law: JointFriction, name: str, constraints: dict[str, Any], who: str) -> None:
        if not self.model.existJointName(law.joint) and constraints:
            known = [*list(self.model.names)[1:], *constraints]
            if not self.model.existFrame(law.joint, pin.FrameType.FIXED_JOINT):
                raise UnknownNameError(f'{who}: no joint or anchor "{law.joint}"{nearest(law.joint, known)}')
        joint = self.rubbing_joint(law.joint, who, constraints, freedoms=(1, 3))
        kind, axis = joint_kind(self.model, joint)
        if kind is None:
            raise InputError(
                f'{who}: joint "{law.joint}" must be revolute, prismatic, helical or spherical; '
                f"it is {self.model.joints[joint].shortname()}"
            )
        _check_radius(law, who, kind)
        dof, count = self.model.joints[joint].idx_v, self.model.joints[joint].nv
        index = self._law(name)
        if law.viscous:
            self.out.builder.add_viscous(index, dof, count, -1, law.viscous)
        if law.coulomb or law.preload or law.mu:
            block = self.out.builder.add_dof_slip(name, dof, count)
            self._friction(law, name, index, block, kind, joint, -1, axis)

    def _anchor_friction(self, law: JointFriction, name: str, anchor: Any, who: str) -> None:
        if not isinstance(anchor, HingeAnchor):
            raise InputError(
                f'{who}: "{law.joint}" is a {type(anchor).__name__}, which has no axis to rub about; '
                "use a HingeAnchor"
            )
        _check_radius(law, who, "revolute")
        f1, f2 = self.pair(anchor, who)
        axis = list(self.hinge_axis(anchor, who))
        block = self.out.builder.add_hinge_slip(name, f1, f2, axis)
        index = self._law(name)
        if law.viscous:
            self.out.builder.add_viscous(index, -1, 1, block, law.viscous)
        if law.coulomb or law.preload or law.mu:
            self._friction(law, name, index, block, "revolute", -1, self.out.blocks[law.joint], axis)

    def _friction(
        self, law: JointFriction, name: str, index: int, block: int, kind: str, joint: int, anchor: int, axis: Any
    ) -> None:
        numbers = _numbers(
            constant=law.coulomb + law.preload,
            mu=law.mu,
            radius=law.radius,
            axial_radius=law.axial_radius,
            inverse_span=0.0 if law.span is None else 1.0 / law.span,
            static_ratio=law.static_ratio,
            stribeck_velocity=law.stribeck_velocity or 0.0,
        )
        load, reaction = (kind, law.reaction) if law.mu else ("none", "none")
        axis = [float(x) for x in axis]
        self.out.builder.add_friction(name, index, block, load, reaction, joint, anchor, axis, numbers, None)
        self.out.friction_names.append(name)

    # --- forces and actuation ---------------------------------------------------------------------------------

    def force(self, f: Any) -> None:
        """One given force.

        Args:
            f: the description.

        Raises:
            InputError, UnknownNameError: what it refers to does not exist or does not fit.
        """
        add = self.out.builder
        who = _who(f)
        if isinstance(f, SpringDamper):
            add.add_spring_damper(*self.pair(f, who), f.stiffness, f.damping, f.rest_length)
        elif isinstance(f, JointSpring):
            add.add_joint_spring(self.joint(f.joint, who), f.stiffness, f.rest, f.damping)
        elif isinstance(f, Wrench):
            frame = self.frame(f.frame, who)
            if callable(f.value):
                add.add_wrench(frame, [0.0] * 6, checked(f.value, f"{who}: value", (6,)))
            else:
                add.add_wrench(frame, list(f.value), None)
        elif isinstance(f, UserForce):
            add.add_user_force(checked(f.function, f"{who}: function", (self.model.nv,)))
        else:
            raise InputError(f"a force must be SpringDamper, JointSpring, Wrench or UserForce; got {f!r}")

    def actuation(self, u: Any) -> None:
        """The torques that drive the scene.

        Args:
            u: None, an array (nv,), a function, or a description.

        Raises:
            InputError: shapes do not fit the model.
        """
        add, nv = self.out.builder, self.model.nv
        if u is None:
            return
        if isinstance(u, SampledControl):
            add.set_sampled_torque(checked(u.function, f"{_who(u)}: function", (nv,)), u.period)
        elif isinstance(u, HoldPosition):
            q = self.q0 if u.q is None else configuration(self.model, u.q, f"{_who(u)}: q")
            add.set_hold_position(self.gains(u, "kp"), self.gains(u, "kd"), np.ascontiguousarray(q))
        elif isinstance(u, Table):
            times, values = np.asarray(u.times), np.asarray(u.values)
            if values.shape[1] != nv:
                raise InputError(f"{_who(u)}: values must have {nv} columns (nv); got {values.shape[1]}")
            add.set_torque_table(times.tolist(), np.ascontiguousarray(values))
        elif callable(u):
            add.set_torque_function(checked(u, "actuation", (nv,)))
        else:
            add.set_constant_torque(np.ascontiguousarray(array("actuation", u, (nv,))))

    def gains(self, u: HoldPosition, key: str) -> Array:
        """A gain for every degree of freedom; a number acts on joints of one degree of freedom."""
        gain, who = getattr(u, key), f"{_who(u)}: {key}"
        single = np.zeros(self.model.nv)
        for joint in list(self.model.joints)[1:]:
            if joint.nv == 1:
                single[joint.idx_v] = 1.0
        if np.ndim(gain) == 0:
            return single * float(gain)
        full = array(who, gain, (self.model.nv,)).copy()
        if key == "kp":
            for index, joint in enumerate(self.model.joints):
                part = full[joint.idx_v : joint.idx_v + joint.nv] if index else full[:0]
                if joint.nq != joint.nv and joint.nv > 1 and (part != 0.0).any():
                    raise InputError(
                        f'{who} must be zero on joint "{self.model.names[index]}", whose configuration is no '
                        "vector; drive it by a function"
                    )
        return full


def _check_radius(law: JointFriction, who: str, kind: str) -> None:
    """A coefficient without a radius would be no friction at all."""
    radii = {"revolute": ("radius", "axial_radius"), "spherical": ("radius",)}.get(kind, ())
    if law.mu and radii and not any(getattr(law, key) for key in radii):
        raise InputError(
            f"{who}: mu needs a positive {' or '.join(radii)} on a joint that turns, for torque = mu radius force"
        )


def joint_kind(model: Any, joint: int) -> tuple[str | None, Array]:
    """Kind of a joint for friction, and its axis in the joint's frame.

    Args:
        model: pinocchio.Model.
        joint: index.
    """
    item = model.joints[joint]
    data = item.createData()
    item.calc(data, pin.neutral(model), np.zeros(model.nv))
    S = np.asarray(data.S).reshape(6, -1)
    if item.nv == 3:
        spherical = "Spherical" in item.shortname() and "ZYX" not in item.shortname()
        return ("spherical" if spherical else None), np.array([0.0, 0.0, 1.0])
    if item.nv != 1 or "Composite" in item.shortname():
        return None, np.array([0.0, 0.0, 1.0])
    lin, ang = S[:3, 0], S[3:, 0]
    if np.linalg.norm(ang) > 0.5:
        return "revolute", ang / np.linalg.norm(ang)
    return "prismatic", lin / np.linalg.norm(lin)


def time_function(function: Any, who: str) -> Any:
    """A function of time as numbers for the core, or checked when it is the user's."""
    if isinstance(function, Constant):
        return ("polynomial", [function.value])
    if isinstance(function, Polynomial):
        return ("polynomial", list(function.coefficients))
    if isinstance(function, Sinusoid):
        return ("sinusoid", [function.amplitude, function.frequency, function.phase, function.offset])
    if isinstance(function, Spline):
        return ("spline", function.breaks.tolist(), function.coefficients.ravel().tolist())
    jet = checked(function, f"{who}: function of time", (), (), ())
    return lambda t: tuple(float(x) for x in jet(t))


def unique_names(descriptions: Sequence[Any], taken: set[str]) -> list[str]:
    """A name for each description: its own, or its kind and what it acts on.

    Args:
        descriptions: constraints, laws or contacts.
        taken: names in use; grows.

    Raises:
        InputError: two descriptions were given the same name.
    """
    names = []
    for d in descriptions:
        own = getattr(d, "name", None)
        if own:
            if own in taken:
                raise InputError(f'names must be unique in a scene; "{own}" is used twice')
            name = str(own)
        else:
            keys = ("frame1", "frame2", "joint1", "joint2", "joint", "frame")
            parts = [str(getattr(d, k)) for k in keys if getattr(d, k, None) is not None]
            base = name = type(d).__name__ + (f"({', '.join(parts)})" if parts else "")
            count = 1
            while name in taken:
                count += 1
                name = f"{base} #{count}"
        taken.add(name)
        names.append(name)
    return names


def _who(description: Any, name: str | None = None) -> str:
    own = getattr(description, "name", None) or name
    kind = type(description).__name__
    return f'{kind} "{own}"' if own and not str(own).startswith(kind) else str(own or kind)


def _numbers(**given: float) -> dict[str, float]:
    numbers = {
        "constant": 0.0,
        "mu": 0.0,
        "radius": 0.0,
        "axial_radius": 0.0,
        "inverse_span": 0.0,
        "static_ratio": 1.0,
        "stribeck_velocity": 0.0,
    }
    numbers.update(given)
    return numbers
