"""Unilateral contacts with impacts and rest: balls, boxes, stops, a gripper, feet.

Each example prints results of the run beside closed forms.  With --html FOLDER it writes replays.

Run: python examples/contacts.py [NAME ...] [--html FOLDER]
NAME is bouncing_ball, ball_to_rolling, box_on_incline, pendulum_between_stops, gripper, biped or
solo12_dropped; the default is all examples.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from printed import run_examples, show

import pin_nonideal as pn

G = 9.81
TIGHT = {"rtol": 1e-11, "atol": 1e-12}


def times(run, kind):
    """Return the times of the events of a kind [s]."""
    return [event.time for event in run.events if event.kind == kind]


def chain(*joints, gravity=(0.0, 0.0, -G), mass=1.0, lever=(0.0, 0.0, 0.0), inertia=0.0):
    """Return a chain of joints named a, b, c with a body on the last joint, and that joint's index."""
    model, joint = pin.Model(), 0
    model.gravity = pin.Motion(np.array(gravity), np.zeros(3))
    for name, kind in zip("abc", joints, strict=False):
        joint = model.addJoint(joint, kind, pin.SE3.Identity(), name)
    model.appendBodyToJoint(
        joint, pin.Inertia(mass, np.array(lever), inertia * np.eye(3)), pin.SE3.Identity()
    )
    return model, joint


def frame(model, name, joint, x, z):
    place = pin.SE3(np.eye(3), np.array([x, 0.0, z]))
    model.addFrame(pin.Frame(name, joint, 0, place, pin.FrameType.OP_FRAME), False)


def bouncing_ball():
    """Drop 1 kg from 1 m with restitution 0.8: infinitely many impacts in 4.06 s, then rest."""
    model, joint = chain(pin.JointModelPZ())
    frame(model, "ball", joint, 0.0, 0.0)
    scene = pn.Scene(model, contacts=[pn.PointContact("ball", restitution=0.8)], q0=[1.0])
    run = pn.simulate(scene, 5.0, record=("energy", "forces"), **TIGHT)
    falls = np.sqrt(2.0 / G)
    show("first impact [s]", times(run, "impact")[0], falls)
    show("tenth impact [s]", times(run, "impact")[9], falls * (1.0 + 8.0 * (1.0 - 0.8**9)))
    show("end of bouncing [s]", times(run, "touch_down")[-1], falls * 1.8 / 0.2)
    show("taken by all impacts [J]", run.energy["impacts"][-1], -G)
    show("speed at the end [m/s]", abs(run.v[-1, 0]), 0.0)
    return run


def box_on_incline():
    """Place a box of 0.2 m by 0.5 m on a slope of 25 degrees: b/h < tan(slope), so it tips or slides.

    It slides with mu = 0.3 and tips about its lower edge with mu = 0.5.
    """
    slope, mass, b, h = np.deg2rad(25.0), 2.0, 0.2, 0.5
    inertia = mass * (b * b + h * h) / 12.0
    gravity = (G * np.sin(slope), 0.0, -G * np.cos(slope))
    model, joint = chain(
        pin.JointModelPX(),
        pin.JointModelPZ(),
        pin.JointModelRY(),
        gravity=gravity,
        mass=mass,
        inertia=inertia,
    )
    for name, x in (("upper", -0.5 * b), ("lower", 0.5 * b)):
        frame(model, name, joint, x, -0.5 * h)
    for mu in (0.3, 0.5):
        contacts = [pn.PointContact(name, mu=mu) for name in ("upper", "lower")]
        scene = pn.Scene(model, contacts=contacts, q0=[0.0, 0.5 * h, 0.0])
        now = scene.solve(scene.q0, scene.v0)
        if mu == 0.5:
            arm = h * np.sin(slope) - b * np.cos(slope)
            tips = mass * G * arm / (2.0 * (inertia + 0.25 * mass * (b * b + h * h)))
            show("tips with mu = 0.5 [rad/s^2]", now.a[2], tips)
        else:
            show("slides with mu = 0.3 [m/s^2]", now.a[0], G * (np.sin(slope) - mu * np.cos(slope)))
    return pn.simulate(scene, 0.5, **TIGHT)


