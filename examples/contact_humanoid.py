"""Limp humanoid of capsules that falls over and comes to rest on the ground."""

import coal
import numpy as np
import pinocchio as pin

import pin_nonideal as pn

model, shapes, stops = pin.Model(), pin.GeometryModel(), []
pn.free_body(model, "torso", coal.Capsule(0.12, 0.36), mass=32.0, collision_model=shapes, place=(0, 0, 1.35))
ball, hinge = pin.JointModelSpherical(), pin.JointModelRY()
limbs = [("neck", "torso", ball, (0.0, 0.0, 0.32), -0.2, 0.1, 5.0)]
for side, y in (("left", 1.0), ("right", -1.0)):
    limbs += [
        (f"{side} shoulder", "torso", ball, (0.0, 0.23 * y, 0.2), 0.3, 0.045, 2.0),
        (f"{side} elbow", f"{side} shoulder", hinge, (0.0, 0.0, -0.3), 0.3, 0.04, 1.5),
        (f"{side} hip", "torso", ball, (0.0, 0.1 * y, -0.34), 0.42, 0.07, 8.0),
        (f"{side} knee", f"{side} hip", hinge, (0.0, 0.0, -0.42), 0.42, 0.05, 4.0),
    ]
    stops += [pn.JointLimit(f"{side} knee", 0.0, 2.4), pn.JointLimit(f"{side} elbow", -2.4, 0.0)]
for name, parent, kind, at, length, radius, mass in limbs:  # a capsule below its joint, or above it
    joint = model.addJoint(model.getJointId(parent), kind, pin.SE3(np.eye(3), np.array(at)), name)
    middle = pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.5 * length]))
    model.appendBodyToJoint(joint, pin.Inertia.FromCapsule(mass, radius, abs(length)), middle)
    shapes.addGeometryObject(pin.GeometryObject(name, joint, middle, coal.Capsule(radius, abs(length))))
contacts = stops + pn.ground_contacts(model, shapes, mu=0.6)
contacts += pn.geometry_contacts(model, shapes, adjacent=False, mu=0.4)
limp = pn.HoldPosition(0.0, dict.fromkeys(list(model.names)[2:], 3.0))
scene = pn.Scene(model, contacts=contacts, collision_model=shapes, actuation=limp, name="humanoid")
push, record = {"torso": [0.6, 0.1, 0.0, 0.0, 0.5, 0.0]}, ("forces", "energy")
run = pn.simulate(scene, 3.0, v=push, method="moreau", dt=1e-3, record=record, output_dt=0.01)

weight, total = pin.computeTotalMass(model) * 9.81, run.energy["kinetic"] + run.energy["potential"]
up = sum(force[:, 2] for name, force in run.contact_forces.items() if " on ground" in name)
print("torso falls by [m]", -run.q[-1, 2], "force of the ground over weight", up[-1] / weight)
assert np.abs(run.v[-1]).max() < 1e-9
assert abs(up[-1] - weight) < 1e-9 * weight
assert (np.diff(total) < 1e-5 * total[0]).all()
pn.plot(run, "contact_humanoid.png", what=[("Force of the ground [N]", {"up": up}), "energy"])
