"""Quadruped Solo12 that falls onto its feet; position control brings it to rest."""

import numpy as np
import pinocchio as pin

import pin_nonideal as pn

scene = pn.load("solo12_dropped")
model, data = scene.model, scene.model.createData()
pin.framesForwardKinematics(model, data, scene.q0)
height = data.oMf[model.getFrameId("FL_FOOT")].translation[2] - scene.contacts[0].radius
run = pn.simulate(scene, 2.0, record=("a", "forces"))
impact = next(event.time for event in run.events if event.kind == "impact")
pin.centerOfMass(model, data, run.q[-1], run.v[-1], run.a[-1])
push = sum(force[-1, 2] for force in run.contact_forces.values())
weight = pin.computeTotalMass(model) * (9.81 + data.acom[0][2])
print("feet touch down at [s]", impact, "the ground pushes at the end with [N]", push)
assert abs(impact - np.sqrt(2.0 * height / 9.81)) < 1e-9
assert abs(push - weight) < 1e-9 * weight
pn.plot(run, "contact_solo12.png", what=["contacts", "gaps"])
