"""Row of six dominoes, in which each one overturns the next."""

import coal
import numpy as np
import pinocchio as pin

import pin_nonideal as pn

thick, high, pitch, spin = 0.02, 0.16, 0.08, 3.0
names = [f"domino {k}" for k in range(6)]
model, shapes = pin.Model(), pin.GeometryModel()
shapes.addGeometryObject(pn.ground())
for k, name in enumerate(names):
    wide = 0.08 - 0.01 * (k % 2)
    place = (k * pitch, 0.0, 0.5 * high)
    pn.free_body(model, name, coal.Box(thick, wide, high), 600.0, collision_model=shapes, place=place)
contacts = pn.ground_contacts(model, shapes, names, "ground", mu=0.5)
contacts += [pn.GeometryContact(*pair, mu=0.3) for pair in zip(names[1:], names, strict=False)]
push = {names[0]: [0.5 * high * spin, 0.0, 0.5 * thick * spin, 0.0, spin, 0.0]}  # about its front edge
scene = pn.Scene(model, contacts=contacts, collision_model=shapes, v0=push, name="dominoes")
run = pn.simulate(scene, 1.5, method="moreau", dt=1e-3, record="energy", output_dt=0.005)

energy = run.energy["kinetic"] + run.energy["potential"]
tilts = {name: 2.0 * np.arctan2(run.joint(name).q[:, 4], run.joint(name).q[:, 6]) for name in names}
begins = [run.t[np.argmax(tilts[name] > 0.05)] for name in names]
print("begin to fall at [s]", begins, "end at [deg]", [float(np.degrees(t[-1])) for t in tilts.values()])
assert (np.diff(begins) > 0.0).all()
# A domino leans with its corner on the next one, which lies flat at the end of the row.
assert all(tilts[name][-1] > 1.2 for name in names)
assert abs(tilts[names[-1]][-1] - 0.5 * np.pi) < 1e-6
assert np.abs(run.v[-1]).max() < 1e-6
assert (np.diff(energy) < 1e-4 * energy[0]).all()
pn.plot(run, "contact_dominoes.png", what=[("Tilt [rad]", tilts), "energy"])
