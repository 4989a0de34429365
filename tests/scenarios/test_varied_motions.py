"""Closed forms of motions in contact at random numbers: blocks rock and ride, balls strike and roll."""

from __future__ import annotations

import itertools

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import quad

import pin_nonideal as pn

from ..support.mechanisms import GRAVITY, TIGHT, at, body, decades, empty, frame, planar
from ..support.seeds import seeds

DRAWS = 20
INSTANT = 1e-8  # [s], to which instants of long motions hold
ROUNDING = 1e-12

each_draw = pytest.mark.parametrize("draw", seeds(range(DRAWS)))


def rocking(b, h, mass, angle):
    """A block of these halves on one corner, released at an angle."""
    model = planar(mass, mass * (b * b + h * h) / 3.0, [(-b, -h), (b, -h)])
    contacts = [pn.PointContact(name, mu=10.0) for name in ("c0", "c1")]
    height = h * np.cos(angle) + b * np.sin(angle)
    return pn.Scene(model, contacts=contacts, q0=[0.0, height, -angle])


@each_draw
def test_a_block_rocks_to_rest(draw):
    """Housner's block: each impact leaves r = 1 - 3/2 sin^2 of the speed.  Times are quadratures.

    Between impacts w^2 / 2 = p^2 (cos(alpha - top) - cos(alpha - angle)); the next top has r^2 of the energy.
    """
    rng = np.random.default_rng([11, draw])
    b = decades(rng, 0.05, 1.0)
    h, mass = b * rng.uniform(1.2, 5.0), decades(rng, 0.1, 100.0)
    alpha, square = np.arctan(b / h), 0.75 * GRAVITY / np.hypot(b, h)
    r = 1.0 - 1.5 * np.sin(alpha) ** 2

    def fall(top):
        """From rest at this angle to the floor; the angle is top - u^2, which leaves no root at the start."""

        def integrand(u):
            half = 0.5 * u * u
            return 2.0 / np.sqrt(2.0 * square * np.sin(alpha - top + half) * np.sinc(half / np.pi))

        return quad(integrand, 0.0, np.sqrt(top), epsabs=0.0, epsrel=1e-13)[0]

    top = start = alpha * rng.uniform(0.2, 0.8)
    falls = [fall(top)]
    while top > 1e-9 * alpha:
        energy = 2.0 * r * r * np.sin(alpha - 0.5 * top) * np.sin(0.5 * top)
        top = alpha - np.arccos(np.cos(alpha) + energy)
        falls.append(fall(top))
    instants = np.cumsum([falls[0], *(2.0 * time for time in falls[1:])])
    rest = instants[-1] + 2.0 * falls[-1] * r / (1.0 - r)
    run = pn.simulate(rocking(b, h, mass, start), 1.1 * rest, **TIGHT)
    assert np.unique(at(run, "impact"))[:8] == pytest.approx(instants[:8], abs=INSTANT)
    for impact in [event for event in run.events if event.kind == "impact"][:8]:
        assert impact.v_plus[2] / impact.v_minus[2] == pytest.approx(r, abs=1e-10)
    assert at(run, "touch_down")[-1] == pytest.approx(rest, abs=1e-5)
    assert (run.v[-1] == 0.0).all()


@each_draw
def test_a_squat_block_stops_at_once(draw):
    """The block stops at the first impact if sin^2 of its diagonal is at least 2/3."""
    rng = np.random.default_rng([12, draw])
    b = decades(rng, 0.05, 1.0)
    h = b * rng.uniform(0.2, np.sqrt(0.5))
    scene = rocking(b, h, decades(rng, 0.1, 100.0), np.arctan(b / h) * rng.uniform(0.05, 0.5))
    run = pn.simulate(scene, 3.0 * np.sqrt(np.hypot(b, h)))
    assert len(np.unique(at(run, "impact"))) == 1
    assert (run.v[-1] == 0.0).all()


