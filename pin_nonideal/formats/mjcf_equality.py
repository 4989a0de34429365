"""The `<equality>` section of an MJCF file as exact constraints: connect, weld, joint, distance."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from pin_nonideal.constraints import (
    Constraint,
    Distance,
    FrameAnchor,
    JointCoupling,
    PointAnchor,
    PrescribedMotion,
)
from pin_nonideal.errors import LoadingError, nearest
from pin_nonideal.states.placements import joint_placements
from pin_nonideal.timefunctions import Constant
from pin_nonideal.types import Array, Model, Placement

from .mjcf_text import Defaults
from .xml import numbers

KINDS = ("connect", "weld", "joint", "distance")


class _Reader:
    """What every kind of equality needs: the model at its reference configuration, and new frames on it."""

    def __init__(self, root: ElementTree.Element, defaults: Defaults, model: Model, q0: Array) -> None:
        self.root = root
        self.defaults = defaults
        self.model = model
        self.q0 = q0
        self.placements = joint_placements(model, q0)

    def body(self, name: str | None, where: str) -> tuple[int, Placement, Placement]:
        """(parent joint, placement on that joint, placement in the world) of a body; the world for None."""
        if name is None or name == "world":
            return 0, pin.SE3.Identity(), pin.SE3.Identity()
        bodies = [f.name for f in self.model.frames if f.type == pin.FrameType.BODY]
        if name not in bodies:
            raise LoadingError(f'{where}: no body "{name}"{nearest(name, bodies)}')
        index = self.model.getFrameId(name, pin.FrameType.BODY)
        frame = self.model.frames[index]
        joint = int(frame.parentJoint)
        return joint, frame.placement, self.placements[joint] * frame.placement

    def site(self, name: str, where: str) -> str:
        """The name of a site, checked."""
        sites = [f.name for f in self.model.frames if f.type == pin.FrameType.OP_FRAME]
        if name not in sites:
            raise LoadingError(f'{where}: no site "{name}"{nearest(name, sites)}')
        return name

    def joint(self, name: str, where: str) -> float:
        """Reference position of a joint of one degree of freedom."""
        if not self.model.existJointName(name):
            raise LoadingError(f'{where}: no joint "{name}"{nearest(name, list(self.model.names)[1:])}')
        j = self.model.getJointId(name)
        if self.model.nvs[j] != 1:
            raise LoadingError(
                f'{where}: joint "{name}" must be a hinge or a slide; it has {self.model.nvs[j]} axes'
            )
        return float(self.q0[self.model.idx_qs[j]])

    def frame(self, name: str, joint: int, placement: Placement) -> str:
        """Adds a frame to the model and returns its name."""
        self.model.addFrame(pin.Frame(name, joint, 0, placement, pin.FrameType.OP_FRAME), False)
        return name


def equality_constraints(
    section: ElementTree.Element,
    root: ElementTree.Element,
    defaults: Defaults,
    model: Model,
    q0: Array,
    where: str,
    notes: list[str],
) -> list[Constraint]:
    """Constraints from `<equality>`.

    Args:
        section: the element.
        root: the prepared file.
        defaults: its default classes.
        model: pinocchio.Model; receives frames where the equalities act.
        q0: reference configuration, where MuJoCo takes unstated anchors, shape (nq,).
        where: words for messages.
        notes: receives what was left out by the file's own wish, and the softness that is not used.

    Raises:
        LoadingError: an equality that cannot be honored exactly.
    """
    reader = _Reader(root, defaults, model, q0)
    result: list[Constraint] = []
    soft = []
    for i, element in enumerate(section):
        filled = defaults.filled(element, "equality")
        name = filled.get("name") or f"{element.tag} {i + 1}"
        place = f'{where}: equality "{name}"'
        if element.tag not in KINDS:
            raise LoadingError(
                f"{place}: <{element.tag}> cannot be honored; only {', '.join(KINDS)} can; remove it"
            )
        if filled.get("active") == "false":
            notes.append(f'equality "{name}" is inactive in the MJCF file and left out')
            continue
        if filled.get("solref") or filled.get("solimp"):
            soft.append(name)
        result.append(
            {"connect": _connect, "weld": _weld, "joint": _joint, "distance": _distance}[element.tag](
                reader, filled, name, place
            )
        )
    if soft:
        notes.append(
            f"solref and solimp of {', '.join(soft)} are not used: constraints here are exact, not soft"
        )
    return result


def _connect(reader: _Reader, e: ElementTree.Element, name: str, where: str) -> Constraint:
    """Holds point `anchor` of body1 on the point of body2 that is there at the reference configuration."""
    if e.get("site1") or e.get("site2"):
        return PointAnchor(
            reader.site(e.get("site1", ""), where), reader.site(e.get("site2", ""), where), name=name
        )
    if not e.get("anchor"):
        raise LoadingError(f'{where}: connect needs an anchor; add anchor="x y z", in the axes of body1')
    anchor = pin.SE3(np.eye(3), numbers(e, "anchor", 3, (0, 0, 0), where))
    joint1, local1, world1 = reader.body(e.get("body1"), where)
    joint2, local2, world2 = reader.body(e.get("body2"), where)
    frame1 = reader.frame(f"{name}/1", joint1, local1 * anchor)
    frame2 = reader.frame(f"{name}/2", joint2, local2 * world2.actInv(world1 * anchor))
    return PointAnchor(frame1, frame2, name=name)


def _weld(reader: _Reader, e: ElementTree.Element, name: str, where: str) -> Constraint:
    """Two bodies held in a relative pose: `relpose`, or the one at the reference configuration."""
    if e.get("site1") or e.get("site2"):
        return FrameAnchor(
            reader.site(e.get("site1", ""), where), reader.site(e.get("site2", ""), where), name=name
        )
    joint1, local1, world1 = reader.body(e.get("body1"), where)
    joint2, local2, world2 = reader.body(e.get("body2"), where)
    pose = numbers(e, "relpose", 7, (0, 1, 0, 0, 0, 0, 0), where)
    w, x, y, z = pose[3:]
    length = float(np.linalg.norm(pose[3:]))
    if length == 0.0:
        relative = world1.actInv(world2)
    else:
        relative = pin.SE3(pin.Quaternion(w / length, x / length, y / length, z / length).matrix(), pose[:3])
    frame1 = reader.frame(f"{name}/1", joint1, local1 * relative)
    return FrameAnchor(frame1, reader.frame(f"{name}/2", joint2, local2), name=name)


def _joint(reader: _Reader, e: ElementTree.Element, name: str, where: str) -> Constraint:
    """Y - y0 = c0 + c1 (x - x0), with y0 and x0 the reference positions of joint1 and joint2."""
    coefficients = (e.get("polycoef") or "0 1 0 0 0").split()
    filled = ElementTree.Element(
        "joint", {"polycoef": " ".join([*coefficients, *["0"] * (5 - len(coefficients))])}
    )
    c = numbers(filled, "polycoef", 5, (0, 1, 0, 0, 0), where)
    joint1, joint2 = e.get("joint1", ""), e.get("joint2")
    y0 = reader.joint(joint1, where)
    if joint2 is None or (c[1] == 0.0 and not c[2:].any()):
        return PrescribedMotion(joint1, Constant(y0 + c[0]), name=name)
    if c[2:].any():
        raise LoadingError(
            f"{where}: polycoef must be linear (c2 = c3 = c4 = 0) to become a coupling; "
            f"got {e.get('polycoef')}; write a UserConstraint in Python instead"
        )
    return JointCoupling(joint1, joint2, c[1], y0 + c[0] - c[1] * reader.joint(joint2, where), name=name)


def _distance(reader: _Reader, e: ElementTree.Element, name: str, where: str) -> Constraint:
    """The distance between the surfaces of two spheres."""
    geoms = {
        g.get("name"): (g, b) for b in reader.root.iter("body") for g in b.findall("geom") if g.get("name")
    }
    frames, radii = [], 0.0
    for side in ("1", "2"):
        geom_name = e.get(f"geom{side}", "")
        if geom_name not in geoms:
            raise LoadingError(f'{where}: no geom "{geom_name}"{nearest(geom_name, [g for g in geoms if g])}')
        geom, body = geoms[geom_name]
        filled = reader.defaults.filled(geom)
        if filled.get("type", "sphere") != "sphere":
            raise LoadingError(
                f'{where}: distance can be honored between spheres only; geom "{geom_name}" is a '
                f"{filled.get('type')}; use connect, or a Distance between frames in Python"
            )
        joint, local, _ = reader.body(body.get("name"), where)
        center = pin.SE3(np.eye(3), numbers(filled, "pos", 3, (0, 0, 0), where))
        size = (filled.get("size") or "0").split()[0]
        radii += float(numbers(ElementTree.Element("geom", {"size": size}), "size", 1, (0,), where)[0])
        frames.append(reader.frame(f"{name}/{side}", joint, local * center))
    length = radii + float(numbers(e, "distance", 1, (0,), where)[0])
    if length <= 0.0:
        raise LoadingError(
            f"{where}: the distance of the spheres' centers must be positive; got {length:g} m; use connect"
        )
    return Distance(frames[0], frames[1], length, name=name)
