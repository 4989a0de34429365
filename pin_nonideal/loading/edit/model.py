"""Other joint types in an existing model: ball, universal, screw and fixed joints.

URDF has no ball joint and no screw joint. CAD exporters write a ball joint as three consecutive revolute
joints with massless links. Such a chain is singular if its first and last axis are parallel (gimbal lock),
because M is singular there. A ball joint has no such singularity.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from pin_nonideal.errors import LoadingError
from pin_nonideal.types import Array, GeometryModel, JointModel, Model, Placement

# Maximum mass of the links between the axes of a ball joint, relative to the mass that the joint carries.
MAX_LINK_MASS = 1e-6
ROUNDING = 1e-9  # remaining mass of a body without its links that is rounding error, relative to the body
# Tolerance for intersecting [m] and perpendicular [cosine] axes; exporters print about ten digits.
AXIS_TOLERANCE = 1e-7

UNIVERSAL = {
    "CARDAN": "XY",
    "UJOINT_XY": "XY",
    "UJOINT_YX": "YX",
    "UJOINT_XZ": "XZ",
    "UJOINT_ZX": "ZX",
    "UJOINT_YZ": "YZ",
}
UNIVERSAL["UJOINT_ZY"] = "ZY"
JOINT_TYPES = ("SPHERICAL", "FIXED", *UNIVERSAL)


@dataclass(frozen=True)
class BallChain:
    """Three revolute joints that form one ball joint.

    Attributes:
        joints: indices of the three joints, from the root outwards.
        name: name of the ball joint.
        center: center of the ball joint in the frame of the last joint [m], (3,).
    """

    joints: tuple[int, int, int]
    name: str
    center: Array


def ball_chains(model: Model, keep: Collection[str] = ()) -> list[BallChain]:
    """Find the chains of three revolute joints that are ball joints.

    The axes intersect in one point, and consecutive axes are perpendicular. The two links in between carry no
    mass and no other joint. The joints have no limits, armature or friction.

    Args:
        model: pinocchio.Model.
        keep: names of joints, frames and links that other entries refer to; they are not merged.

    Returns:
        Chains without common joints, in the order of the joints.
    """
    children: dict[int, list[int]] = {}
    for j in range(1, model.njoints):
        children.setdefault(model.parents[j], []).append(j)
    names_at: dict[int, set[str]] = {}
    for frame in model.frames:
        names_at.setdefault(frame.parentJoint, set()).add(frame.name)
    chains: list[BallChain] = []
    used: set[int] = set()
    for a in range(1, model.njoints):
        b = _only_child(children, a)
        c = _only_child(children, b)
        if a in used or b is None or c is None or not all(_plain_revolute(model, j) for j in (a, b, c)):
            continue
        if names_at[a] & set(keep) or names_at[b] & set(keep) or model.names[c] in keep:
            continue
        carried = sum(model.inertias[k].mass for k in model.subtrees[c])
        if max(model.inertias[a].mass, model.inertias[b].mass) > MAX_LINK_MASS * carried:
            continue
        center = _common_point(model, a, b, c)
        if center is not None:
            chains.append(BallChain((a, b, c), _ball_name(model, (a, b, c)), center))
            used.update((a, b, c))
    return chains


def _only_child(children: Mapping[int, Sequence[int]], joint: int | None) -> int | None:
    following = children.get(joint, ()) if joint is not None else ()
    return following[0] if len(following) == 1 else None


def revolute_axis(model: Model, joint: int) -> Array | None:
    """Return the unit axis of a revolute joint in its own frame, (3,), or None for other joints."""
    j = model.joints[joint]
    if (
        not j.shortname().startswith("JointModelR")
        or j.nv != 1
        or j.shortname().startswith("JointModelRevoluteUnbounded")
    ):
        return None
    data = j.createData()
    j.calc(data, np.zeros(1), np.zeros(1))
    return np.array(data.S).reshape(6)[3:]


def _plain_revolute(model: Model, joint: int) -> bool:
    """Check if a joint is revolute without limits, armature and friction, which a ball joint would lose."""
    if revolute_axis(model, joint) is None:
        return False
    i, k = model.idx_vs[joint], model.idx_qs[joint]
    if model.upperPositionLimit[k] > model.lowerPositionLimit[k]:
        return False
    return not any(
        limit[i]
        for limit in (model.armature, model.damping, model.lowerDryFrictionLimit, model.upperDryFrictionLimit)
    )


def _common_point(model: Model, a: int, b: int, c: int) -> Array | None:
    """Return the intersection of three axes in c's frame at zero angles, or None for other chains."""
    b_in_c = model.jointPlacements[c].inverse()
    a_in_c = b_in_c * model.jointPlacements[b].inverse()
    axes = np.array(
        [
            a_in_c.rotation @ revolute_axis(model, a),
            b_in_c.rotation @ revolute_axis(model, b),
            revolute_axis(model, c),
        ]
    )
    if abs(axes[0] @ axes[1]) > AXIS_TOLERANCE or abs(axes[1] @ axes[2]) > AXIS_TOLERANCE:
        return None
    origins = np.array([a_in_c.translation, b_in_c.translation, np.zeros(3)])
    across = [np.eye(3) - np.outer(u, u) for u in axes]
    point = np.linalg.solve(sum(across), sum(p @ o for p, o in zip(across, origins, strict=True)))
    gap = max(float(np.linalg.norm(p @ (point - o))) for p, o in zip(across, origins, strict=True))
    return point if gap <= AXIS_TOLERANCE else None


