"""Reader of URDF files.

Data that Pinocchio's reader ignores silently are converted to laws, constraints, notes or errors.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from pin_nonideal.description.constraints import Constraint, JointCoupling, PrescribedMotion
from pin_nonideal.description.contacts import UserContact
from pin_nonideal.description.forces import Force
from pin_nonideal.description.laws import Law
from pin_nonideal.description.time_functions import Constant
from pin_nonideal.errors import LoadingError, nearest
from pin_nonideal.types import Array, GeometryModel, Model

from .density import add_inertias, links_without_inertia
from .geometry_sources import Shapes, cached_models, cached_shapes, file_stamps
from .loop_tags import open_loops
from .meshes import resolve_meshes
from .repair import repair_urdf
from .validation import check_urdf
from .xacro import urdf_text
from .xml import numbers, parse_xml, quote_names, read_text


class Keyframe(NamedTuple):
    """Named state of a file.

    Attributes:
        q: configuration, (nq,).
        v: velocity, (nv,).
        apply: function that sets the controls of the state.
    """

    q: Array
    v: Array
    apply: Callable[[], None]


@dataclass
class RobotFile:
    """Content of a robot's file.

    Attributes:
        model: pinocchio.Model.
        visual: pinocchio.GeometryModel for display, `Shapes` that read one, or None.
        collision: pinocchio.GeometryModel for collision, `Shapes` that read one, or None.
        constraints: constraints of the file (mimic joints, equalities).
        forces: given forces of the file (joint springs).
        motors: joints with a transmission.
        notes: notes on the reading for the user.
        q0: initial configuration of the file, (nq,), or None.
        v0: initial velocity of the file, (nv,), or None.
        laws: nonideal laws of the file, besides the damping and friction of the model.
        actuation: actuation of the joints, or None.
        keyframes: named states of the file.
        advice: advice for a singular mass matrix, or "".
        to_float: advice on a floating base for a robot without degrees of freedom, or "".
        contact_friction: coefficients of sliding, torsional and rolling friction by the geometry's name.
        joint_order: names of the joints in the order of the file.
        ranges: contacts that keep the file's ranges of tendons and ball joints.
        open_loops: loops that elements of other tools declare in the file, and that are not read.
    """

    model: Model
    visual: GeometryModel | None = None
    collision: GeometryModel | None = None
    constraints: list[Constraint] = field(default_factory=list)
    forces: list[Force] = field(default_factory=list)
    motors: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    q0: Array | None = None
    v0: Array | None = None
    laws: list[Law] = field(default_factory=list)
    actuation: Any = None
    keyframes: dict[str, Keyframe] = field(default_factory=dict)
    advice: str = ""
    to_float: str = ""
    contact_friction: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    joint_order: tuple[str, ...] = ()
    ranges: list[UserContact] = field(default_factory=list)
    open_loops: list[str] = field(default_factory=list)


def read_urdf(
    path: Path,
    *,
    free_flyer: bool = False,
    package_dirs: Sequence[str | Path] = (),
    density: float | None = None,
) -> RobotFile:
    """Read a URDF file.

    Args:
        path: path of the file.
        free_flyer: whether the root link gets a floating base, joint "root_joint".
        package_dirs: folders that hold the packages of `package://` paths; the folders above the file and the
            paths of ROS are searched too.
        density: density of links without an inertia [kg/m^3], to compute it from their shapes.

    Raises:
        LoadingError: the file is malformed, has a loop, or has an invalid link or joint.
    """
    root = parse_xml(urdf_text(path, package_dirs), path, "robot")
    name = root.get("name") or path.parent.name
    root.set("name", name)
    loops = open_loops(root)
    notes = repair_urdf(root)
    check_urdf(root, path, ("universe", "root_joint") if free_flyer else ("universe",))
    shaped = links_without_inertia(root)
    notes += resolve_meshes(root, path, package_dirs)
    massless_links = links_without_inertia(root)
    if density is not None:
        add_inertias(root, density, notes)
    xml = ElementTree.tostring(root, encoding="unicode")
    try:
        model = cached_models((xml, free_flyer), lambda: _model(xml, free_flyer)).copy()
    except (ValueError, RuntimeError) as error:
        raise LoadingError(f'"{path}" cannot be read by Pinocchio: {error}') from None
    _set_dynamics(model, root, path)
    _rotate_planar_joints(model, root, path, notes)
    notes += _unused_notes(root)
    visual, collision = (
        _shapes(model.copy(), root, path, kind, free_flyer) for kind in ("visual", "collision")
    )
    motors = [j.get("name", "") for j in root.findall("transmission/joint")]
    robot = RobotFile(model, visual, collision, constraints=_mimics(root, path), motors=motors, notes=notes)
    robot.to_float = "load(..., free_flyer=True) gives the root link a floating base"
    robot.open_loops = loops
    robot.joint_order = tuple(j.get("name", "") for j in root.findall("joint"))
    missing_links = [link for link in shaped if link not in massless_links]
    if missing_links and (density is not None or not massless_links):
        robot.advice = (
            f"the meshes of links {quote_names(missing_links)}, which state no inertia, were not found: put "
            "them there, or name the folders of their packages with package_dirs"
        )
    elif massless_links and density is None:
        robot.advice = "load(..., density=1000.0) computes the inertia of such links from their shapes"
    return robot


def _model(xml: str, free_flyer: bool) -> Model:
    return pin.buildModelFromXML(xml, pin.JointModelFreeFlyer()) if free_flyer else pin.buildModelFromXML(xml)


def _shapes(model: Model, root: ElementTree.Element, path: Path, kind: str, free_flyer: bool) -> Shapes:
    """Return the geometry of one kind, which is read on first use."""
    notes: list[str] = []

    def read() -> tuple[GeometryModel, list[str]]:
        dropped: list[str] = []
        return _geometry(model, root, path, kind, dropped), dropped

    @cache
    def shapes() -> GeometryModel:
        meshes = (mesh.get("filename", "") for mesh in root.iter("mesh"))
        content = (ElementTree.tostring(root), free_flyer, kind, file_stamps(meshes))
        geometry, dropped = cached_shapes(content, read)
        notes.extend(dropped)
        return geometry.copy()

    return Shapes(shapes, notes)


def _set_dynamics(model: Model, root: ElementTree.Element, path: Path) -> None:
    """Set damping and friction of planar and floating joints, which Pinocchio's reader ignores."""
    for joint in root.findall("joint"):
        dynamics, name = joint.find("dynamics"), joint.get("name", "")
        if dynamics is None or joint.get("type") not in ("planar", "floating"):
            continue
        where, j = f'"{path}": joint "{name}"', model.getJointId(name)
        dofs = slice(model.idx_vs[j], model.idx_vs[j] + model.nvs[j])
        model.damping[dofs] = numbers(dynamics, "damping", 1, (0,), where)[0]
        friction = numbers(dynamics, "friction", 1, (0,), where)[0]
        model.upperDryFrictionLimit[dofs], model.lowerDryFrictionLimit[dofs] = friction, -friction