@each_draw
def test_a_block_dropped_on_a_conveyor(draw):
    """Every bounce adds mu (1 + e) of its speed; the belt is faster than all of them together."""
    rng = np.random.default_rng([13, draw])
    mu, e, height = rng.uniform(0.05, 1.0), rng.uniform(0.1, 0.8), decades(rng, 1e-2, 2.0)
    first = np.sqrt(2.0 * height / GRAVITY)
    dragged = mu * GRAVITY * first * (1.0 + e) / (1.0 - e)
    speed = dragged * rng.uniform(1.02, 2.0)
    model = empty()
    frame(model, "belt", body(model, 0, pin.JointModelPX(), "drive", 1.0))
    joint = body(model, 0, pin.JointModelPX(), "x", 0.0)
    frame(model, "block", body(model, joint, pin.JointModelPZ(), "z", decades(rng, 0.1, 100.0)))
    drive = pn.PrescribedMotion("drive", pn.polynomial([0.0, speed]))
    contact = pn.PointContact("block", mu=mu, plane="belt", restitution=e)
    scene = pn.Scene(
        model, constraints=[drive], contacts=[contact], q0=[0.0, 0.0, height], v0=[speed, 0.0, 0.0]
    )
    lands = first * (1.0 + e) / (1.0 - e)
    sticks = lands + (speed - dragged) / (mu * GRAVITY)
    run = pn.simulate(scene, 1.2 * sticks, **TIGHT)
    impacts = [event for event in run.events if event.kind == "impact"][:6]
    flights = 2.0 * first * e ** np.arange(1, 6)
    assert [event.time for event in impacts] == pytest.approx(
        first + np.concatenate([[0.0], np.cumsum(flights)]), abs=INSTANT
    )
    bounces = GRAVITY * first * e ** np.arange(6)
    assert [event.v_plus[1] for event in impacts] == pytest.approx(
        mu * (1.0 + e) * np.cumsum(bounces), rel=1e-10
    )
    assert at(run, "touch_down") == pytest.approx([lands], abs=INSTANT)
    assert at(run, "stick")[-1] == pytest.approx(sticks, abs=INSTANT)
    assert run.v[-1] == pytest.approx([speed, speed, 0.0], abs=ROUNDING * speed)


def chain(masses, e, gap, speed):
    """Balls of 0.1 m across on a line, the first of which arrives."""
    model = empty((0.0, 0.0, 0.0))
    for k, mass in enumerate(masses):
        frame(model, f"ball {k}", body(model, 0, pin.JointModelPX(), f"x{k}", mass))
    contacts = [
        pn.PointContact(f"ball {k + 1}", plane=f"ball {k}", normal="x", radius=0.1, restitution=e)
        for k in range(len(masses) - 1)
    ]
    places = (0.1 + gap) * np.arange(len(masses))
    return pn.Scene(model, contacts=contacts, q0=places, v0=[speed] + [0.0] * (len(masses) - 1))


@each_draw
def test_a_touching_chain(draw):
    """One impact of all: 0 <= P, u+ + e u- >= 0, P (u+ + e u-) = 0; of all sets that strike one fits."""
    rng = np.random.default_rng([14, draw])
    count, e, speed = rng.integers(2, 7), rng.uniform(0.0, 1.0), decades(rng, 0.1, 10.0)
    masses = np.array([decades(rng, 0.1, 10.0) for _ in range(count)])
    apart = np.diff(np.eye(count), axis=0)
    response = apart @ np.diag(1.0 / masses) @ apart.T
    v = np.array([speed, *np.zeros(count - 1)])
    aim = -(1.0 + e) * (apart @ v)
    fits = []
    for mask in itertools.product([False, True], repeat=count - 1):
        strikes = np.array(mask)
        P = np.zeros(count - 1)
        P[strikes] = np.linalg.solve(response[np.ix_(strikes, strikes)], aim[strikes])
        if (P >= 0.0).all() and (response @ P - aim >= -ROUNDING * speed).all():
            fits.append(P)
    after = v + apart.T @ fits[-1] / masses
    run = pn.simulate(chain(masses, e, 0.0, speed), 1e-6)
    first = next(event for event in run.events if event.kind == "impact")
    assert first.time == 0.0
    assert run.v[np.searchsorted(run.t, 0.0, side="right") - 1] == pytest.approx(after, abs=ROUNDING * speed)


