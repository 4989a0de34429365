"""Loaded pin that sticks until its torque passes 1.3 mu r m g, and sticks again."""

import numpy as np

import pin_nonideal as pn

g = 9.81
run = pn.simulate(pn.load("loaded_joint"), 6.0, rtol=1e-10, atol=1e-11, record="forces")
limit = 1.3 * 0.2 * 0.02 * 8.56 * g  # static ratio, coefficient, radius [m], load [N]
weight = (1.0 * 0.14 + 1.56 * 0.42 - 6.0 * 0.13) * g  # torque of the lever about the pin [N m]
slip = next(event.time for event in run.events if event.kind == "slip")
print("slips at [s]", slip, "expected", 1.0 + (limit - weight) / 0.2)
assert abs(slip - 1.0 - (limit - weight) / 0.2) < 1e-9
assert np.abs(run.v[run.t < slip]).max() == 0.0
assert np.abs(run.v[-1]).max() == 0.0
pn.plot(run, "friction_loaded_joint.png", what=["q", "v", "friction", "modes"])
