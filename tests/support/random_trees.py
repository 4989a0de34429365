"""Random trees with every kind of joint, and helpers for scenes at random states."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

AXIS = np.array([0.36, 0.48, 0.8])


def _composite():
    joint = pin.JointModelComposite(pin.JointModelRX())
    joint.addJoint(pin.JointModelPY(), pin.SE3(np.eye(3), np.array([0.1, 0.2, 0.0])))
    joint.addJoint(pin.JointModelSpherical(), pin.SE3(pin.rpy.rpyToMatrix(0.3, 0.1, 0.2), np.zeros(3)))
    return joint


def _endless_unaligned():
    """Return an unbounded unaligned joint from the URDF reader: the Python constructor has no axis."""
    links = "".join(
        f'<link name="{n}"><inertial><mass value="1"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        for n in ("a", "b")
    )
    axis = " ".join(str(x) for x in AXIS)
    ends = f'<parent link="a"/><child link="b"/><axis xyz="{axis}"/>'
    joint = f'<joint name="j" type="continuous">{ends}</joint>'
    return pin.buildModelFromXML(f'<robot name="r">{links}{joint}</robot>').joints[1]


# All kinds of joints of Pinocchio (loading converts mimic joints to couplings).
JOINTS = {
    "revolute x": pin.JointModelRX,
    "revolute y": pin.JointModelRY,
    "revolute z": pin.JointModelRZ,
    "revolute unaligned": lambda: pin.JointModelRevoluteUnaligned(AXIS),
    "endless x": pin.JointModelRUBX,
    "endless y": pin.JointModelRUBY,
    "endless z": pin.JointModelRUBZ,
    "endless unaligned": _endless_unaligned,
    "prismatic x": pin.JointModelPX,
    "prismatic y": pin.JointModelPY,
    "prismatic z": pin.JointModelPZ,
    "prismatic unaligned": lambda: pin.JointModelPrismaticUnaligned(AXIS),
    "helical x": lambda: pin.JointModelHX(0.1),
    "helical y": lambda: pin.JointModelHY(-0.2),
    "helical z": lambda: pin.JointModelHZ(0.3),
    "helical unaligned": lambda: pin.JointModelHelicalUnaligned(AXIS, 0.15),
    "spherical": pin.JointModelSpherical,
    "spherical zyx": pin.JointModelSphericalZYX,
    "free flyer": pin.JointModelFreeFlyer,
    "planar": pin.JointModelPlanar,
    "translation": pin.JointModelTranslation,
    "universal": lambda: pin.JointModelUniversal(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])),
    "composite": _composite,
    "ellipsoid": lambda: pin.JointModelEllipsoid(0.3, 0.2, 0.1),
}


def any_joint(rng, deepest=2):
    """Return a joint of any kind, or a composite of one to four joints, nested up to `deepest` levels."""
    if deepest == 0 or rng.uniform() < 0.6:
        return JOINTS[str(rng.choice(list(JOINTS)))]()
    joint = pin.JointModelComposite(any_joint(rng, deepest - 1), placement(rng))
    for _ in range(int(rng.integers(0, 4))):
        joint.addJoint(any_joint(rng, deepest - 1), placement(rng))
    return joint


def placement(rng, size=0.3):
    """Return a random placement."""
    return pin.SE3(_rotation(rng), size * rng.standard_normal(3))


def _rotation(rng):
    q = rng.standard_normal(4)
    return pin.Quaternion(q / np.linalg.norm(q)).toRotationMatrix()


def inertia(rng, mass=1.0):
    """Return a random positive-definite inertia with a random center of mass."""
    points = 0.1 * rng.standard_normal((6, 3))
    second = sum(np.dot(p, p) * np.eye(3) - np.outer(p, p) for p in points)
    return pin.Inertia(mass, 0.1 * rng.standard_normal(3), mass * second)


def add(model, name, kind, parent, rng, mass=1.0):
    """Add a joint, by kind or as an object, with a body and a frame "<name> tip" at a random placement."""
    joint = JOINTS[kind]() if isinstance(kind, str) else kind
    joint = model.addJoint(parent, joint, placement(rng), name)
    model.appendBodyToJoint(joint, inertia(rng, mass), pin.SE3.Identity())
    model.addFrame(pin.Frame(f"{name} tip", joint, 0, placement(rng), pin.FrameType.OP_FRAME))
    return joint


def tree(kinds, rng, *, parents=None, armature=False, gravity=True):
    """Return a tree of the given kinds of joints, j0, j1, ...

    The parent of a joint is the previous joint, an ancestor of that joint, or the world.  Joints are then
    numbered branch by branch, as Pinocchio's algorithms require.
    """
    model = pin.Model()
    model.name = "tree"
    for k, kind in enumerate(kinds):
        if parents is None:
            parent = k
            while parent > 0 and rng.uniform() < 0.3:
                parent = model.parents[parent]
        else:
            parent = parents[k]
        add(model, f"j{k}", kind, parent, rng, mass=float(rng.uniform(0.2, 3.0)))
    model.gravity = pin.Motion(9.81 * AXIS if gravity else np.zeros(3), np.zeros(3))
    if armature:
        model.armature = rng.uniform(0.0, 0.2, model.nv)
    return model


def state(model, rng, speed=1.0, spread=1.0):
    """Return a random configuration and velocity."""
    q = pin.integrate(model, pin.neutral(model), spread * rng.standard_normal(model.nv))
    return q, speed * rng.standard_normal(model.nv)


def attach(model, name, joint, q, place):
    """Add a frame to a joint's body that is at `place` in the world at the configuration q."""
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    frame = pin.Frame(name, joint, 0, data.oMi[joint].actInv(place), pin.FrameType.OP_FRAME)
    model.addFrame(frame)
    return name


def place_of(model, q, name):
    """Return the placement of a frame in the world."""
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    return data.oMf[model.getFrameId(name)]


def three_trees(rng):
    """Return a floating chain, a floating pair and a chain on the ground, with frames on every body.

    Returns:
        The model and a configuration away from the neutral one.
    """
    model = pin.Model()
    model.name = "three trees"
    chains = (
        ("a", ["free flyer", "revolute x", "spherical", "prismatic unaligned"]),
        ("b", ["free flyer", "universal", "revolute unaligned"]),
        ("c", ["planar", "endless z", "helical y", "prismatic x"]),
    )
    for letter, kinds in chains:
        parent = 0
        for k, kind in enumerate(kinds):
            parent = add(model, f"{letter}{k}", kind, parent, rng, mass=float(rng.uniform(0.5, 2.0)))
    model.armature = rng.uniform(0.0, 0.1, model.nv)
    return model, pin.integrate(model, pin.neutral(model), 0.7 * rng.standard_normal(model.nv))
