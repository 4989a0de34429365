"""Friction elements in the core's program: their sites, slip directions and loads."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import pinocchio as pin

from pin_nonideal.core_loader import core
from pin_nonideal.description.constraints import HingeAnchor, JointCoupling, PointAnchor, is_mimic
from pin_nonideal.description.laws import JointFriction
from pin_nonideal.errors import InputError, UnknownNameError, nearest
from pin_nonideal.states.rows import row_slices

from .callbacks import ReactionNames
from .constraints import frames_of
from .resolver import Resolver, words

# Constraint models of Pinocchio that can hold a point on a point.
BALLS = ("PointAnchorConstraintModel", "RigidConstraintModel")
# Parameters of JointFriction for bearings, and parameters for teeth and threads.
BEARING = ("radius", "axial_radius", "span")
TEETH = ("lead_angle", "efficiency")


class LoweringContext(NamedTuple):
    """Names of a scene that laws may use.

    Attributes:
        resolver: frames and joints by name.
        constraints: descriptions of the constraints by name.
        blocks: index of each constraint, and of the first block of each contact, among the core's blocks.
        reactions: function that returns the names by which user laws may access reactions.
    """

    resolver: Resolver
    constraints: dict[str, object]
    blocks: dict[str, int]
    reactions: Callable[[], ReactionNames]


# Limits below are zero, because their squares underflow [N m or N].
MIN_LIMIT = 1e-150


class FrictionSite(NamedTuple):
    """Slip directions of one friction element of a law, and its load.

    Attributes:
        load: kind of load that the friction limit follows.
        part: name of this part of the law; empty if the law has one part.
        dof: first degree of freedom of the slip directions, or -1.
        dofs: number of these degrees of freedom.
        block: core block of the slip directions if they are not degrees of freedom, else -1.
        joint: joint that carries the load, or -1.
        anchor: core block of the constraint that carries the load, or -1.
        row: row of the anchor whose multiplier is the load.
        axis: bearing axis, in the joint's frame or in frame 1 of the anchor.
        axis_dof: degree of freedom whose axis is the bearing axis, if no frame carries it; else -1.
        mu: ratio of limit to load; None for the coefficient of the law.
        lever: lever arm of a turning element [m]: torque over friction force, and sliding speed over rate.
    """

    load: core.Load
    part: str = ""
    dof: int = -1
    dofs: int = 0
    block: int = -1
    joint: int = -1
    anchor: int = -1
    row: int = 0
    axis: tuple[float, ...] = (0.0, 0.0, 1.0)
    axis_dof: int = -1
    mu: float | None = None
    lever: float = 1.0


def friction_joint(name: str, who: str, context: LoweringContext, *, freedoms: tuple[int, ...] = (1,)) -> int:
    """Return the index of a movable joint that is not a mimic joint, for a friction law.

    Args:
        name: name of the joint.
        who: prefix of error messages.
        context: names that the law may use.
        freedoms: numbers of degrees of freedom that the law supports.

    Raises:
        InputError, UnknownNameError: there is no such joint.
    """
    joint = context.resolver.joint(name, who, freedoms=freedoms)
    for c in context.constraints.values():
        if is_mimic(c) and c.joint1 == name:
            raise InputError(
                f'{who}: joint "{name}" is a mimic joint, driven by "{c.joint2}"; '
                f'put the friction on "{c.joint2}"'
            )
    return joint


def lower_joint_friction(law: JointFriction, name: str, out: core.Builder, context: LoweringContext) -> None:
    """Add friction of a joint of the tree, of an anchor or of a coupling.

    Args:
        law: the description.
        name: its unique name.
        out: the program under construction.
        context: names that the law may use.

    Raises:
        InputError, UnknownNameError: the joint does not exist, or a parameter does not apply to it.
    """
    who, model = words(law, name), context.resolver.model
    if model.existJointName(law.joint) or law.joint not in context.constraints:
        sites = _in_joint(law, who, context)
    else:
        sites = _in_constraint(law, name, out, context)
    index = out.add_law(name)
    for site in sites:
        _viscous(law, out, index, site)
        if law.coulomb or law.preload or law.mu or site.mu:
            _dry(law, name, out, index, site)


def _in_joint(law: JointFriction, who: str, context: LoweringContext) -> list[FrictionSite]:
    """Return the friction sites of a joint of the tree."""
    resolver = context.resolver
    model = resolver.model
    if not model.existJointName(law.joint) and context.constraints:
        known = [*list(model.names)[1:], *context.constraints]
        if not model.existFrame(law.joint, pin.FrameType.FIXED_JOINT):
            raise UnknownNameError(f'{who}: no joint or anchor "{law.joint}"{nearest(law.joint, known)}')
    joint = friction_joint(law.joint, who, context, freedoms=(1, 2, 3, 6))
    kind = model.joints[joint].shortname()
    dof, count = model.joints[joint].idx_v, model.joints[joint].nv
    _refuse(law, who, TEETH, f'a parameter of a JointCoupling, and joint "{law.joint}" is {kind}')
    if kind == "JointModelUniversal":
        _check_radius(law, who, core.Load.revolute)
        axes = [(f"axis {k + 1}", dof + k) for k in range(2)]
        return [FrictionSite(core.Load.revolute, p, d, 1, joint=joint, axis_dof=d) for p, d in axes]
    if kind in ("JointModelPlanar", "JointModelFreeFlyer", "JointModelTranslation"):
        return _sliding_and_turning(law, who, joint, kind, dof, count)
    load, axis = resolver.bearing(joint)
    if load is core.Load.none:
        raise InputError(
            f'{who}: joint "{law.joint}" must be revolute, prismatic, helical, spherical, universal, planar, '
            f"translation or free flyer; it is {kind}"
        )
    _check_radius(law, who, load)
    return [FrictionSite(load, "", dof, count, joint=joint, axis=tuple(axis))]


def _sliding_and_turning(
    law: JointFriction, who: str, joint: int, kind: str, dof: int, count: int
) -> list[FrictionSite]:
    """Return the friction sites of a planar, translation or free-flyer joint."""
    planar = kind == "JointModelPlanar"
    load, carrier = (core.Load.planar, joint) if planar else (core.Load.none, -1)
    if law.mu and not planar:
        raise InputError(f'{who}: joint "{law.joint}" carries no load that mu could follow; give coulomb')
    slides = count if kind == "JointModelTranslation" else 2 if planar else 3
    if slides == count:
        return [FrictionSite(load, "", dof, count)]
    sites = [FrictionSite(load, "sliding", dof, slides, joint=carrier)]
    if law.radius:
        sites.append(
            FrictionSite(load, "turning", dof + slides, count - slides, joint=carrier, lever=law.radius)
        )
    return sites


def _in_constraint(
    law: JointFriction, name: str, out: core.Builder, context: LoweringContext
) -> list[FrictionSite]:
    """Return the friction sites of an anchor or a coupling."""
    c: object = context.constraints[law.joint]
    who, anchor, resolver = words(law, name), context.blocks[law.joint], context.resolver
    if isinstance(c, JointCoupling):
        return [_in_coupling(law, who, name, c, anchor, out, resolver)]
    _refuse(law, who, TEETH, f'a parameter of a JointCoupling, and "{law.joint}" is a {type(c).__name__}')
    if isinstance(c, HingeAnchor):
        _check_radius(law, who, core.Load.revolute)
        f1, f2 = resolver.pair(c, who)
        axis = tuple(resolver.hinge_axis(c, who))
        block = out.add_hinge_slip(name, f1, f2, axis=list(axis))
        return [FrictionSite(core.Load.revolute, block=block, anchor=anchor, axis=axis)]
    ball = isinstance(c, PointAnchor) or type(c).__name__ in BALLS
    place = row_slices(out)[law.joint]
    rows = place.stop - place.start
    if not ball or rows != 3:
        held = f" that holds {rows} of three directions" if ball else ""
        raise InputError(
            f'{who}: "{law.joint}" is a {type(c).__name__}{held}, for which no friction is defined; friction '
            'acts in a HingeAnchor, in a PointAnchor with axes="xyz" and on a JointCoupling'
        )
    _check_radius(law, who, core.Load.spherical)
    block = out.add_spin_slip(name, *frames_of(c, resolver, who), axes=[0, 1, 2])
    return [FrictionSite(core.Load.spherical, block=block, anchor=anchor)]


def _in_coupling(
    law: JointFriction,
    who: str,
    name: str,
    c: JointCoupling,
    anchor: int,
    out: core.Builder,
    resolver: Resolver,
) -> FrictionSite:
    """Return the friction site of the teeth or threads of a coupling.

    Fractions a and b of the tooth force act as friction on the two joints.
    """
    _refuse(law, who, BEARING, f'a parameter of a bearing, and "{law.joint}" is a JointCoupling')
    if law.mu and law.lead_angle is None:
        raise InputError(
            f"{who}: mu needs the lead_angle of the thread on a JointCoupling; give it, or an efficiency"
        )
    a, b = law.tooth_losses
    loss = a + b
    weights = (a / (loss * c.ratio), b / loss) if loss else (0.0, 1.0)
    j1, j2 = resolver.joint(c.joint1, who), resolver.joint(c.joint2, who)
    block = out.add_coupling_slip(name, j1, j2, weight1=weights[0], weight2=weights[1])
    return FrictionSite(core.Load.multiplier, block=block, anchor=anchor, mu=loss * abs(c.ratio))


def _refuse(law: JointFriction, who: str, keys: tuple[str, ...], reason: str) -> None:
    """Raise InputError if a parameter is set that does not apply to the joint."""
    for key in keys:
        if getattr(law, key):
            raise InputError(f"{who}: {key} is {reason}; leave it out")


def _check_radius(law: JointFriction, who: str, load: core.Load) -> None:
    """Raise InputError if `mu` has no radius: the friction torque would be zero."""
    radii = {core.Load.revolute: ("radius", "axial_radius"), core.Load.spherical: ("radius",)}.get(load, ())
    if law.mu and radii and not any(getattr(law, key) for key in radii):
        needed = " or ".join(radii)
        raise InputError(
            f"{who}: mu needs a positive {needed} on a joint that turns, for torque = mu radius force"
        )


def _viscous(law: JointFriction, out: core.Builder, index: int, site: FrictionSite) -> None:
    """Add the viscous part of a law."""
    if not law.viscous:
        return
    coefficient = law.viscous * site.lever**2
    if site.block >= 0:
        out.add_viscous(index, coefficient=coefficient, block=site.block, anchor=site.anchor)
    else:
        out.add_viscous(index, coefficient=coefficient, dof=site.dof, count=site.dofs)


def _dry(law: JointFriction, name: str, out: core.Builder, index: int, site: FrictionSite) -> None:
    """Add the dry friction element of a law."""
    element = f"{name} {site.part}" if site.part else name
    block = site.block
    if block < 0:
        block = out.add_dof_slip(element, dof=site.dof, count=site.dofs)
    mu = law.mu if site.mu is None else site.mu
    constant = (law.coulomb + law.preload) * site.lever
    out.add_friction(
        index,
        block,
        name=element,
        load=site.load if mu else core.Load.none,
        reaction=core.Reaction[law.reaction if mu else "none"],
        joint=site.joint,
        anchor=site.anchor,
        row=site.row,
        axis=list(site.axis),
        axis_dof=site.axis_dof,
        constant=constant if constant > MIN_LIMIT else 0.0,
        mu=mu * site.lever,
        radius=law.radius,
        axial_radius=law.axial_radius,
        inverse_span=0.0 if law.span is None else 1.0 / law.span,
        static_ratio=law.static_ratio,
        stribeck_velocity=(law.stribeck_velocity or 0.0) / site.lever,
    )
