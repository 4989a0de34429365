"""Gripper that closes on a box and lifts it by 0.2 m: the pads hold it by friction, without slip."""

import coal
import numpy as np
import pinocchio as pin

import pin_nonideal as pn

mass, mu, press, one = 0.5, 0.6, 10.0, pin.SE3.Identity()
model, shapes = pin.Model(), pin.GeometryModel()
shapes.addGeometryObject(pn.ground())
lift = model.addJoint(0, pin.JointModelPZ(), pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.15])), "lift")
model.appendBodyToJoint(lift, pin.Inertia.FromBox(1.0, 0.2, 0.06, 0.04), one)
shapes.addGeometryObject(pin.GeometryObject("palm", lift, one, coal.Box(0.2, 0.06, 0.04)))
for name, side in (("left", -1.0), ("right", 1.0)):
    place = pin.SE3(np.eye(3), np.array([side * 0.06, 0.0, -0.08]))
    finger = model.addJoint(lift, pin.JointModelPX(), place, name)
    model.appendBodyToJoint(finger, pin.Inertia.FromBox(0.2, 0.02, 0.04, 0.12), one)
    shapes.addGeometryObject(pin.GeometryObject(name, finger, one, coal.Box(0.02, 0.04, 0.12)))
pn.free_body(model, "box", coal.Box(0.06, 0.06, 0.06), mass=mass, collision_model=shapes, place=(0, 0, 0.03))
touching = [("box", "ground"), ("left", "box"), ("right", "box")]
grip = pn.Table([0.0], {"left": [press], "right": [-press]})
motion = pn.TrackTrajectory(
    [0.5, 1.5], {"lift": [0.0, 0.2]}, {"lift": [0.0, 0.0]}, kp=5e3, kd=200.0, feedforward="gravity"
)
contacts = [pn.GeometryContact(*pair, mu=mu) for pair in touching]
scene = pn.Scene(model, contacts=contacts, collision_model=shapes, actuation=[grip, motion], name="gripper")
run = pn.simulate(scene, 2.0, method="moreau", dt=1e-3, record=("a", "forces"), output_dt=0.01)

held, height, box = run.t > 0.5, run.joint("lift").q, run.joint("box")
slip = np.ptp((box.q[:, 2] - height)[held])
margin = 1.0 - mass * (9.81 + run.joint("lift").a[held].max()) / (2.0 * mu * press)
print("slip [m]", slip, "lifted by [m]", box.q[-1, 2], "margin of friction", margin)
assert 0.0 < margin < 1.0
assert slip < 1e-12
assert abs(box.q[-1, 2] - height[-1]) < 1e-12
assert box.q[-1, 2] > 0.19
pn.plot(
    run, "contact_gripper.png", what=[("Height [m]", {"gripper": height, "box": box.q[:, 2]}), "contacts"]
)
