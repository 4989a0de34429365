"""Slender box on a slope of 25 degrees, which slides with mu = 0.3 and tips with mu = 0.5."""

import numpy as np
import pinocchio as pin

import pin_nonideal as pn

g, slope, mass, b, h = 9.81, np.deg2rad(25.0), 2.0, 0.2, 0.5
inertia = mass * (b * b + h * h) / 12.0
model, joint = pin.Model(), 0
model.gravity.linear = np.array([g * np.sin(slope), 0.0, -g * np.cos(slope)])  # axes along the slope
for name, kind in (("along", pin.JointModelPX()), ("up", pin.JointModelPZ()), ("tilt", pin.JointModelRY())):
    joint = model.addJoint(joint, kind, pin.SE3.Identity(), name)
model.appendBodyToJoint(joint, pin.Inertia(mass, np.zeros(3), inertia * np.eye(3)), pin.SE3.Identity())
for name, x in (("upper", -0.5 * b), ("lower", 0.5 * b)):
    place = pin.SE3(np.eye(3), np.array([x, 0.0, -0.5 * h]))
    model.addFrame(pin.Frame(name, joint, 0, place, pin.FrameType.OP_FRAME), False)


def box(mu):
    contacts = [pn.PointContact(name, mu=mu) for name in ("upper", "lower")]
    return pn.Scene(model, contacts=contacts, q0=[0.0, 0.5 * h, 0.0])


slides, tips = (box(mu).solve(box(mu).q0, box(mu).v0).a for mu in (0.3, 0.5))
arm = h * np.sin(slope) - b * np.cos(slope)
print("slides with [m/s^2]", slides[0], "tips with [rad/s^2]", tips[2])
assert abs(slides[0] - g * (np.sin(slope) - 0.3 * np.cos(slope))) < 1e-9
assert abs(tips[2] - mass * g * arm / (2.0 * (inertia + 0.25 * mass * (b * b + h * h)))) < 1e-9
runs = [pn.simulate(box(mu), 0.5, output_dt=0.005) for mu in (0.3, 0.5)]
pn.plot(runs, "contact_box.png", what=["q"], names=["mu = 0.3", "mu = 0.5"])
