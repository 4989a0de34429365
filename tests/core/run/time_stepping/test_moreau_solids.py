"""Cylinders, cones and boxes in time stepping: bounded penetration for all mass ratios."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ....geometry.test_cylinder_pairs import distance
from ....support.contact_points import points_of
from ....support.mechanisms import GRAVITY, body, empty
from ....support.seeds import seeds

HERE = pin.SE3.Identity()
FLOOR = coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
DT = 1e-3
# Difference between true shapes and their contacts, in radii of rounding.
ROUNDED_OFF = 6.0


def solid(rng, kinds=("cylinder", "cone", "box")):
    kind, radius, length = rng.choice(kinds), rng.uniform(0.05, 0.3), rng.uniform(0.05, 0.6)
    if kind == "box":
        return coal.Box(*rng.uniform(0.1, 0.5, 3))
    return (coal.Cone if kind == "cone" else coal.Cylinder)(radius, length)


def size(shape):
    """Return the radius of the bounding ball of a shape."""
    if isinstance(shape, coal.Halfspace):
        return 0.0
    if isinstance(shape, coal.Box):
        return float(np.linalg.norm(shape.halfSide))
    return float(np.hypot(shape.radius, shape.halfLength))


class Drop:
    """Random solid above the floor or another solid, nearly flat or in any orientation, with its velocity."""

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        self.thing = solid(rng)
        self.fixed = FLOOR if rng.uniform() < 0.5 else solid(rng)
        self.reach = size(self.thing)
        mass, model, geometry = (
            10.0 ** rng.uniform(-1.0, 1.0),
            empty((0.0, 0.0, -GRAVITY)),
            pin.GeometryModel(),
        )
        about = mass * self.reach**2 * np.diag(rng.uniform(0.25, 0.4, 3))
        joint = body(model, 0, pin.JointModelFreeFlyer(), "free", mass, inertia=about)
        geometry.addGeometryObject(pin.GeometryObject("thing", joint, HERE, self.thing))
        geometry.addGeometryObject(pin.GeometryObject("block", 0, HERE, self.fixed))
        rubs = {"mu": float(rng.uniform(0.0, 1.0)), "restitution": float(rng.choice([0.0, 0.0, 0.4]))}
        contact = pn.GeometryContact("thing", "block", **rubs)
        self.scene = pn.Scene(model, contacts=[contact], collision_model=geometry)
        flat = 0.5 * np.pi * rng.integers(0, 4) * np.eye(3)[rng.integers(3)] + 0.003 * rng.normal(size=3)
        turn = pin.exp3(flat if rng.uniform() < 0.4 else rng.normal(size=3))
        up = self.reach + size(self.fixed) + 0.02
        self.q = np.array([*rng.uniform(-0.1, 0.1, 2), up, *pin.Quaternion(turn).coeffs()])
        down = np.array([*rng.normal(size=2) * 0.5, -rng.uniform(0.0, 4.0)])
        self.v = np.concatenate([turn.T @ down, rng.normal(size=3) * rng.choice([0.0, 1.0, 5.0])])

    def approach(self, v):
        """Return an upper bound of the approach of any point in a step [m]."""
        return DT * (np.linalg.norm(v[:3]) + self.reach * np.linalg.norm(v[3:]) + DT * GRAVITY)

    def depth(self, q):
        return -distance(self.thing, pin.XYZQUATToSE3(q), self.fixed, HERE)

    def check(self):
        run = pn.simulate(self.scene, 0.8, q=self.q, v=self.v, method="moreau", dt=DT)
        assert np.isfinite(run.q).all()
        rounding = max(getattr(c, "radius2", 0.0) for c in points_of(self.scene))
        fastest = 0.0  # maximum so far: penetration lasts until separation
        for q, v in zip(run.q, run.v, strict=True):
            fastest = max(fastest, self.approach(v))
            assert self.depth(q) <= fastest + ROUNDED_OFF * rounding


# In 617 an impact turns another edge into the cylinder within the step. In 979 and 1032 loaded rims with
# restitution sank.
@pytest.mark.parametrize("seed", [*seeds(range(40)), 617, 979, 1032])
def test_random_solids(seed):
    """Penetration by Coal's distance is below the approach in one step, and no run fails."""
    Drop(seed).check()


@pytest.mark.stress
def test_many_random_solids():
    failed = []
    for seed in range(100, 1100):
        try:
            Drop(seed).check()
        except (AssertionError, pn.PinNonidealError) as error:
            failed.append((seed, str(error)[:200]))
    assert failed == []


