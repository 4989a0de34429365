"""Ball of 1 kg that falls 1 m and bounces with restitution 0.8 until it rests."""

import numpy as np
import pinocchio as pin

import pin_nonideal as pn

g = 9.81
model = pin.Model()
joint = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "height")
model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.zeros((3, 3))), pin.SE3.Identity())
model.addFrame(pin.Frame("ball", joint, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME), False)
scene = pn.Scene(model, contacts=[pn.PointContact("ball", restitution=0.8)], q0=[1.0])
run = pn.simulate(scene, 5.0, record=("energy", "forces"), rtol=1e-11, atol=1e-12, output_dt=0.01)

impacts = [event.time for event in run.events if event.kind == "impact"]
end = [event.time for event in run.events if event.kind == "touch_down"][-1]
fall = np.sqrt(2.0 / g)
print("first impact [s]", impacts[0], "tenth", impacts[9], "end of bouncing", end)
assert abs(impacts[0] - fall) < 1e-9
assert abs(impacts[9] - fall * (1.0 + 8.0 * (1.0 - 0.8**9))) < 1e-9
assert abs(end - fall * 1.8 / 0.2) < 1e-9
assert abs(run.energy["impacts"][-1] + g) < 1e-9
assert run.v[-1, 0] == 0.0
pn.plot(run, "contact_bouncing_ball.png", what=["q", "v", "energy"])
