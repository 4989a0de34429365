"""Hanging Panda arm that comes to rest by load-dependent friction in seven joints."""

import numpy as np

import pin_nonideal as pn

run = pn.simulate(pn.load("panda_settling"), 10.0, rtol=1e-10, atol=1e-11, record=("energy", "forces"))
rest = run.t[np.flatnonzero(np.abs(run.v).max(axis=1))[-1]]
print("at rest from [s]", rest, "after", len(run.events), "events")
assert np.abs(run.energy["balance"]).max() < 1e-9 * np.ptp(run.energy["potential"])
assert np.abs(run.v[-1]).max() == 0.0
pn.plot(run, "friction_panda.png", what=["q", "energy", "modes"])