@pytest.mark.parametrize(
    ("seed", "ratio"),
    [
        *((seed, ratio) for seed in (2, 3, 5) for ratio in (1.0, 1e2, 1e4, 1e6)),
        (20, 1e4),
        (26, 1e6),
    ],
)
def test_a_heavy_box_falls_on_a_light_one(seed, ratio):
    """The light box stands on the floor; an event reports steps without consistent modes at their end."""
    rng, q, height = np.random.default_rng(seed), [], 0.0
    model, geometry = empty((0.0, 0.0, -GRAVITY)), pin.GeometryModel()
    geometry.addGeometryObject(pin.GeometryObject("floor", 0, HERE, FLOOR))
    for k, mass in enumerate((1.0, ratio)):
        x, y, z = edges = rng.uniform(0.15, 0.4, 3)
        about = mass / 12.0 * np.diag([y * y + z * z, x * x + z * z, x * x + y * y])
        joint = body(model, 0, pin.JointModelFreeFlyer(), f"free{k}", mass, inertia=about)
        geometry.addGeometryObject(pin.GeometryObject(f"box{k}", joint, HERE, coal.Box(*edges)))
        height += 0.5 * z + k * (0.5 * np.linalg.norm(edges) + 0.01)
        turn = pin.Quaternion(pin.exp3(0.3 * k * rng.normal(size=3)))
        q += [*(0.05 * k * rng.normal(size=2)), height, *turn.coeffs()]
    pairs = [("box0", "floor"), ("box1", "box0"), ("box1", "floor")]
    contacts = [pn.GeometryContact(*pair, mu=0.3 + 0.4 * (seed % 2)) for pair in pairs]
    scene = pn.Scene(model, contacts=contacts, collision_model=geometry)
    run = pn.simulate(scene, 0.6, q=q, method="moreau", dt=DT)
    assert np.isfinite(run.q).all()
    runner, fastest = scene._compiled.program.runner(), 0.0
    corners = [i for i, c in enumerate(points_of(scene)) if isinstance(c, pn.PointContact)]
    for x, v in zip(run.q, run.v, strict=True):  # box on the floor
        fastest = max(
            fastest, *(np.linalg.norm(u[:3]) + 0.35 * np.linalg.norm(u[3:]) for u in (v[:6], v[6:]))
        )
        assert runner.rows(x, np.zeros(12), 0.0)[2][corners].min() > -DT * (fastest + DT * GRAVITY)


def dominoes(seed: int) -> pn.Scene:
    """Return equal dominoes in a row, of which the first turns about its front edge."""
    rng = np.random.default_rng(seed)
    count, thick, high = int(rng.integers(2, 8)), rng.uniform(0.02, 0.05), rng.uniform(0.15, 0.25)
    wide, apart, spin = rng.uniform(0.05, 0.12), rng.uniform(1.5, 3.0) * thick, rng.uniform(1.5, 4.0)
    mu = rng.uniform(0.1, 0.8)
    model, shapes = empty((0.0, 0.0, -GRAVITY)), pin.GeometryModel()
    shapes.addGeometryObject(pn.ground())
    for k in range(count):
        place = (apart * k, 0.0, 0.5 * high)
        pn.free_body(
            model,
            f"domino {k}",
            coal.Box(thick, wide, high),
            density=500.0,
            collision_model=shapes,
            place=place,
        )
    contacts = pn.ground_contacts(model, shapes, mu=mu)
    contacts += [pn.GeometryContact(f"domino {k + 1}", f"domino {k}", mu=mu) for k in range(count - 1)]
    v = np.zeros(6 * count)
    v[:6] = (0.5 * high * spin, 0.0, 0.5 * thick * spin, 0.0, spin, 0.0)
    return pn.Scene(model, contacts=contacts, collision_model=shapes, v0=v)


def largest_rise(seed):
    """Return the largest rise of the energy in a step, relative to the energy that the dominoes lose."""
    run = pn.simulate(dominoes(seed), 0.8, method="moreau", dt=DT, record="energy")
    total = run.energy["total"]
    return np.diff(total).max() / (total[0] - total.min())


# Speeds of 1e22 and NaN in seeds 2 and 31, and a rise in 56, if the rates of edges are linear in a step.
# A rise in 151, if both side faces of a domino touch corners of the next one.
@pytest.mark.parametrize("seed", [0, 1, 2, 31, 56, 151])
def test_equal_dominoes_fall_and_lose_energy(seed):
    """The edges of equal boxes turn far within a step, and corners of both share places."""
    assert largest_rise(seed) < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(360))
def test_what_turning_edges_add_is_within_the_documented_limit(seed):
    assert largest_rise(seed) < 0.005
