"""Four-bar with friction in its four pins, which dissipates the kinetic energy."""

import numpy as np

import pin_nonideal as pn

run = pn.simulate(pn.load("rough_four_bar"), 5.0, rtol=1e-10, atol=1e-11, record=("energy", "forces"))
work = sum(values[-1] for name, values in run.energy.items() if name.endswith("friction"))
change = run.energy["total"][-1] - run.energy["total"][0]
print("work of the pins [J]", work, "change of the energy [J]", change)
assert abs(work - change) < 1e-9
assert np.abs(run.v[-1]).max() == 0.0
pn.plot(run, "friction_four_bar.png", what=["v", "energy", "modes"])