def _rotate_planar_joints(model: Model, root: ElementTree.Element, path: Path, notes: list[str]) -> None:
    """Rotate planar joints into the plane normal to their axis; Pinocchio's reader uses x-y for all."""
    up = np.array([0.0, 0.0, 1.0])
    for joint in root.findall("joint"):
        name = joint.get("name", "")
        axis = numbers(joint.find("axis"), "xyz", 3, (1, 0, 0), f'"{path}": joint "{name}"')
        normal = axis / np.linalg.norm(axis) if axis.any() else up
        if joint.get("type") != "planar" or np.array_equal(normal, up):
            continue
        j, turn = model.getJointId(name), pin.Quaternion.FromTwoVectors(up, normal).matrix()
        forth = pin.SE3(turn, np.zeros(3))
        back = forth.inverse()
        model.jointPlacements[j] = model.jointPlacements[j] * forth
        model.inertias[j] = model.inertias[j].se3Action(back)
        for k in range(1, model.njoints):
            if model.parents[k] == j:
                model.jointPlacements[k] = back * model.jointPlacements[k]
        for frame in model.frames:
            if frame.parentJoint == j and frame.type != pin.FrameType.JOINT:
                frame.placement = back * frame.placement
        x, y = (" ".join(f"{round(c, 9):g}" for c in 0.0 + column) for column in turn.T[:2])
        whose = "its axis" if joint.find("axis") is not None else "the default axis of URDF,"
        notes.append(
            f'planar joint "{name}" moves in the plane normal to {whose} '
            f"{' '.join(f'{c:g}' for c in normal)}: its x and y are along {x} and {y} in the joint's frame"
        )


