"""Self-locking worm that lifts a rack and keeps it at rest without the motor."""

import numpy as np

import pin_nonideal as pn

run = pn.simulate(pn.load("worm_drive"), 7.0, output_dt=0.01, rtol=1e-10, atol=1e-11, record="forces")
stick = next(event.time for event in run.events if event.kind == "stick")
slip = next(event.time for event in run.events if event.kind == "slip")
off = (run.t > stick) & (run.t < slip)
print("at rest from", stick, "to", slip, "s")
assert np.abs(run.v[off]).max() == 0.0
assert np.ptp(run.q[off, 1]) == 0.0
pn.plot(run, "friction_worm.png", what=["q", "v", "modes"])
