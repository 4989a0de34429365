"""Block between two fingers: margin of friction, rest and slip against Coulomb's law."""

import numpy as np
import pinocchio as pin

import pin_nonideal as pn

mu, weight, one = 0.5, 1.0 * 9.81, pin.SE3.Identity()
model, contacts = pin.Model(), []
block = model.addJoint(0, pin.JointModelFreeFlyer(), one, "block")
model.appendBodyToJoint(block, pin.Inertia(1.0, np.zeros(3), 1e-3 * np.eye(3)), one)
for name, side in (("left", -1.0), ("right", 1.0)):
    finger = model.addJoint(0, pin.JointModelPX(), one, name)
    model.appendBodyToJoint(finger, pin.Inertia(0.1, np.zeros(3), 1e-4 * np.eye(3)), one)
    face = pin.SE3(np.eye(3), np.array([side * 0.03, 0, 0]))
    model.addFrame(pin.Frame(f"{name} face", block, 0, face, pin.FrameType.OP_FRAME))
    model.addFrame(pin.Frame(f"{name} tip", finger, 0, face, pin.FrameType.OP_FRAME))
    pad = pn.PointContact(f"{name} tip", mu=mu, plane=f"{name} face", normal=[side, 0, 0], name=name)
    contacts.append(pad)


def gripper(press):  # force of each finger [N]
    return pn.Scene(model, contacts=contacts, actuation=[0.0] * 6 + [press, -press], name="gripper")


held, lost = gripper(1.5 * weight), gripper(0.5 * weight)

# Two contacts give 2 mu N at most, so the margin is 1 - weight / (2 mu N).
assert abs(pn.rest(held).margin - (1 - 1 / 1.5)) < 1e-8
assert pn.rest(held).rests
assert not pn.rest(lost).rests
still, falling = pn.simulate(held, 0.2, record="a"), pn.simulate(lost, 0.2, record="a")
assert np.abs(still.v).max() == 0.0  # no creep
assert abs(falling.a[-1, 2] + 9.81 - 2 * mu * 0.5 * weight) < 1e-9
pn.plot([still, falling], "gripper.png", what=["v"], names=["1.5 m g", "0.5 m g"])
