"""Cart on two wheel sets that rolls down an incline: acceleration against the closed form."""

import numpy as np
import pinocchio as pin

import pin_nonideal as pn

slope, radius, inertia = np.radians(12.0), 0.1, 0.004  # inertia of a wheel set about its axle [kg m^2]
model, one = pin.Model(), pin.SE3.Identity()
model.gravity.linear = 9.81 * np.array([np.sin(slope), 0.0, -np.cos(slope)])  # axes along the incline
cart = model.addJoint(0, pin.JointModelPlanar(), one, "cart")  # x, y along the incline, heading
model.appendBodyToJoint(cart, pin.Inertia(8.0, np.array([0, 0, 0.2]), 0.3 * np.eye(3)), one)
for name, x in (("front", 0.3), ("rear", -0.3)):
    axle = model.addJoint(cart, pin.JointModelRY(), pin.SE3(np.eye(3), np.array([x, 0, radius])), name)
    wheel = pin.Inertia(1.5, np.zeros(3), np.diag([0.003, inertia, 0.003]))
    model.appendBodyToJoint(axle, wheel, one)
    model.addFrame(pin.Frame(f"{name} hub", axle, 0, one, pin.FrameType.OP_FRAME))

rolls = [pn.Rolling(f"{name} hub", radius, axis="y", name=name) for name in ("front", "rear")]
scene = pn.Scene(model, constraints=rolls, name="cart")
run = pn.simulate(scene, 2.0, record="a")

# The weight along the incline accelerates the mass and the inertia of the wheels.
mass = 8.0 + 2 * 1.5
expected = mass * 9.81 * np.sin(slope) / (mass + 2 * inertia / radius**2)
assert np.abs(run.joint("cart").a[:, 0] - expected).max() < 1e-9
assert np.abs(run.joint("front").v - run.joint("cart").v[:, 0] / radius).max() < 1e-9
assert abs(run.q[-1, 0] - 0.5 * expected * 2.0**2) < 1e-8
pn.plot(run, "cart.png", what=["q", "v"])