def pendulum_between_stops():
    """Release a 1 m pendulum at 1.2 rad onto a stop at 0.25 rad with restitution 0.7, where it rests."""
    model, _ = chain(pin.JointModelRY(), lever=(0.0, 0.0, -1.0))
    limit = pn.JointLimit("a", lower=0.25, upper=1.3, restitution=0.7, name="stop")
    run = pn.simulate(pn.Scene(model, contacts=[limit], q0=[1.2]), 10.0, record="forces", **TIGHT)
    first = next(event for event in run.events if event.kind == "impact")
    show(
        "strikes first at [rad/s]",
        -first.v_minus[0],
        np.sqrt(2.0 * G * (np.cos(0.25) - np.cos(1.2))),
    )
    show("leaves at [rad/s]", first.v_plus[0], -0.7 * first.v_minus[0])
    show("torque of the stop at rest [N m]", run.lam[-1, 0], G * np.sin(0.25))
    show("speed at the end [rad/s]", abs(run.v[-1, 0]), 0.0)
    return run


def ball_to_rolling():
    """Simulate a billiard ball with side spin: it slides along a parabola, then rolls straight."""
    r, mu, v, w = 0.0285, 0.2, np.array([2.0, 0.0, 0.0]), np.array([-30.0, 10.0, 0.0])
    model, joint = chain(pin.JointModelFreeFlyer(), mass=0.17, inertia=0.4 * 0.17 * r * r)
    frame(model, "ball", joint, 0.0, 0.0)
    contact = pn.PointContact("ball", mu=mu, radius=r, name="cloth")
    scene = pn.Scene(model, contacts=[contact], q0=[0.0, 0.0, r, 0.0, 0.0, 0.0, 1.0], v0=[*v, *w])
    run = pn.simulate(scene, 1.0, **TIGHT)
    slip = v + np.cross(w, [0.0, 0.0, -r])
    size = np.linalg.norm(slip)
    rolls = 2.0 * size / (7.0 * mu * G)
    x, y, _ = v * rolls - 0.5 * mu * G * slip / size * rolls**2
    at = run.q[np.argmin(np.abs(run.t - times(run, "stick")[0]))]
    show("rolls from [s]", times(run, "stick")[0], rolls)
    show("x there [m]", at[0], x)
    show("y there [m]", at[1], y)
    velocity = pin.Quaternion(run.q[-1, 3:7]).toRotationMatrix() @ run.v[-1, :3]
    show("then goes on with v_x [m/s]", velocity[0], (v - 2.0 / 7.0 * slip)[0])
    show("and v_y [m/s]", velocity[1], (v - 2.0 / 7.0 * slip)[1])
    return run


def gripper():
    """Hold a block of 0.5 kg with two fingers: it sticks without drift if 2 mu F > m g, else it slips."""
    mass, mu = 0.5, 0.6
    model, fingers = pin.Model(), []
    model.gravity = pin.Motion(np.array([0.0, 0.0, -G]), np.zeros(3))
    for name in ("left", "right"):
        fingers.append(model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), name))
        model.appendBodyToJoint(
            fingers[-1], pin.Inertia(0.1, np.zeros(3), np.zeros((3, 3))), pin.SE3.Identity()
        )
        frame(model, f"{name} pad", fingers[-1], 0.0, 0.0)
    block = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "block")
    model.appendBodyToJoint(block, pin.Inertia(mass, np.zeros(3), 1e-3 * np.eye(3)), pin.SE3.Identity())
    frame(model, "middle", block, 0.0, 0.0)
    contacts = [
        pn.PointContact(
            "middle", mu, plane=f"{side} pad", normal=(sign, 0.0, 0.0), offset=(-0.03 * sign, y, z)
        )
        for side, sign in (("left", 1.0), ("right", -1.0))
        for y, z in ((0.02, 0.02), (0.02, -0.02), (-0.02, 0.02), (-0.02, -0.02))
    ]
    q0 = [-0.03, 0.03, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]

    def held(force):
        return pn.Scene(model, contacts=contacts, actuation=[force, -force] + [0.0] * 6, q0=q0)

    critical = mass * G / (2.0 * mu)
    for part in (0.75, 1.0 - 1e-9, 1.0 + 1e-9):
        scene = held(part * critical)
        falls = -scene.solve(scene.q0, scene.v0).a[4]
        show(f"at {part:.9f} of the force it falls with [m/s^2]", falls, max(0.0, G * (1.0 - part)))
    run = pn.simulate(held((1.0 + 1e-9) * critical), 60.0)
    show("drift in 60 s [m]", np.abs(run.q - run.q[0]).max(), 0.0)
    show("speed at the end [m/s]", np.abs(run.v[-1]).max(), 0.0)
    return run


