"""Mass on a belt, held by a spring, with stick-slip: 8 N static and 5 N kinetic friction."""

import numpy as np

import pin_nonideal as pn

run = pn.simulate(pn.load("belt_oscillator"), 5.0, rtol=1e-10, atol=1e-11, record="forces")
slips = [event.time for event in run.events if event.kind == "slip"]
sticks = [event.time for event in run.events if event.kind == "stick" and event.time > slips[0]]
# In the phase plane a slip phase is an arc of a circle.
expected = {
    "first slip [s]": (slips[0], 0.08 / 0.1),
    "slip phase [s]": (sticks[0] - slips[0], (np.pi + 2.0 * np.arctan2(0.01, 0.03)) / 10.0),
    "stick phase [s]": (slips[1] - sticks[0], 2.0 * 0.03 / 0.1),
}
for name, (computed, closed_form) in expected.items():
    print(f"{name:16} {computed:.12f} {closed_form:.12f}")
    assert abs(computed - closed_form) < 1e-9
pn.plot(run, "friction_belt.png", what=["q", "phase slip", "modes"])
