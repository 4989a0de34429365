"""Random trees of drawers and journals with load-dependent friction, beyond realistic coefficients."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import pin_nonideal as pn


def loaded_tree(seed, joints):
    """Return a tree of serial or parallel joints, a law for each, a configuration and joint torques.

    Returns:
        model, laws, q (nq,), tau (nv,).
    """
    rng = np.random.default_rng(seed)
    model, parent, laws = pin.Model(), 0, []
    for k in range(joints):
        axis = rng.standard_normal(3)
        axis /= np.linalg.norm(axis)
        slides = bool(rng.random() < 0.5)
        kind = pin.JointModelPrismaticUnaligned(axis) if slides else pin.JointModelRevoluteUnaligned(axis)
        turn = pin.Quaternion(rng.standard_normal(4)).normalized().toRotationMatrix()
        parent = model.addJoint(parent, kind, pin.SE3(turn, rng.standard_normal(3)), f"joint{k}")
        lever = rng.standard_normal(3) * 10.0 ** rng.uniform(-1.0, 0.8)
        inertia = pin.Inertia(rng.exponential(1.0) + 0.1, lever, rng.uniform(0.01, 1.0) * np.eye(3))
        model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
        laws.append(
            pn.JointFriction(
                f"joint{k}",
                coulomb=rng.exponential(0.5) * (rng.random() < 0.5),
                mu=rng.uniform(1e-3, 1.2),
                radius=0.0 if slides else 10.0 ** rng.uniform(-2.0, 0.3),
                axial_radius=0.0 if slides else rng.uniform(0.0, 0.3),
                span=10.0 ** rng.uniform(-1.0, 0.5),
            )
        )
    return (
        model,
        laws,
        rng.standard_normal(model.nq),
        rng.standard_normal(model.nv) * 10.0 ** rng.uniform(-1.0, 1.5),
    )