def biped():
    """Simulate a trunk on two legs with flat feet: contact forces match the center-of-mass motion."""
    model = pin.Model()
    model.gravity = pin.Motion(np.array([0.0, 0.0, -G]), np.zeros(3))
    trunk = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "trunk")
    model.appendBodyToJoint(
        trunk, pin.Inertia(8.0, np.array([0.0, 0.0, 0.2]), 0.2 * np.eye(3)), pin.SE3.Identity()
    )
    contacts = []
    for side, y in (("left", 0.1), ("right", -0.1)):
        joint = trunk
        parts = (("hip", 0.0, 1.5), ("knee", -0.35, 1.0), ("ankle", -0.35, 0.6))
        for name, z, mass in parts:
            place = pin.SE3(np.eye(3), np.array([0.0, y if name == "hip" else 0.0, z]))
            joint = model.addJoint(joint, pin.JointModelRY(), place, f"{side} {name}")
            lever = np.array([0.0, 0.0, -0.04 if name == "ankle" else -0.17])
            model.appendBodyToJoint(joint, pin.Inertia(mass, lever, 0.01 * np.eye(3)), pin.SE3.Identity())
        frame(model, f"{side} foot", joint, 0.03, -0.06)
        contacts += pn.box_contacts(f"{side} foot", (0.2, 0.1, 0.02), mu=0.8)
    contacts = [contact for contact in contacts if contact.offset[2] < 0.0]
    q0 = np.concatenate([[0.0, 0.0, 0.77, 0.0, 0.0, 0.0, 1.0], np.zeros(6)])
    hold = pn.HoldPosition(kp=400.0, kd=20.0)
    run = pn.simulate(pn.Scene(model, contacts=contacts, actuation=hold, q0=q0), 2.0, record=("a", "forces"))
    data, force = model.createData(), sum(run.contact_forces.values())
    pin.centerOfMass(model, data, run.q[-1], run.v[-1], run.a[-1])
    total = pin.computeTotalMass(model)
    show("all contacts push up with [N]", force[-1, 2], total * (G + data.acom[0][2]))
    show("and forwards with [N]", force[-1, 0], total * data.acom[0][0])
    return run


def solo12_dropped():
    """Drop the quadruped onto its feet; position control brings it to rest."""
    scene = pn.load("solo12_dropped")
    model, data = scene.model, scene.model.createData()
    pin.framesForwardKinematics(model, data, scene.q0)
    height = data.oMf[model.getFrameId("FL_FOOT")].translation[2] - scene.contacts[0].radius
    run = pn.simulate(scene, 2.0, record=("a", "forces"))
    show("feet touch down at [s]", times(run, "impact")[0], np.sqrt(2.0 * height / G))
    pin.centerOfMass(model, data, run.q[-1], run.v[-1], run.a[-1])
    push = sum(force[-1, 2] for force in run.contact_forces.values())
    show("the ground pushes at the end with [N]", push, pin.computeTotalMass(model) * (G + data.acom[0][2]))
    return run


EXAMPLES = {
    f.__name__: f
    for f in (
        bouncing_ball,
        ball_to_rolling,
        box_on_incline,
        pendulum_between_stops,
        gripper,
        biped,
        solo12_dropped,
    )
}


def main(arguments=None):
    run_examples(__doc__, EXAMPLES, arguments)


if __name__ == "__main__":
    main()
