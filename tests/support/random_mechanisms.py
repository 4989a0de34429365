"""Random mechanisms with friction, by seed: trees, planar linkages, hanging bodies, closed spatial chains."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

import pin_nonideal as pn

from .random_trees import attach, inertia, place_of, tree

ONE_AXIS = [
    "revolute x",
    "revolute unaligned",
    "prismatic y",
    "prismatic unaligned",
    "helical z",
    "helical unaligned",
]
SHAPES = ("tree", "linkage", "hung body", "closed chain")


@dataclass
class Mechanism:
    """Scene with a consistent initial state.

    Attributes:
        seed: seed of the mechanism.
        shape: one of SHAPES.
        scene: the scene.
        q: configuration, (nq,).
        v: velocity on the constraints, (nv,).
        slips: maps the name of each friction element to a function (data, v) -> slip velocity, (dim,).
    """

    seed: int
    shape: str
    scene: pn.Scene
    q: np.ndarray
    v: np.ndarray
    slips: dict


def mechanism(seed):
    """Return the mechanism of a seed."""
    rng = np.random.default_rng(seed)
    shape = SHAPES[seed % len(SHAPES)]
    model, q, constraints = {
        "tree": _tree,
        "linkage": _linkage,
        "hung body": _hung_body,
        "closed chain": _closed_chain,
    }[shape](rng)
    model.gravity = pin.Motion(rng.normal(0.0, 6.0, 3), np.zeros(3))
    laws, slips = _laws(model, constraints, rng)
    scene = pn.Scene(
        model,
        constraints=constraints,
        laws=laws,
        forces=_forces(model, rng),
        actuation=_drive(model.nv, rng),
        q0=q,
        name=f"{shape} {seed}",
    )
    v = rng.normal(0.0, 2.0, model.nv) * (rng.random() < 0.7)
    return Mechanism(seed, shape, scene, *scene.project(q, v), slips)


def _tree(rng):
    kinds = list(rng.choice(ONE_AXIS, rng.integers(1, 6)))
    if rng.random() < 0.3:
        kinds[rng.integers(len(kinds))] = "spherical"
    if rng.random() < 0.1:
        kinds[0] = "free flyer"
    model = tree(kinds, rng, armature=rng.random() < 0.3)
    return model, pin.integrate(model, pin.neutral(model), rng.normal(0.0, 0.7, model.nv)), []


def _linkage(rng):
    """Return planar chains of three to five bars, closed by hinges with parallel pins."""
    model = pin.Model()
    axis = pin.JointModelRevoluteUnaligned(np.array([0.0, -1.0, 0.0]))
    constraints, q = [], []
    root = 0
    for loop in range(rng.integers(1, 3)):
        bars = int(rng.integers(3, 6))
        joint, ends = root, []
        start = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.0]))
        if root:
            start = pin.SE3(np.eye(3), np.array([rng.uniform(0.1, 0.3), 0.0, 0.0]))
        for k in range(bars):
            joint = model.addJoint(joint, axis, start, f"pin{loop}{k}")
            length = rng.uniform(0.15, 0.5)
            body = pin.Inertia(rng.uniform(0.2, 2.0), np.array([length / 2.0, 0.0, 0.0]), 0.01 * np.eye(3))
            model.appendBodyToJoint(joint, body, pin.SE3.Identity())
            start = pin.SE3(np.eye(3), np.array([length, rng.normal(0.0, 0.05), 0.0]))
            q.append(rng.uniform(-2.0, 2.0))
            ends.append(joint)
        tip = model.addFrame(pin.Frame(f"tip{loop}", joint, 0, start, pin.FrameType.OP_FRAME))
        here = place_of(model, np.array(q), model.frames[tip].name)
        attach(model, f"ground{loop}", 0, np.array(q), here)
        constraints.append(pn.HingeAnchor(f"tip{loop}", f"ground{loop}", axis="y", name=f"loop{loop}"))
        root = int(rng.choice(ends)) if bars > 3 else 0
    return model, np.array(q), constraints


def _hung_body(rng):
    """Return free bodies that hang on the ground and on each other by hinges and ball joints."""
    model = pin.Model()
    for k in range(rng.integers(1, 3)):
        joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), f"body{k}")
        model.appendBodyToJoint(joint, inertia(rng, rng.uniform(0.3, 2.0)), pin.SE3.Identity())
    q = pin.integrate(model, pin.neutral(model), rng.normal(0.0, 0.7, model.nv))
    constraints = []
    for k in range(model.njoints - 1):
        data = model.createData()
        pin.forwardKinematics(model, data, q)
        place = data.oMi[k + 1] * pin.SE3(np.eye(3), rng.normal(0.0, 0.2, 3))
        for side, joint in (("a", k + 1), ("b", k)):
            attach(model, f"{side}{k}", joint, q, place)
        kind = pn.HingeAnchor if k == 0 or rng.random() < 0.7 else pn.PointAnchor
        options = {"axis": str(rng.choice(list("xyz")))} if kind is pn.HingeAnchor else {}
        constraints.append(kind(f"a{k}", f"b{k}", name=f"hang{k}", **options))
    return model, q, constraints


def _closed_chain(rng):
    """Return a spatial chain of five to eight joints with its tip at a point, on a plane or at a distance."""
    kinds = list(rng.choice(ONE_AXIS, rng.integers(5, 9)))
    model = tree(kinds, rng, parents=range(len(kinds)))
    q = pin.integrate(model, pin.neutral(model), rng.normal(0.0, 0.7, model.nv))
    tip = f"j{len(kinds) - 1} tip"
    attach(model, "ground", 0, q, place_of(model, q, tip))
    model.addFrame(
        pin.Frame("post", 0, 0, pin.SE3(np.eye(3), np.array([1.5, 0.0, 0.0])), pin.FrameType.OP_FRAME)
    )
    closing = [
        pn.PointAnchor(tip, "ground", name="closure"),
        pn.PointAnchor(tip, "ground", axes="z", name="closure"),
        pn.Distance(tip, "post", name="closure"),
    ]
    return model, q, [closing[rng.integers(3)]]


def _laws(model, constraints, rng):
    """Return laws on most joints and hinges, and slip velocities by element.

    Bristles can return stored energy.
    """
    laws, slips = [], {}
    users = int(rng.random() < 0.25)  # Python functions are slow
    for k in range(1, model.njoints):
        name, joint = model.names[k], model.joints[k]
        kind = rng.choice(["none", "dry", "dry", "dry", "dry", "smooth", "bristles", "user"])
        if joint.nv not in (1, 3) or kind == "none":
            continue
        law = f"law {name}"
        if joint.nv == 1 and kind == "smooth":
            laws.append(pn.SigmoidFriction(name, rng.exponential(0.5), rng.uniform(1.0, 20.0), name=law))
        elif joint.nv == 1 and kind == "bristles":
            level = rng.uniform(0.1, 0.5)
            laws.append(pn.LuGre(name, 300.0, 1.0, level, stribeck_velocity=0.1, name=f"bristles {name}"))
        else:
            if joint.nv == 1 and kind == "user" and users > 0:
                users -= 1
                laws.append(_user_friction(model, name, joint.idx_v, rng))
            else:
                numbers = _numbers(rng)
                if any(isinstance(c, pn.HingeAnchor) for c in constraints):
                    numbers["span"] = None  # the hinge torque would load adjacent joints
                laws.append(pn.JointFriction(name, **numbers, name=law))
            dofs = slice(joint.idx_v, joint.idx_v + joint.nv)
            slips[law] = lambda data, v, dofs=dofs: v[dofs]
    frames = [f.name for f in model.frames if f.type == pin.FrameType.OP_FRAME]
    if frames and rng.random() < 0.3:
        laws.append(
            pn.Drag(str(rng.choice(frames)), rng.exponential(0.3), rng.uniform(0.5, 2.0), name="law drag")
        )
    for anchor in constraints:
        if isinstance(anchor, pn.HingeAnchor) and rng.random() < 0.7:
            law = f"law {anchor.name}"
            laws.append(pn.JointFriction(anchor.name, **_numbers(rng), name=law))
            slips[law] = _hinge_slip(model, anchor)
    return laws, slips


def _numbers(rng):
    """Return parameters of a bearing with mu radius far below the body lengths, so that a paradox is rare."""
    return {
        "coulomb": rng.exponential(0.2) * (rng.random() < 0.5),
        "mu": rng.uniform(0.02, 0.25),
        "radius": rng.uniform(0.005, 0.04),
        "axial_radius": rng.uniform(0.0, 0.04),
        "span": rng.choice([None, rng.uniform(0.2, 1.0)]),
        "preload": rng.exponential(0.1) * (rng.random() < 0.3),
        "static_ratio": rng.choice([1.0, rng.uniform(1.0, 1.6)]),
        "stribeck_velocity": rng.choice([None, rng.uniform(0.02, 0.5)]),
        "viscous": rng.exponential(0.05) * (rng.random() < 0.3),
        "reaction": str(rng.choice(["total", "total", "total", "ideal"])),
    }


def _user_friction(model, name, dof, rng):
    """Return user friction with a limit proportional to the reaction force of the joint."""
    direction = np.zeros(model.nv)
    direction[dof] = 1.0
    constant, share = rng.exponential(0.2), rng.uniform(0.0, 0.01)
    return pn.UserFriction(
        lambda t, q: direction,
        lambda t, q, v, reactions: constant + share * np.linalg.norm(reactions.wrench(name)[:3]),
        name=f"law {name}",
    )


def _hinge_slip(model, anchor):
    frames = [model.getFrameId(f) for f in (anchor.frame1, anchor.frame2)]

    def slip(data, v):
        one, two = (pin.getFrameJacobian(model, data, f, pin.LOCAL_WORLD_ALIGNED)[3:] @ v for f in frames)
        return np.array([data.oMf[frames[0]].rotation @ anchor.axis @ (one - two)])

    return slip


def _forces(model, rng):
    forces = []
    frames = [f.name for f in model.frames if f.type == pin.FrameType.OP_FRAME]
    singles = [model.names[k] for k in range(1, model.njoints) if model.joints[k].nq == 1]
    if frames and rng.random() < 0.4:
        forces.append(pn.Wrench(str(rng.choice(frames)), rng.normal(0.0, 3.0, 6)))
    if singles and rng.random() < 0.4:
        spring = {"stiffness": rng.exponential(20.0), "damping": rng.exponential(0.1), "rest": rng.normal()}
        forces.append(pn.JointSpring(str(rng.choice(singles)), **spring))
    if frames and rng.random() < 0.3:
        far = pin.SE3(np.eye(3), np.array([3.0, 2.0, 1.0]))
        model.addFrame(pin.Frame("far", 0, 0, far, pin.FrameType.OP_FRAME))
        spring = {"stiffness": rng.exponential(20.0), "damping": rng.exponential(0.2), "rest_length": 0.5}
        forces.append(pn.SpringDamper(str(rng.choice(frames)), "far", **spring))
    return forces


def _drive(nv, rng):
    """Return no torque, a constant torque or a harmonic torque."""
    kind = rng.choice(["none", "constant", "swing"])
    size, speed = rng.normal(0.0, 1.5, nv) * (rng.random(nv) < 0.5), rng.uniform(1.0, 8.0)
    if kind == "none":
        return None
    return size if kind == "constant" else lambda t, q, v: size * np.sin(speed * t)
