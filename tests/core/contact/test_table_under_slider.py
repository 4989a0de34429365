"""Tables at rest on several feet under a slider that moves: the laws alone decide if the feet can hold."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import linprog

import pin_nonideal as pn

GRAVITY, TABLE, SLIDER = 9.81, 2.0, 1.0  # [m/s^2], masses [kg]
STIFFNESS, DAMPING = 60.0, 2.0  # of the spring on the slider [N/m, N s/m]
HEIGHT, RAIL = 0.3, 0.1  # of the table's center above the ground, and of the rail above this center [m]
DT = 1.5 / 1024.0  # [s]
FACETS = 48  # of a cone that approximates Coulomb's cone from inside
SPARE = 0.9  # part of the friction with which forces exist when the feet must hold


@dataclass
class Table:
    """A table of three to six feet with a slider on a rail of random direction, and the load of its feet."""

    seed: int

    def __post_init__(self) -> None:
        rng = np.random.default_rng(self.seed)
        angle = rng.uniform(-3.0, 3.0)
        self.along = np.array([np.cos(angle), np.sin(angle), 0.0])
        count = int(rng.integers(3, 7))
        turns = 2.0 * np.pi * np.arange(count) / count + rng.uniform(-0.3, 0.3, count)
        radii = rng.uniform(0.25, 0.4, count)
        self.feet = np.stack([radii * np.cos(turns), radii * np.sin(turns), np.full(count, -HEIGHT)], axis=1)
        self.mu = rng.uniform(0.2, 0.5, count)
        self.force, self.rate, self.coulomb = rng.uniform(5.0, 25.0), rng.uniform(3.0, 9.0), 1.0
        self.speed = rng.uniform(-1.0, 1.0)

    def scene(self) -> pn.Scene:
        """Return the scene, with a slider that starts at the middle of the rail."""
        model = pin.Model()
        model.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
        table = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "table")
        model.appendBodyToJoint(table, pin.Inertia(TABLE, np.zeros(3), 0.1 * np.eye(3)), pin.SE3.Identity())
        turn = pin.utils.rotate("z", float(np.arctan2(self.along[1], self.along[0])))
        place = pin.SE3(turn, np.array([0.0, 0.0, RAIL]))
        slider = model.addJoint(table, pin.JointModelPX(), place, "slider")
        model.appendBodyToJoint(
            slider, pin.Inertia(SLIDER, np.zeros(3), 0.01 * np.eye(3)), pin.SE3.Identity()
        )
        contacts = []
        for k, (foot, mu) in enumerate(zip(self.feet, self.mu, strict=True)):
            model.addFrame(pin.Frame(f"foot{k}", table, 0, pin.SE3(np.eye(3), foot), pin.FrameType.OP_FRAME))
            contacts.append(pn.PointContact(f"foot{k}", mu=mu, name=f"foot{k}"))

        def torques(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
            return np.append(np.zeros(6), self.force * np.sin(self.rate * t))

        start = {"q0": np.array([0.0, 0.0, HEIGHT, 0.0, 0.0, 0.0, 1.0, 0.0])}
        return pn.Scene(
            model,
            contacts=contacts,
            laws=[pn.JointFriction("slider", coulomb=self.coulomb)],
            forces=[pn.JointSpring("slider", stiffness=STIFFNESS, damping=DAMPING)],
            actuation=torques,
            v0=np.append(np.zeros(6), self.speed),
            **start,
        )

    def holds(self, t: float, x: float, speed: float, spare: float) -> bool:
        """Check if forces within the reduced cones balance the table at rest, for slip of the slider."""
        force = self.force * np.sin(self.rate * t) - STIFFNESS * x - DAMPING * speed
        acceleration = (force - self.coulomb * np.sign(speed)) / SLIDER
        at = np.array([0.0, 0.0, RAIL]) + x * self.along
        weight = np.array([0.0, 0.0, GRAVITY])
        needed = (TABLE + SLIDER) * weight + SLIDER * acceleration * self.along
        moment = np.cross(at, SLIDER * (weight + acceleration * self.along))
        turns = 2.0 * np.pi * np.arange(FACETS) / FACETS
        columns = []
        for foot, mu in zip(self.feet, self.mu, strict=True):
            for turn in turns:
                ray = np.array([spare * mu * np.cos(turn), spare * mu * np.sin(turn), 1.0])
                columns.append(np.append(ray, np.cross(foot, ray)))
        found = linprog(
            np.ones(len(columns)), A_eq=np.array(columns).T, b_eq=np.append(needed, moment), method="highs"
        )
        return bool(found.status == 0)

    def held_until(self, run: pn.Trajectory) -> int:
        """Return the sample before which the feet can hold the table, checked at 50 samples."""
        for k in range(0, len(run.t), len(run.t) // 50):
            if not self.holds(run.t[k], run.q[k, 7], run.v[k, 6], SPARE):
                return max(0, k - len(run.t) // 50)
        return len(run.t)


SEEDS = [*range(8), 36, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(8, 36))]


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("method", ["dop853", "moreau"])
def test_feet_hold_a_table_as_long_as_forces_within_their_cones_can(method: str, seed: int) -> None:
    """Before, the table moved by up to 0.04 m/s in 39 of 60 runs of time stepping."""
    table = Table(seed)
    step = {"dt": DT} if method == "moreau" else {}
    run = pn.simulate(table.scene(), 1.5, method=method, record="forces", output_dt=DT, **step)
    held = table.held_until(run)
    assert np.abs(run.v[:held, :6]).max(initial=0.0) <= 1e-8
    if method == "dop853" and held:
        last = run.t[held - 1]
        assert not [e for e in run.events if e.element != "JointFriction(slider)" and e.time < last]
    # Forces recorded at rest are within the cones, although the joint of the slider rubs.
    assert run.contact_forces is not None
    for k, mu in enumerate(table.mu):
        force = run.contact_forces[f"foot{k}"][:held]
        excess = np.hypot(force[:, 0], force[:, 1]) - mu * force[:, 2]
        assert excess.max(initial=0.0) <= 1e-7 * (TABLE + SLIDER) * GRAVITY