def _unused_notes(root: ElementTree.Element) -> list[str]:
    """Return notes on limits of effort and velocity, and on transmission ratios."""
    notes = []
    limits = [j.find("limit") for j in root.findall("joint") if j.get("type") != "fixed"]
    limited = []
    for key in ("effort", "velocity"):
        bounded = sum(float(numbers(limit, key, 1, (0,), "limit")[0]) > 0.0 for limit in limits)
        if bounded:
            limited.append(f"the {key} of {bounded} joints (scene.model.upper{key.capitalize()}Limit)")
    if limited:
        notes.append(f"bounds of {' and '.join(limited)} are not enforced")
    geared = [
        str(t.get("name"))
        for t in root.findall("transmission")
        for e in t.iter("mechanicalReduction")
        if (e.text or "").strip() not in ("", "1", "1.0")
    ]
    joints = {j.get("name") for j in root.findall("joint")}
    strange = [str(j.get("name")) for j in root.findall("transmission/joint") if j.get("name") not in joints]
    if strange:
        notes.append(f"transmissions drive joints that do not exist: {quote_names(strange)}")
    if geared:
        notes.append(
            f"reductions of transmissions {quote_names(geared)} are not used: torques are those at the joints"
        )
    return notes


def read_mimics(path: Path) -> list[Constraint]:
    """Return the mimic joints of a URDF file as couplings.

    Raises:
        LoadingError: the file is malformed, or the leader of a mimic joint does not exist.
    """
    return _mimics(parse_xml(read_text(path), path, "robot"), path)


def _mimics(root: ElementTree.Element, path: Path) -> list[Constraint]:
    """Return mimic joints, which Pinocchio leaves free, as couplings: q = multiplier q_leader + offset."""
    kinds = {j.get("name", ""): j.get("type") for j in root.findall("joint")}
    result: list[Constraint] = []
    for joint in root.findall("joint"):
        mimic = joint.find("mimic")
        if mimic is None or joint.get("type") == "fixed":
            continue
        name = joint.get("name", "")
        where = f'"{path}": joint "{name}"'
        leader = mimic.get("joint", "")
        if leader not in kinds:
            raise LoadingError(
                f'{where} mimics joint "{leader}", which does not exist{nearest(leader, kinds)}'
            )
        if leader == name:
            raise LoadingError(f"{where} must mimic another joint; it mimics itself")
        multiplier = float(numbers(mimic, "multiplier", 1, (1,), where)[0])
        offset = float(numbers(mimic, "offset", 1, (0,), where)[0])
        if multiplier == 0.0 or kinds[leader] == "fixed":
            result.append(PrescribedMotion(name, Constant(offset), name=f"{name} mimic"))
        else:
            result.append(JointCoupling(name, leader, multiplier, offset, name=f"{name} mimic"))
    return result


def _geometry(
    model: Model, root: ElementTree.Element, path: Path, kind: str, notes: list[str]
) -> GeometryModel:
    """Return the geometry of one kind, without unreadable meshes; each such mesh gives a note."""
    geometry_type = pin.GeometryType.VISUAL if kind == "visual" else pin.GeometryType.COLLISION
    try:
        return pin.buildGeomFromUrdfString(
            model, ElementTree.tostring(root, encoding="unicode"), geometry_type
        )
    except (ValueError, RuntimeError):
        _drop_unreadable(root, kind, notes)
    try:
        return pin.buildGeomFromUrdfString(
            model, ElementTree.tostring(root, encoding="unicode"), geometry_type
        )
    except (ValueError, RuntimeError) as error:
        raise LoadingError(f'"{path}": the {kind} geometry cannot be read by Pinocchio: {error}') from None


def _drop_unreadable(root: ElementTree.Element, kind: str, notes: list[str]) -> None:
    """Remove the shapes whose mesh cannot be read."""
    import coal

    for link in root.findall("link"):
        for shape in link.findall(kind):
            mesh = shape.find("geometry/mesh")
            if mesh is None:
                continue
            filename = mesh.get("filename", "")
            try:
                coal.MeshLoader().load(filename, np.ones(3))
            except (ValueError, RuntimeError):
                link.remove(shape)
                notes.append(f'mesh "{filename}" cannot be read; its shape is left out')