def _ball_name(model: Model, joints: tuple[int, int, int]) -> str:
    """Return the common prefix of the three names, or the last name if the prefix is short or in use."""
    first, last = (f([model.names[j] for j in joints]) for f in (min, max))
    shared = "".join(a for a, _ in takewhile(lambda pair: pair[0] == pair[1], zip(first, last, strict=False)))
    shared = shared.rstrip("_- ").removesuffix("rev").rstrip("_- ")
    return shared if len(shared) > 2 and not model.existFrame(shared) else str(model.names[joints[2]])


def edit_joints(
    model: Model,
    geometries: Sequence[GeometryModel],
    chains: Sequence[BallChain],
    types: Mapping[str, str],
    pitches: Mapping[str, float] | None = None,
) -> tuple[Model, list[GeometryModel]]:
    """Rebuild the model with other joints.

    Args:
        model: pinocchio.Model.
        geometries: geometry models of the model.
        chains: revolute joints to merge into ball joints, from `ball_chains`.
        types: joint name to one of `JOINT_TYPES`. A universal joint named `j` becomes revolute joints `j_X`
            and `j` (axes as in the type), so that each has an angle.
        pitches: rise per radian [m/rad] of revolute joints that become helical, by name.

    Returns:
        New model and new geometry models, in the given order.

    Raises:
        LoadingError: a joint type is unknown, a joint does not exist, or a screw joint has no axis.
    """
    screws = {name: _screw(model, name, pitch) for name, pitch in (pitches or {}).items()}
    for name, kind in types.items():
        if not model.existJointName(name):
            raise LoadingError(f'joint_name: no joint "{name}" in the robot')
        if kind not in JOINT_TYPES:
            raise LoadingError(
                f'joint_type: type of "{name}" must be one of {", ".join(JOINT_TYPES)}; got "{kind}"'
            )
    merged = {chain.joints[2]: chain for chain in chains}
    dropped = {j for chain in chains for j in chain.joints[:2]}
    new = pin.Model()
    new.name, new.gravity = model.name, model.gravity
    # For each old joint: its index in the new model and its placement there (merged joints: at zero angle).
    place: dict[int, tuple[int, Placement]] = {0: (0, pin.SE3.Identity())}
    for j in range(1, model.njoints):
        parent, offset = place[model.parents[j]]
        placement = offset * model.jointPlacements[j]
        shift = pin.SE3.Identity()
        if j in dropped:
            place[j] = (parent, placement)
            continue
        name, joint = model.names[j], model.joints[j]
        if j in merged:
            name, joint = merged[j].name, pin.JointModelSpherical()
            ball = pin.SE3(np.eye(3), merged[j].center)
            placement, shift = placement * ball, ball.inverse()
        elif name in screws:
            joint = screws[name]
        elif types.get(name) == "SPHERICAL":
            joint = pin.JointModelSpherical()
        elif types.get(name) in UNIVERSAL:
            first, second = tuple(UNIVERSAL[types[name]])
            parent = new.addJoint(parent, _revolute(first), placement, f"{name}_{first}")
            new.addJointFrame(parent)
            joint, placement = _revolute(second), pin.SE3.Identity()
        index = new.addJoint(parent, joint, placement, name)
        _copy_limits(model, j, new, index)
        new.inertias[index] = model.inertias[j].se3Action(shift)
        place[j] = (index, shift)
    renamed = {model.names[j]: chain.name for j, chain in merged.items()}
    _copy_frames(model, new, place, dropped, renamed)
    copies = [_move_geometry(model, new, geometry, place) for geometry in geometries]
    fixed = [new.getJointId(n) for n, kind in types.items() if kind == "FIXED"]
    if fixed:
        new, copies = reduced_model(new, copies, fixed, pin.neutral(new))
    return new, list(copies)


