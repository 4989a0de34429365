"""Export of a Pinocchio model to MJCF, with anchors, springs, gains and friction of a problem."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

Array = NDArray[np.float64]

THIN = 1e-6
HINGES = {"JointModelRX": (1, 0, 0), "JointModelRY": (0, 1, 0), "JointModelRZ": (0, 0, 1)}


def numbers(values: Any) -> str:
    return " ".join(f"{x:.17g}" for x in np.asarray(values, dtype=float).ravel())


def quaternion(R: Array) -> str:
    """Return the quaternion (w, x, y, z) of a rotation matrix, in the order of MJCF."""
    x, y, z, w = pin.Quaternion(R).coeffs()
    return numbers([w, x, y, z])


def thickened(inertia: Array) -> Array:
    """Return the inertia with moments of at least THIN times the largest: MuJoCo rejects thin rods."""
    moments, axes = np.linalg.eigh(inertia)
    return (axes * np.maximum(moments, THIN * moments.max())) @ axes.T


def mjcf(
    model: Any,
    q0: Array,
    anchors: Sequence[Any] = (),
    springs: Sequence[Any] = (),
    hold: tuple[Array, Array] | None = None,
    coulomb: Array | None = None,
    viscous: Array | None = None,
) -> str:
    """Return the text of an MJCF file.

    Args:
        model: pinocchio.Model of revolute joints, and free flyers attached to the world.
        q0: configuration of frames anchored to the world, and reference of `hold`.
        anchors: PointAnchor and FrameAnchor descriptions; MuJoCo's connect has all three rows of a point.
        springs: SpringDamper descriptions.
        hold: proportional and derivative gains, (nv,) each, as springs and dampers of the joints.
        coulomb: dry friction, (nv,).
        viscous: viscous friction, (nv,).
    """
    root = ET.Element("mujoco", model=model.name or "model")
    ET.SubElement(root, "compiler", angle="radian", autolimits="true", inertiafromgeom="false", boundmass="0")
    ET.SubElement(root, "option", gravity=numbers(model.gravity.linear))
    world = ET.SubElement(root, "worldbody")
    bodies: list[ET.Element] = [world]
    for i in range(1, model.njoints):
        place, inertia = model.jointPlacements[i], model.inertias[i]
        body = ET.SubElement(
            bodies[model.parents[i]], "body", name=model.names[i], pos=numbers(place.translation),
            quat=quaternion(place.rotation),
        )  # fmt: skip
        I = thickened(inertia.inertia)  # noqa: E741
        ET.SubElement(
            body, "inertial", pos=numbers(inertia.lever), mass=numbers(inertia.mass),
            fullinertia=numbers([I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]]),
        )  # fmt: skip
        joint(body, model, i, q0, hold, coulomb, viscous)
        bodies.append(body)
    places: Any = None
    if any(anchor.frame2 is None for anchor in anchors):  # pinocchio.Data of a large model takes gigabytes
        places = model.createData()
        pin.framesForwardKinematics(model, places, q0)

    def site(name: str | None, tag: str, at: Any) -> str:
        """Add a site at a frame, or in the world at a placement, and return its name."""
        if name is None:
            parent, place = world, at
        else:
            frame = model.frames[model.getFrameId(name)]
            parent, place = bodies[frame.parentJoint], frame.placement
        ET.SubElement(
            parent, "site", name=tag, pos=numbers(place.translation), quat=quaternion(place.rotation)
        )  # fmt: skip
        return tag

    equality = ET.SubElement(root, "equality")
    for k, anchor in enumerate(anchors):
        kind = "weld" if type(anchor).__name__ == "FrameAnchor" else "connect"
        at = None if anchor.frame2 else places.oMf[model.getFrameId(anchor.frame1)]
        one, two = site(anchor.frame1, f"anchor{k}_1", at), site(anchor.frame2, f"anchor{k}_2", at)
        ET.SubElement(equality, kind, site1=one, site2=two)
    tendons = ET.SubElement(root, "tendon")
    for k, spring in enumerate(springs):
        spatial = ET.SubElement(
            tendons, "spatial", stiffness=numbers(spring.stiffness), damping=numbers(spring.damping),
            springlength=numbers(spring.rest_length),
        )  # fmt: skip
        for side, frame in enumerate((spring.frame1, spring.frame2)):
            ET.SubElement(spatial, "site", site=site(frame, f"spring{k}_{side}", None))
    return ET.tostring(root, encoding="unicode")


def joint(
    body: ET.Element, model: Any, i: int, q0: Array, hold: Any, coulomb: Array | None, viscous: Array | None
) -> None:
    """Add the joint of a body."""
    kind, dof = model.joints[i].shortname(), model.joints[i].idx_v
    if kind == "JointModelFreeFlyer":
        ET.SubElement(body, "freejoint", name=model.names[i])
        return
    axis = HINGES[kind] if kind in HINGES else model.joints[i].extract().axis
    words = {"armature": numbers(model.armature[dof])}
    damping = 0.0
    if hold is not None:
        damping += hold[1][dof]
        words |= {"stiffness": numbers(hold[0][dof]), "springref": numbers(q0[model.joints[i].idx_q])}
    if viscous is not None:
        damping += viscous[dof]
    if coulomb is not None and coulomb[dof]:
        words["frictionloss"] = numbers(coulomb[dof])
    ET.SubElement(
        body,
        "joint",
        name=model.names[i],
        type="hinge",
        axis=numbers(axis),
        damping=numbers(damping),
        **words,
    )
