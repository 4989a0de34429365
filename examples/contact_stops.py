"""Pendulum of 1 m released at 1.2 rad, which bounces on a stop at 0.25 rad and rests there."""

import numpy as np
import pinocchio as pin

import pin_nonideal as pn

g = 9.81
model = pin.Model()
joint = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "swing")
body = pin.Inertia(1.0, np.array([0.0, 0.0, -1.0]), np.zeros((3, 3)))
model.appendBodyToJoint(joint, body, pin.SE3.Identity())
stop = pn.JointLimit("swing", lower=0.25, upper=1.3, restitution=0.7, name="stop")
scene = pn.Scene(model, contacts=[stop], q0=[1.2])
run = pn.simulate(scene, 10.0, record="forces", rtol=1e-11, atol=1e-12, output_dt=0.01)

first = next(event for event in run.events if event.kind == "impact")
print(
    "strikes at [rad/s]",
    first.v_minus[0],
    "leaves at",
    first.v_plus[0],
    "torque at rest [N m]",
    run.lam[-1, 0],
)
assert abs(first.v_minus[0] + np.sqrt(2.0 * g * (np.cos(0.25) - np.cos(1.2)))) < 1e-9
assert abs(first.v_plus[0] + 0.7 * first.v_minus[0]) < 1e-9
assert abs(run.lam[-1, 0] - g * np.sin(0.25)) < 1e-9
assert run.v[-1, 0] == 0.0
pn.plot(run, "contact_stops.png", what=["q", "v", "phase swing"])
