"""Random mechanisms: each run closes its energy ledger, or stops with a named error.

The seed of each is its number, printed with the measurements; `check(1234)` repeats a seed.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.errors import PinNonidealError

from ..support.random_trees import JOINTS, attach, place_of, state, tree
from .measure import finite

FEW, MANY, BLOCK = 40, 10_000, 100
# Relative energy error at rtol 1e-8 over at most several hundred steps.
BALANCE = 1e-5
# A chain of a few meters after projection.
CLOSURE = 1e-9


def closures(model, q, rng, most=2):
    """Loops that are closed at q, of random kinds, between random bodies or a body and the world."""
    made = []
    for k in range(int(rng.integers(0, most + 1))):
        bodies = rng.choice(model.njoints, size=2, replace=False)
        first, second = (int(b) for b in bodies) if bodies[0] else (int(bodies[1]), 0)
        place = place_of(model, q, f"j{first - 1} tip")
        names = [
            attach(model, f"loop {k} {side}", joint, q, place) for side, joint in enumerate((first, second))
        ]
        kind = rng.choice(["point", "plane", "distance", "hinge", "frame"])
        if kind == "point":
            made.append(pn.PointAnchor(*names, name=f"loop {k}"))
        elif kind == "plane":
            made.append(pn.PointAnchor(*names, axes="z", name=f"loop {k}"))
        elif kind == "distance":
            far = attach(
                model, f"loop {k} far", second, q, place * pin.SE3(np.eye(3), np.array([0.3, 0.0, 0.0]))
            )
            made.append(pn.Distance(names[0], far, name=f"loop {k}"))
        elif kind == "hinge":
            made.append(pn.HingeAnchor(*names, name=f"loop {k}"))
        else:
            made.append(pn.FrameAnchor(*names, name=f"loop {k}"))
    return made


def frictions(model, rng):
    """Friction in some of the joints of one freedom."""
    made = []
    for index, joint in list(enumerate(model.joints))[1:]:
        if joint.nv != 1 or rng.uniform() < 0.5:
            continue
        mu = float(rng.choice([0.0, 0.1, 0.4]))
        made.append(
            pn.JointFriction(
                model.names[index],
                coulomb=float(rng.choice([0.0, 0.2, 5.0])),
                mu=mu,
                radius=0.02 if mu else 0.0,
                viscous=float(rng.choice([0.0, 0.1])),
                static_ratio=float(rng.choice([1.0, 1.5])),
            )
        )
    return made


def mechanism(seed):
    """Scene, and the options of a run."""
    rng = np.random.default_rng(seed)
    kinds = [
        k for k in JOINTS if k not in ("ellipsoid", "spherical zyx")
    ]  # these are singular at some angles
    model = tree(
        [str(k) for k in rng.choice(kinds, size=int(rng.integers(1, 6)))], rng, armature=rng.uniform() < 0.3
    )
    q, v = state(model, rng, speed=float(rng.choice([0.0, 1.0, 5.0])))
    loops = closures(model, q, rng)
    laws = [] if rng.uniform() < 0.4 else frictions(model, rng)
    method = str(
        rng.choice(["dop853", "dopri5", "rk4", "semi_implicit_euler", "moreau"], p=[0.5, 0.2, 0.1, 0.1, 0.1])
    )
    options = {"method": method, "record": ("energy", "forces")}
    if method not in ("dop853", "dopri5"):
        options["dt"] = 2e-3
    if rng.uniform() < 0.5:
        options["output_dt"] = 0.03
    return pn.Scene(model, constraints=loops, laws=laws, q0=q, v0=v), options


def check(seed):
    """Run one mechanism and check its energy ledger."""
    try:
        scene, options = mechanism(seed)
        run = pn.simulate(scene, 0.2, **options)
    except PinNonidealError as error:
        print(f"seed {seed}: {type(error).__name__}: {error}")
        if getattr(error, "trajectory", None) is not None:
            finite(error.trajectory)
        return
    finite(run)
    assert run.t[-1] == 0.2
    energy = run.energy
    size = np.abs(energy["total"]).max() + energy["kinetic"].max() + 1e-3
    gap = np.abs(energy["balance"]).max() / size
    what = f"nv {scene.model.nv}, {options['method']}, {len(run.events)} events"
    print(f"seed {seed}: {what}, violation {run.violation.max():.1e}, balance {gap:.1e}")
    assert run.violation.max() < CLOSURE
    if options["method"] in ("dop853", "dopri5") and not any(e.kind == "chatter" for e in run.events):
        assert gap < BALANCE
    if options["method"] == "moreau":
        return  # its friction opposes the velocity at a step's end; the step's mean may be the other way
    for law in scene.law_names:
        assert np.diff(energy[law]).max(initial=0.0) <= 1e-9 * size  # friction never gives energy


@pytest.mark.parametrize("seed", range(FEW))
def test_mechanism(seed):
    check(seed)


@pytest.mark.stress
@pytest.mark.parametrize("block", range(MANY // BLOCK))
def test_mechanisms(block):
    failed = []
    for seed in range(block * BLOCK, (block + 1) * BLOCK):
        try:
            check(seed)
        except Exception as error:  # all seeds of the block are looked at
            failed.append((seed, repr(error)))
    assert not failed
