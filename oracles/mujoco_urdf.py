"""Mass matrix and gravity forces of a URDF text by MuJoCo, in Pinocchio's velocity coordinates."""

from __future__ import annotations

from xml.etree import ElementTree

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

GRAVITY = (0.3, -0.7, -9.0)  # not parallel to an axis of a robot
SLIDES, TURN = ("_TX", "_TY"), "_RZ"  # suffixes of MuJoCo's joints of a planar joint


def compiled(text):
    """Compile MuJoCo's model of a URDF text without its shapes and mimic tags.

    Args:
        text: URDF text with unique joint names and physically valid inertias.
    """
    root = ElementTree.fromstring(text)
    for parent, tags in (("link", ("visual", "collision")), ("joint", ("mimic",))):
        for element in root.findall(parent):
            for child in [c for c in element if c.tag in tags]:
                element.remove(child)
    for origin in root.iter("origin"):
        if "quat_xyzw" in origin.attrib:  # not supported by MuJoCo
            quaternion = [float(x) for x in origin.attrib.pop("quat_xyzw").split()]
            origin.set("rpy", " ".join(map(repr, Rotation.from_quat(quaternion).as_euler("xyz").tolist())))
    extension = ElementTree.SubElement(root, "mujoco")
    ElementTree.SubElement(extension, "compiler", {"fusestatic": "true", "inertiafromgeom": "false"})
    spec = mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode"))
    spec.option.gravity = GRAVITY
    return spec.compile()


def terms(model, names, positions):
    """Return mass matrix and gravity forces at a configuration.

    Args:
        model: model from `compiled`.
        names: joint names in the order of the result.
        positions: by joint name, a number, or x, y and angle of a planar joint.

    Returns:
        M, (nv, nv), and the gravity forces, (nv,); velocities of planar joints are in body axes.
    """
    data, order, turns = mujoco.MjData(model), [], []
    for name in names:
        value = np.atleast_1d(positions[name])
        parts = [name] if value.size == 1 else [name + end for end in (*SLIDES, TURN)]
        if value.size == 3:
            turns.append((len(order), value[2]))
        for part, x in zip(parts, value, strict=True):
            joint = model.joint(part)
            data.qpos[joint.qposadr[0]] = x
            order.append(int(joint.dofadr[0]))
    mujoco.mj_forward(model, data)
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    T = np.eye(len(order))
    for first, angle in turns:
        c, s = np.cos(angle), np.sin(angle)
        T[first : first + 2, first : first + 2] = [[c, -s], [s, c]]
    return T.T @ M[np.ix_(order, order)] @ T, T.T @ data.qfrc_bias[order]
