"""Five mechanisms with friction: one holds, two settle, one has stick-slip, one is self-locking.

Each example prints results of the run beside closed forms.  With --html FOLDER it writes replays with the
stick-slip modes on a time line.

Run: python examples/friction.py [NAME ...] [--html FOLDER]
NAME is loaded_joint, rough_four_bar, panda_settling, belt_oscillator or worm_drive; the default is all
examples.
"""

from __future__ import annotations

import numpy as np
from printed import run_examples, show

import pin_nonideal as pn

G = 9.81
TIGHT = {"rtol": 1e-10, "atol": 1e-11}


def first(run, kind):
    """Return the time of the first event of a kind [s]."""
    return next(event.time for event in run.events if event.kind == kind)


def loaded_joint():
    """Load a pin of radius 20 mm with 8.56 kg: it sticks until its torque reaches 1.3 mu r m g."""
    run = pn.simulate(pn.load("loaded_joint"), 6.0, **TIGHT)
    limit = 1.3 * 0.2 * 0.02 * 8.56 * G
    weight = (1.0 * 0.14 + 1.56 * 0.42 - 6.0 * 0.13) * G  # torque of the lever about the pin
    show("lets go when the torque grows past the limit [s]", first(run, "slip"), 1.0 + (limit - weight) / 0.2)
    show("largest speed before [rad/s]", np.abs(run.v[run.t < first(run, "slip")]).max(), 0.0)
    print(f"  holds again from {first(run, 'stick'):.6f} s on")
    show("speed at the end [rad/s]", np.abs(run.v[-1]).max(), 0.0)
    return run


def rough_four_bar():
    """Simulate a four-bar with friction in all four pins, which dissipates its kinetic energy."""
    run = pn.simulate(pn.load("rough_four_bar"), 5.0, record="energy", **TIGHT)
    taken = sum(values[-1] for name, values in run.energy.items() if name.endswith("friction"))
    show("work of the pins [J]", taken, run.energy["total"][-1] - run.energy["total"][0])
    show("speed at the end [rad/s]", np.abs(run.v[-1]).max(), 0.0)
    return run


def panda_settling():
    """Simulate a hanging arm with load-dependent friction in seven joints until it rests."""
    run = pn.simulate(pn.load("panda_settling"), 10.0, record="energy", **TIGHT)
    rest = run.t[np.flatnonzero(np.abs(run.v).max(axis=1))[-1]]
    print(f"  at rest from {rest:.6f} s on, after {len(run.events)} events")
    scale = np.ptp(run.energy["potential"])
    show("balance of the energy, part of what fell", np.abs(run.energy["balance"]).max() / scale, 0.0)
    show("speed at the end [rad/s]", np.abs(run.v[-1]).max(), 0.0)
    return run


def belt_oscillator():
    """Simulate 1 kg on a spring of 100 N/m and a belt at 0.1 m/s, with 8 N static and 5 N kinetic friction.

    The slip phase is an arc of a circle in the phase plane.
    """
    run = pn.simulate(pn.load("belt_oscillator"), 5.0, **TIGHT)
    slips = [event.time for event in run.events if event.kind == "slip"]
    sticks = [event.time for event in run.events if event.kind == "stick" and event.time > slips[0]]
    show("begins to slip [s]", slips[0], 0.08 / 0.1)
    show("slips for [s]", sticks[0] - slips[0], (np.pi + 2.0 * np.arctan2(0.01, 0.03)) / 10.0)
    show("sticks for [s]", slips[1] - sticks[0], 2.0 * 0.03 / 0.1)
    return run


def worm_drive():
    """Simulate a self-locking thread with mu r = 2 mm and a rack that falls 1.6 mm per radian."""
    run = pn.simulate(pn.load("worm_drive"), 7.0, output_dt=0.01, **TIGHT)
    off = (run.t > first(run, "stick")) & (run.t < first(run, "slip"))
    show("speed with the motor off [rad/s]", np.abs(run.v[off]).max(), 0.0)
    show("way of the rack meanwhile [rad of thread]", np.ptp(run.q[off, 1]), 0.0)
    return run


EXAMPLES = {
    f.__name__: f for f in (loaded_joint, rough_four_bar, panda_settling, belt_oscillator, worm_drive)
}


def main(arguments=None):
    run_examples(__doc__, EXAMPLES, arguments)


if __name__ == "__main__":
    main()
