"""Measurements of the stress runs, and linkages for them."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

import pin_nonideal as pn
from oracles.rods import rods

from ..support.mechanisms import frame


def at_most(what, value, bound):
    """Print the measured value and its bound (shown by `pytest -rP`), and assert the bound."""
    print(f"{what}: {value:.2g}, at most {bound:.2g}")
    assert value <= bound


def ledger(run):
    """Largest gap of the energy balance, as part of the energy in play."""
    size = np.abs(run.energy["total"]).max() + run.energy["kinetic"].max()
    return np.abs(run.energy["balance"]).max() / size


def finite(run):
    """Check that all results are finite."""
    assert all(np.isfinite(x).all() for x in (run.t, run.q, run.v, run.violation, run.violation_rate))


def linkage(lengths, q0, v0, masses=None, **more):
    """A four-bar: crank, coupler and rocker of the given lengths, pinned at the fourth one from the start."""
    model = rods(lengths[:3], masses)
    frame(model, "pin", 0, pin.SE3(np.eye(3), np.array([lengths[3], 0.0, 0.0])))
    loop = pn.PointAnchor("jtip", "pin", axes="xz", name="loop")
    return pn.Scene(model, constraints=[loop], q0=q0, v0=v0, **more)
