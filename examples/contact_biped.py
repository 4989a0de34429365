"""Trunk on two legs with flat feet: contact forces match the motion of the center of mass."""

import numpy as np
import pinocchio as pin

import pin_nonideal as pn

model, contacts = pin.Model(), []
trunk = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "trunk")
body = pin.Inertia(8.0, np.array([0.0, 0.0, 0.2]), 0.2 * np.eye(3))
model.appendBodyToJoint(trunk, body, pin.SE3.Identity())
for side, y in (("left", 0.1), ("right", -0.1)):
    joint = trunk
    for name, z, mass in (("hip", 0.0, 1.5), ("knee", -0.35, 1.0), ("ankle", -0.35, 0.6)):
        place = pin.SE3(np.eye(3), np.array([0.0, y if name == "hip" else 0.0, z]))
        joint = model.addJoint(joint, pin.JointModelRY(), place, f"{side} {name}")
        lever = np.array([0.0, 0.0, -0.04 if name == "ankle" else -0.17])
        model.appendBodyToJoint(joint, pin.Inertia(mass, lever, 0.01 * np.eye(3)), pin.SE3.Identity())
    sole = pin.SE3(np.eye(3), np.array([0.03, 0.0, -0.06]))
    model.addFrame(pin.Frame(f"{side} foot", joint, 0, sole, pin.FrameType.OP_FRAME), False)
    contacts += [c for c in pn.box_contacts(f"{side} foot", (0.2, 0.1, 0.02), mu=0.8) if c.offset[2] < 0.0]
q0 = np.concatenate([[0.0, 0.0, 0.77, 0.0, 0.0, 0.0, 1.0], np.zeros(6)])
scene = pn.Scene(model, contacts=contacts, actuation=pn.HoldPosition(kp=400.0, kd=20.0), q0=q0)
run = pn.simulate(scene, 2.0, record=("a", "forces"), output_dt=0.01)

data, force = model.createData(), sum(run.contact_forces.values())
pin.centerOfMass(model, data, run.q[-1], run.v[-1], run.a[-1])
total = pin.computeTotalMass(model)
print("contacts push up with [N]", force[-1, 2], "and forwards with [N]", force[-1, 0])
assert abs(force[-1, 2] - total * (9.81 + data.acom[0][2])) < 1e-9 * total * 9.81
assert abs(force[-1, 0] - total * data.acom[0][0]) < 1e-9 * total * 9.81
sums = {"up": force[:, 2], "forwards": force[:, 0]}
pn.plot(run, "contact_biped.png", what=[("Contact forces [N]", sums), "contacts"])
