"""Gough platform on six legs of prescribed length: forces of the legs against Newton's law."""

import numpy as np
import pinocchio as pin

import pin_nonideal as pn


def circle(radius, degrees):
    return [radius * np.array([np.cos(a), np.sin(a), 0.0]) for a in np.radians(degrees)]


model = pin.Model()
base = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "platform")
model.appendBodyToJoint(base, pin.Inertia(10.0, np.zeros(3), np.diag([0.3, 0.3, 0.5])), pin.SE3.Identity())
feet, balls = circle(0.6, [5, 115, 125, 235, 245, 355]), circle(0.3, [55, 65, 175, 185, 295, 305])
for k in range(6):
    for name, joint, place in ((f"foot {k}", 0, feet[k]), (f"ball {k}", base, balls[k])):
        model.addFrame(pin.Frame(name, joint, 0, pin.SE3(np.eye(3), place), pin.FrameType.OP_FRAME))


def length(k, t):  # length of leg k in a heave of 0.05 m, with both derivatives
    z, dz, ddz = 0.8 + 0.05 * np.sin(3 * t), 0.15 * np.cos(3 * t), -0.45 * np.sin(3 * t)
    L = np.hypot(np.linalg.norm(balls[k] - feet[k]), z)
    return L, z * dz / L, (dz**2 + z * ddz - (z * dz / L) ** 2) / L


legs = [pn.Distance(f"ball {k}", f"foot {k}", lambda t, k=k: length(k, t), name=f"leg {k}") for k in range(6)]
scene = pn.Scene(model, constraints=legs, q0={"platform": {"xyz": [0, 0, 0.8]}}, name="Gough platform")
run = pn.simulate(scene, 2.0, v={"platform": [0, 0, 0.15, 0, 0, 0]}, record="forces")

# The platform follows the lengths, and the legs carry its weight and its inertia.
assert np.abs(run.q[:, 2] - 0.8 - 0.05 * np.sin(3 * run.t)).max() < 1e-8
forces = {f"leg {k}": run.force(f"leg {k}")[:, 0] for k in range(6)}
carried = sum(forces[f"leg {k}"] * run.q[:, 2] / length(k, run.t)[0] for k in range(6))
assert np.abs(carried - 10.0 * (9.81 - 0.45 * np.sin(3 * run.t))).max() < 1e-6
pn.plot(run, "gough_platform.png", what=[("Forces of the legs [N]", forces)])