@each_draw
def test_a_chain_with_gaps(draw):
    """Balls strike two by two, in the order of their flights."""
    rng = np.random.default_rng([15, draw])
    count, e, speed = int(rng.integers(2, 7)), rng.uniform(0.3, 1.0), decades(rng, 0.1, 10.0)
    masses, gap = np.array([decades(rng, 0.3, 3.0) for _ in range(count)]), decades(rng, 1e-3, 0.1)
    x, v = (
        gap * np.arange(count),
        np.array([speed, *np.zeros(count - 1)]),
    )  # positions as points, without the balls' size
    time, instants = 0.0, []
    while len(instants) < 10 and (np.diff(v) < 0.0).any():
        closing = -np.diff(v)
        waits = np.where(closing > 0.0, np.diff(x) / np.where(closing > 0.0, closing, 1.0), np.inf)
        k = int(waits.argmin())
        time, x = time + waits[k], x + waits[k] * v
        shared = masses[k] * masses[k + 1] / (masses[k] + masses[k + 1])
        P = (1.0 + e) * shared * closing[k]
        x[k + 1] = x[k]
        v[k], v[k + 1] = v[k] - P / masses[k], v[k + 1] + P / masses[k + 1]
        instants.append(time)
    more = np.diff(v)
    later = np.min(np.diff(x)[more < 0.0] / -more[more < 0.0]) if (more < 0.0).any() else time
    run = pn.simulate(chain(masses, e, gap, speed), time + 0.5 * later)
    assert at(run, "impact") == pytest.approx(instants, rel=1e-10)
    assert run.v[-1] == pytest.approx(v, abs=ROUNDING * speed)


@each_draw
def test_a_ball_slides_to_rolling(draw):
    """On a slope, with any inertia c m r^2: its slip falls at mu g cos (1 + 1 / c) - g sin until it rolls."""
    rng = np.random.default_rng([16, draw])
    slope, c, r = rng.uniform(-0.5, 0.5), rng.uniform(0.2, 1.0), decades(rng, 0.02, 1.0)
    mass, speed = decades(rng, 0.1, 100.0), decades(rng, 0.1, 10.0)
    along, normal = GRAVITY * np.sin(slope), GRAVITY * np.cos(slope)
    mu = abs(np.tan(slope)) * c / (1.0 + c) * rng.uniform(1.1, 2.0) + rng.uniform(0.05, 0.5)
    turn = rng.uniform(-1.0, 0.9) * speed / r
    slip = speed - r * turn
    model = planar(mass, c * mass * r * r, [(0.0, 0.0)], (along, 0.0, -normal))
    scene = pn.Scene(
        model, contacts=[pn.PointContact("c0", radius=r, mu=mu)], q0=[0.0, r, 0.0], v0=[speed, 0.0, turn]
    )
    grips = slip / (mu * normal * (1.0 + 1.0 / c) - along)
    a = along - mu * normal
    run = pn.simulate(scene, 2.0 * grips, **TIGHT)
    assert at(run, "stick") == pytest.approx([grips], rel=1e-9)
    rolls = speed + a * grips
    k = int(np.searchsorted(run.t, grips * (1.0 - 1e-9)))
    scale = max(speed, abs(rolls))
    assert run.v[k, [0, 2]] == pytest.approx([rolls, rolls / r], abs=1e-9 * scale / min(r, 1.0))
    end = rolls + along / (1.0 + c) * grips
    x = (speed + 0.5 * a * grips) * grips + 0.5 * (rolls + end) * grips
    assert run.v[-1, 0] == pytest.approx(end, abs=1e-9 * scale)
    assert run.q[-1, 0] == pytest.approx(x, abs=1e-9 * scale * grips)


