"""Closed forms of contacts at random parameters."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import quad

import pin_nonideal as pn

from ...support.mechanisms import GRAVITY, TIGHT, at, body, decades, empty, frame, planar, point_mass
from ...support.seeds import seeds

DRAWS = 20
TIME = 1e-9  # tolerance of reference times [s]
ROUNDING = 1e-12
SIDE = 1e-9  # distance to a threshold, relative or [rad]

each_draw = pytest.mark.parametrize("draw", seeds(range(DRAWS)))


@each_draw
def test_a_ball_bounces_to_rest(draw):
    """Flight times decrease by the factor e, so that impact times converge; other parameters are random."""
    rng = np.random.default_rng([1, draw])
    e, height, gravity = rng.uniform(0.2, 0.9), decades(rng, 1e-2, 20.0), rng.uniform(1.6, 25.0)
    model = point_mass("Z", mass=decades(rng, 1e-3, 1e3), gravity=(0.0, 0.0, -gravity))
    scene = pn.Scene(model, contacts=[pn.PointContact("mass", restitution=e)], q0=[height])
    first = np.sqrt(2.0 * height / gravity)
    limit = first * (1.0 + e) / (1.0 - e)
    run = pn.simulate(scene, 1.1 * limit)
    impacts = at(run, "impact")[:40]
    flights = 2.0 * first * e ** np.arange(1, len(impacts))
    assert len(impacts) >= 5
    assert impacts == pytest.approx(first + np.concatenate([[0.0], np.cumsum(flights)]), abs=TIME)
    assert at(run, "touch_down") == pytest.approx([limit], abs=TIME)
    assert (run.v[-1] == 0.0).all()
    assert run.stats.steps <= 200


def test_a_hundred_flights():
    """The last flights are a millionth of the trial steps; their impacts also lie on the plane."""
    e, height, gravity = 0.878, 4.54, 5.12
    model = point_mass("Z", gravity=(0.0, 0.0, -gravity))
    scene = pn.Scene(model, contacts=[pn.PointContact("mass", restitution=e)], q0=[height])
    first = np.sqrt(2.0 * height / gravity)
    limit = first * (1.0 + e) / (1.0 - e)
    run = pn.simulate(scene, 1.3 * limit)
    assert at(run, "touch_down") == pytest.approx([limit], abs=TIME)
    bounces = [event for event in run.events if event.kind == "impact"]
    speeds = gravity * first * e ** np.arange(len(bounces))
    assert [-bounce.v_minus[0] for bounce in bounces] == pytest.approx(speeds, rel=1e-4)


@each_draw
def test_a_ladder_leaves_its_wall(draw):
    """The ladder leaves at sin = 2/3 sin of its start, at a time by quadrature of the energy integral."""
    rng = np.random.default_rng([2, draw])
    half, mass, start = decades(rng, 0.2, 5.0), decades(rng, 0.1, 100.0), rng.uniform(0.3, 1.5)
    leaves = np.arcsin(2.0 / 3.0 * np.sin(start))
    # The substitution angle = start - u^2 removes the singularity of the integrand at the start.
    rate = 1.5 * GRAVITY / half
    time, _ = quad(
        lambda u: 2.0 / np.sqrt(rate * np.cos(start - 0.5 * u * u) * np.sinc(0.5 * u * u / np.pi)),
        0.0,
        np.sqrt(start - leaves),
        epsabs=0.0,
        epsrel=1e-13,
    )
    model = planar(mass, mass * half**2 / 3.0, [(-half, 0.0), (half, 0.0)], (0.0, 0.0, -GRAVITY))
    contacts = [pn.PointContact("c0", normal="x", name="wall"), pn.PointContact("c1", name="foot")]
    q0 = [half * np.cos(start), half * np.sin(start), start]
    run = pn.simulate(pn.Scene(model, contacts=contacts, q0=q0), 1.05 * time, **TIGHT)
    assert at(run, "lift_off") == pytest.approx([time], abs=TIME)
    k = int(np.searchsorted(run.t, time - TIME))
    assert run.q[k, 2] == pytest.approx(leaves, abs=TIME)


@each_draw
@pytest.mark.parametrize("side", [-SIDE, SIDE])
def test_a_box_at_its_thresholds(draw, side):
    """The box slides beyond tan = mu, and tips beyond tan = b/h if friction holds it."""
    rng = np.random.default_rng([3, draw])
    b, h, mass = decades(rng, 0.05, 1.0), decades(rng, 0.05, 1.0), decades(rng, 0.1, 100.0)
    ratio, moves = b / h, side > 0.0

    def solve(slope, mu):
        gravity = (GRAVITY * np.sin(slope), 0.0, -GRAVITY * np.cos(slope))
        model = planar(mass, mass * (b * b + h * h) / 3.0, [(-b, -h), (b, -h)], gravity)
        contacts = [pn.PointContact(name, mu=mu) for name in ("c0", "c1")]
        scene = pn.Scene(model, contacts=contacts, q0=[0.0, h, 0.0])
        return scene.solve(scene.q0, scene.v0)

    mu = ratio * rng.uniform(0.2, 0.9)
    assert solve(np.arctan(mu) + side, mu).modes.tolist() == ([1, 1] if moves else [0, 0])
    at_edge = solve(np.arctan(ratio) + side, 2.0 * ratio)
    assert at_edge.closed.tolist() == [not moves, True]
    assert (at_edge.a[2] != 0.0) == moves


@each_draw
def test_a_table(draw):
    """Inside the rhombus of the legs' midpoints minimum-norm loads are linear in the weight's position."""
    rng = np.random.default_rng([4, draw])
    a, b, mass = decades(rng, 0.1, 2.0), decades(rng, 0.1, 2.0), decades(rng, 0.1, 1e3)
    share = rng.uniform(0.0, 0.95)
    x, y = a * share * rng.choice([-1.0, 1.0]), b * rng.uniform(-1.0, 1.0) * (0.95 - share)
    legs = [(u, v) for u in (a, -a) for v in (b, -b)]
    model = empty()
    joint = body(
        model, 0, pin.JointModelFreeFlyer(), "table", mass, lever=(x, y, 0.0), inertia=mass * np.eye(3)
    )
    for k, (u, v) in enumerate(legs):
        frame(model, f"leg {k}", joint, pin.SE3(np.eye(3), np.array([u, v, -0.5])))
    q0 = pin.neutral(model)
    q0[2] = 0.5
    mu = rng.uniform(0.0, 1.0)
    scene = pn.Scene(model, contacts=[pn.PointContact(f"leg {k}", mu=mu) for k in range(4)], q0=q0)
    now = scene.solve(scene.q0, scene.v0)
    weight = mass * GRAVITY
    assert now.lam == pytest.approx(
        [0.25 * weight * (1.0 + x / u + y / v) for u, v in legs], abs=TIME * weight
    )
    assert np.abs(now.a).max() < 1e-10


@each_draw
def test_a_stack(draw):
    """Each body carries the weight above it, at mass ratios from 1/1000 to 1000."""
    rng = np.random.default_rng([5, draw])
    masses = [decades(rng, 1.0, 1e3) for _ in range(rng.integers(2, 7))]
    model = empty()
    for k, mass in enumerate(masses):
        frame(model, f"b{k}", body(model, 0, pin.JointModelPZ(), f"z{k}", mass))
    contacts = [pn.PointContact("b0")] + [
        pn.PointContact(f"b{k}", plane=f"b{k - 1}", radius=0.1) for k in range(1, len(masses))
    ]
    scene = pn.Scene(model, contacts=contacts, q0=0.1 * np.arange(len(masses)))
    now = scene.solve(scene.q0, scene.v0)
    assert now.lam == pytest.approx(GRAVITY * np.cumsum(masses[::-1])[::-1], rel=1e-9)
    run = pn.simulate(scene, 60.0)
    assert np.abs(run.q - run.q[0]).max() < 1e-10


@each_draw
@pytest.mark.parametrize("side", [-SIDE, SIDE])
def test_a_gripper(draw, side):
    """Two fingers hold a block above m g / (2 mu), without creep."""
    rng = np.random.default_rng([6, draw])
    mass, mu, finger = decades(rng, 0.01, 10.0), decades(rng, 0.1, 2.0), decades(rng, 0.01, 10.0)
    force = (1.0 + side) * mass * GRAVITY / (2.0 * mu)
    model = empty()
    joint = body(model, 0, pin.JointModelPX(), "x", 0.0)
    joint = body(model, joint, pin.JointModelPZ(), "z", mass)
    for name, x in (("left", -0.02), ("right", 0.02)):
        place = pin.SE3(np.eye(3), np.array([x, 0.0, 0.0]))
        frame(model, name, joint, place)
        frame(model, f"{name} finger", body(model, 0, pin.JointModelPX(), f"{name} slide", finger), place)
    contacts = [
        pn.PointContact(name, mu=mu, plane=f"{name} finger", normal=(sign, 0.0, 0.0))
        for name, sign in (("left", 1.0), ("right", -1.0))
    ]
    scene = pn.Scene(model, contacts=contacts, actuation=np.array([0.0, 0.0, force, -force]))
    now = scene.solve(scene.q0, scene.v0)
    assert now.a[1] == pytest.approx(min(0.0, side * GRAVITY), abs=ROUNDING)
    assert (now.a[1] == 0.0) == (side > 0.0)
    if side > 0.0:
        run = pn.simulate(scene, 60.0)
        assert (run.q == run.q[0]).all()


@each_draw
def test_percussion(draw):
    """A rod that swings onto a stop at s has the impulse (1 + e) I w / s."""
    rng = np.random.default_rng([7, draw])
    length, mass, speed = decades(rng, 0.1, 10.0), decades(rng, 0.1, 100.0), decades(rng, 0.1, 30.0)
    e, s = rng.uniform(0.0, 1.0), length * rng.uniform(0.1, 1.0)
    model = empty((0.0, 0.0, 0.0))
    inertia = mass * length**2 / 12.0 * np.eye(3)
    joint = body(model, 0, pin.JointModelRY(), "hinge", mass, lever=(0.5 * length, 0.0, 0.0), inertia=inertia)
    frame(model, "hit", joint, pin.SE3(np.eye(3), np.array([s, 0.0, 0.0])))
    scene = pn.Scene(model, contacts=[pn.PointContact("hit", restitution=e)], v0=[speed])
    (impact,) = (event for event in pn.simulate(scene, 0.01).events if event.kind == "impact")
    assert impact.v_plus == pytest.approx([-e * speed], rel=ROUNDING)
    P = (1.0 + e) * mass * length**2 * speed / (3.0 * s)
    assert impact.impulse == pytest.approx([P, 0.0, 0.0], rel=ROUNDING)


@each_draw
def test_a_pendulum_on_its_stop(draw):
    """The times of the first two impacts on a stop are quadratures of the energy integral."""
    rng = np.random.default_rng([8, draw])
    length, start, stop = decades(rng, 0.1, 10.0), rng.uniform(0.5, 1.5), rng.uniform(-0.3, 0.3)
    e, square = rng.uniform(0.3, 1.0), GRAVITY / length

    def half_swing(top):
        """Return the time from rest at the angle `top` to the stop."""
        value, _ = quad(
            lambda u: 2.0 / np.sqrt(square * np.sin(top - 0.5 * u * u) * np.sinc(0.5 * u * u / np.pi) * 2.0),
            0.0,
            np.sqrt(top - stop),
            epsabs=0.0,
            epsrel=1e-13,
        )
        return value

    top = np.arccos(np.cos(stop) - e**2 * (np.cos(stop) - np.cos(start)))
    first = half_swing(start)
    model = empty()
    body(model, 0, pin.JointModelRY(), "swing", decades(rng, 0.1, 100.0), lever=(0.0, 0.0, -length))
    scene = pn.Scene(model, contacts=[pn.JointLimit("swing", lower=stop, restitution=e)], q0=[start])
    run = pn.simulate(scene, first + 2.2 * half_swing(top), **TIGHT)
    assert at(run, "impact")[:2] == pytest.approx([first, first + 2.0 * half_swing(top)], abs=TIME)