def reduced_model(
    model: Model, geometries: Sequence[GeometryModel], joints: Sequence[int], q: NDArray[np.float64]
) -> tuple[Model, list[GeometryModel]]:
    """Return a model and its geometries with some joints fixed, by `pinocchio.buildReducedModel`.

    Pinocchio makes the frame of such a joint its own parent, and gives it the inertia of the whole body of
    the joint. Here the frame keeps its parent and has the inertia of its own link, as in a URDF.

    Args:
        model: pinocchio.Model.
        geometries: pinocchio.GeometryModels.
        joints: indices of the joints to fix.
        q: configuration at which they are fixed, (nq,).
    """
    new, copies = pin.buildReducedModel(model, list(geometries), list(joints), q)
    joint_kind = pin.FrameType.JOINT
    for j in joints:
        name = str(model.names[j])
        if not (model.existFrame(name, joint_kind) and new.existFrame(name, pin.FrameType.FIXED_JOINT)):
            continue
        parent = model.frames[model.frames[model.getFrameId(name, joint_kind)].parentFrame]
        fixed = new.frames[new.getFrameId(name, pin.FrameType.FIXED_JOINT)]
        kinds = (parent.type, pin.FrameType.FIXED_JOINT)  # the parent may have been fixed as well
        parent_frames = [
            new.getFrameId(parent.name, kind) for kind in kinds if new.existFrame(parent.name, kind)
        ]
        if parent_frames:
            fixed.parentFrame = parent_frames[0]
        parameters = model.inertias[j].toDynamicParameters()
        for frame in model.frames:
            if frame.parentJoint == j and frame.inertia.mass > 0.0:
                parameters = parameters - frame.placement.act(frame.inertia).toDynamicParameters()
        massive = parameters[0] > ROUNDING * model.inertias[j].mass
        fixed.inertia = pin.Inertia.FromDynamicParameters(parameters) if massive else pin.Inertia.Zero()
    return new, list(copies)


def _screw(model: Model, name: str, pitch: float) -> JointModel:
    """Return a helical joint about the axis of a revolute joint."""
    if not model.existJointName(name):
        raise LoadingError(f'model: helical: no joint "{name}" in the robot')
    axis = revolute_axis(model, model.getJointId(name))
    if axis is None:
        kind = model.joints[model.getJointId(name)].shortname()
        raise LoadingError(
            f'model: helical: joint "{name}" must be revolute in the robot\'s file; it is {kind}'
        )
    return pin.JointModelHelicalUnaligned(axis, pitch)


def _revolute(axis: str) -> JointModel:
    return {"X": pin.JointModelRX, "Y": pin.JointModelRY, "Z": pin.JointModelRZ}[axis]()


def _copy_limits(model: Model, j: int, new: Model, index: int) -> None:
    """Copy limits, armature and dissipation to a joint of equal dimension; other joints get none."""
    if model.nvs[j] != new.nvs[index] or model.nqs[j] != new.nqs[index]:
        return
    old_v, new_v = (slice(m.idx_vs[k], m.idx_vs[k] + m.nvs[k]) for m, k in ((model, j), (new, index)))
    old_q, new_q = (slice(m.idx_qs[k], m.idx_qs[k] + m.nqs[k]) for m, k in ((model, j), (new, index)))
    for key in (
        "lowerEffortLimit",
        "upperEffortLimit",
        "lowerVelocityLimit",
        "upperVelocityLimit",
        "lowerDryFrictionLimit",
        "upperDryFrictionLimit",
        "damping",
        "armature",
        "rotorInertia",
        "rotorGearRatio",
    ):
        getattr(new, key)[new_v] = getattr(model, key)[old_v]
    for key in ("lowerPositionLimit", "upperPositionLimit"):
        getattr(new, key)[new_q] = getattr(model, key)[old_q]


def _copy_frames(
    model: Model,
    new: Model,
    place: Mapping[int, tuple[int, Placement]],
    dropped: Collection[int],
    renamed: Mapping[str, str],
) -> None:
    """Copy all frames except those of removed links; a merged joint's frame gets the ball joint's name."""
    index = {0: 0}
    for i, frame in enumerate(model.frames):
        if i == 0:
            continue
        parent, offset = place[frame.parentJoint]
        if frame.parentJoint in dropped:
            index[i] = index[frame.parentFrame]
            continue
        is_joint = frame.type == pin.FrameType.JOINT
        name = renamed.get(frame.name, frame.name) if is_joint else frame.name
        placement = pin.SE3.Identity() if is_joint else offset * frame.placement
        copy = pin.Frame(name, parent, index[frame.parentFrame], placement, frame.type, frame.inertia)
        index[i] = new.addFrame(copy, False)


def _move_geometry(
    model: Model, new: Model, geometry: GeometryModel, place: Mapping[int, tuple[int, Placement]]
) -> GeometryModel:
    """Return the same shapes on the new joints."""
    result = pin.GeometryModel()
    for shape in geometry.geometryObjects:
        copy = shape.copy()
        parent, offset = place[shape.parentJoint]
        copy.placement = offset * shape.placement
        copy.parentJoint = parent
        name = model.frames[shape.parentFrame].name
        copy.parentFrame = new.getFrameId(name) if new.existFrame(name) else 0
        result.addGeometryObject(copy)
    for pair in geometry.collisionPairs:
        result.addCollisionPair(pair)
    return result