@each_draw
def test_a_cylinder_spins_in_a_groove(draw):
    """Friction at both walls stops the cylinder, and its axis does not move."""
    rng = np.random.default_rng([17, draw])
    wall, R, mass = rng.uniform(0.5, 1.0), decades(rng, 0.01, 1.0), decades(rng, 0.1, 100.0)
    spin = decades(rng, 1.0, 100.0)
    normals = {
        name: np.array([side * np.sin(wall), np.cos(wall)]) for name, side in (("left", 1.0), ("right", -1.0))
    }
    # Turning about +y moves the lowest point to -x: friction pushes it toward +x.
    tangents = {name: np.array([n[1], -n[0]]) for name, n in normals.items()}

    def loads(mu):
        columns = [normals[name] + mu * tangents[name] for name in ("left", "right")]
        return np.linalg.solve(np.array(columns).T, [0.0, mass * GRAVITY])

    mu = rng.uniform(0.05, 1.0)
    while min(loads(mu)) < 0.05 * mass * GRAVITY:
        mu *= 0.7
    model = planar(mass, 0.5 * mass * R * R, [(0.0, 0.0)])
    contacts = [
        pn.PointContact("c0", radius=R, mu=mu, normal=(n[0], 0.0, n[1]), name=name)
        for name, n in normals.items()
    ]
    scene = pn.Scene(model, contacts=contacts, q0=[0.0, R / np.cos(wall), 0.0], v0=[0.0, 0.0, spin])
    now = scene.solve(scene.q0, scene.v0)
    N = loads(mu)
    measured = [now.lam[scene.constraint_slices[name]][0] for name in ("left", "right")]
    assert sorted(measured) == pytest.approx(sorted(N), rel=1e-10)
    slows = mu * N.sum() / (0.5 * mass * R)
    assert now.a == pytest.approx([0.0, 0.0, -slows], abs=1e-10 * slows)
    run = pn.simulate(scene, 1.5 * spin / slows, **TIGHT)
    assert at(run, "stick")[0] == pytest.approx(spin / slows, rel=1e-9)
    assert (run.v[-1] == 0.0).all()
    assert np.abs(run.q[:, :2] - run.q[0, :2]).max() < ROUNDING * R / np.cos(wall)


@each_draw
def test_balls_roll_on_a_pushed_box(draw):
    """SimBenchmark's scene in the plane: the box slides on the ground, balls of any inertia roll on it."""
    rng = np.random.default_rng([18, draw])
    count, box, ball = int(rng.integers(1, 5)), decades(rng, 1.0, 100.0), decades(rng, 0.1, 10.0)
    r, c, ground = decades(rng, 0.05, 1.0), rng.uniform(0.2, 1.0), rng.uniform(0.1, 0.8)
    dry = ground * (box + count * ball) * GRAVITY
    push = dry * rng.uniform(1.05, 1.5)
    grip = (push - dry) / box / ((1.0 + 1.0 / c) / ball + count / box)
    model = empty()
    joint = body(model, 0, pin.JointModelPX(), "x", 0.0)
    joint = body(model, joint, pin.JointModelPZ(), "z", box)
    frame(model, "box", joint)
    contacts = [pn.PointContact("box", mu=ground, name="ground")]
    q0, tau = [0.0, 0.0], [push, 0.0]
    for k in range(count):
        ball_x = body(model, 0, pin.JointModelPX(), f"x{k}", 0.0)
        ball_z = body(model, ball_x, pin.JointModelPZ(), f"z{k}", 0.0)
        turn = body(model, ball_z, pin.JointModelRY(), f"turn{k}", ball, inertia=c * ball * r * r * np.eye(3))
        frame(model, f"ball {k}", turn)
        contacts.append(
            pn.PointContact(f"ball {k}", plane="box", radius=r, mu=2.0 * grip / (ball * GRAVITY) + 0.1)
        )
        q0 += [3.0 * r * k, r, 0.0]
        tau += [0.0] * 3
    seconds = 2.0
    run = pn.simulate(pn.Scene(model, contacts=contacts, actuation=np.array(tau), q0=q0), seconds)
    pushed, rolled = (push - dry - count * grip) / box * seconds, grip / ball * seconds
    assert run.v[-1, 0] == pytest.approx(pushed, rel=INSTANT)
    for k in range(count):
        assert run.v[-1, 2 + 3 * k] == pytest.approx(rolled, rel=INSTANT)
