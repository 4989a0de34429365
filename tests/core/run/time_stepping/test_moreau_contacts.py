"""Time stepping with unilateral contacts: order, rest without creep, bounces, penetration, ledger."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ....support.mechanisms import GRAVITY, body, empty, frame, point_mass
from ....support.same_run import assert_same_run


def box(mu, angle=0.0, restitution=0.0):
    """Return a box of 0.4 x 0.2 x 0.2 m on a slope of this angle."""
    model = empty((GRAVITY * np.sin(angle), 0.0, -GRAVITY * np.cos(angle)))
    joint = body(model, 0, pin.JointModelFreeFlyer(), "box", 2.0, inertia=np.diag([0.013, 0.033, 0.033]))
    frame(model, "middle", joint)
    corners = pn.box_contacts("middle", (0.4, 0.2, 0.2), mu=mu, restitution=restitution)
    return pn.Scene(model, contacts=corners)


# Violation of the laws at the corners of a foot, which redundancy makes inconsistent, over velocities.
UNCHANGEABLE = 1e-7
# Relative error of an impulse that is summed up from force samples, one per step.
STEPPED = 0.05

# Number of feet, friction, and lever arms of torsional and rolling resistance [m].
TURNED = [(2, 0.7, 0.05, 0.02), (3, 0.3, 0.0, 0.002), (3, 0.7, 0.005, 0.002), (4, 0.7, 0.005, 0.002)]

ON_PLANE = [0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0]


def test_a_sliding_box_has_order_one():
    """x = v t - mu g t^2 / 2 up to its stop, and rest after; the error falls as the step."""
    stop = 1.0 / (2.0 * 0.5 * GRAVITY)
    errors = []
    steps = np.array([7e-3, 3.5e-3, 1.75e-3, 0.875e-3]) / np.pi
    for dt in steps:
        run = pn.simulate(box(0.5), 0.5, q=ON_PLANE, v=[1.0, 0, 0, 0, 0, 0], method="moreau", dt=dt)
        errors.append(abs(run.q[-1, 0] - stop))
        assert np.abs(run.v[-1]).max() == 0.0
    assert max(errors / steps) < 1.0  # [m/s]: change of motion in a step


def test_landings_are_of_order_one():
    """The mean error of many drop heights has order one, since impacts occur anywhere in a step."""
    contact = pn.PointContact("mass", restitution=0.7)
    scene = pn.Scene(point_mass("Z"), contacts=[contact])
    steps, errors = 4e-3 / 2.0 ** np.arange(6), []
    heights = np.linspace(0.8, 1.2, 40)
    for dt in steps:
        missed = []
        for height in heights:
            run = pn.simulate(scene, 1.5, q=[height], method="moreau", dt=dt)
            missed.append(abs(run.q[-1, 0] - bounced(height, 0.7, 1.5)))
        errors.append(np.mean(missed))
    order = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert 0.9 < order < 1.1, errors


def bounced(height, restitution, duration):
    """Return the height of a dropped ball after this time."""
    speed = np.sqrt(2.0 * GRAVITY * height)
    left = duration - speed / GRAVITY
    while left > 0.0:
        speed *= restitution
        flight = 2.0 * speed / GRAVITY
        if left < flight:
            return speed * left - 0.5 * GRAVITY * left**2
        left -= flight
    return height - 0.5 * GRAVITY * duration**2


def test_a_tumbling_drop_converges_with_order_one():
    """A box lands on one corner with e = 0; the reference is the event-driven run."""
    scene = box(0.6)
    turned = pin.Quaternion(pin.rpy.rpyToMatrix(0.3, 0.5, 0.2)).coeffs()
    q = np.concatenate([[0.0, 0.0, 0.35], turned])
    exact = pn.simulate(scene, 0.2, q=q, rtol=1e-10, atol=1e-10)
    steps = 4e-3 / 2.0 ** np.arange(5)
    errors = []
    for dt in steps:
        run = pn.simulate(scene, 0.2, q=q, method="moreau", dt=dt)
        errors.append(np.abs(run.q[-1] - exact.q[-1]).max())
    order = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert 0.8 < order < 1.3, errors


@pytest.mark.parametrize(("slope", "rests"), [(0.5 - 1e-9, True), (0.5 + 1e-6, False)])
def test_a_box_on_a_slope_rests_or_slides(slope, rests):
    run = pn.simulate(box(0.5, np.arctan(slope)), 2.0, q=ON_PLANE, method="moreau", dt=1e-3)
    moved = np.abs(run.q[-1] - ON_PLANE).max()
    if rests:
        assert np.abs(run.v).max() < 1e-14
        assert moved < 1e-12
    else:
        assert moved > 1e-7


@pytest.mark.parametrize("feet", [4, 6, 8, 12])
def test_a_pushed_table_slides(feet):
    """The loads of feet on a circle are not unique, but v = (F / m - mu g) t for all of them."""
    model = empty()
    joint = body(model, 0, pin.JointModelFreeFlyer(), "table", 10.0, inertia=0.3 * np.eye(3))
    turn = 2.0 * np.pi * np.arange(feet) / feet
    places = np.column_stack([0.3 * np.cos(turn), 0.3 * np.sin(turn), np.full(feet, -0.3)])
    for k, place in enumerate(places):
        frame(model, f"foot {k}", joint, pin.SE3(np.eye(3), place))
    frame(model, "middle", joint)
    mu, push, duration = 0.7, 90.0, 0.5
    contacts = [pn.PointContact(f"foot {k}", mu=mu) for k in range(feet)]
    forces = [pn.Wrench("middle", [push, 0, 0, 0, 0, 0])]
    scene = pn.Scene(model, contacts=contacts, forces=forces)
    q = [0.0, 0.0, 0.3, 0.0, 0.0, 0.0, 1.0]
    run = pn.simulate(scene, duration, q=q, method="moreau", dt=1e-3, output_dt=0.05, record="energy")
    rate = push / 10.0 - mu * GRAVITY
    rounding = 1e-12  # rounding of several hundred steps [m/s and m]
    assert np.abs(run.v[:, 0] - rate * run.t).max() < rounding
    assert np.abs(run.q[:, 0] - 0.5 * rate * run.t**2).max() < rounding
    assert np.abs(run.v[:, 1:]).max() < rounding
    assert np.abs(run.energy["balance"]).max() < 1e-10
    assert max(run.stats.signorini, run.stats.coulomb, run.stats.dissipation) < 1e-10


def random_table(rng):
    """Return a table on 4 to 12 feet that a random force and couple move from rest."""
    feet, model = int(rng.integers(4, 13)), empty()
    joint = body(model, 0, pin.JointModelFreeFlyer(), "table", 10.0, inertia=0.3 * np.eye(3))
    turn = np.sort(rng.uniform(0.0, 2.0 * np.pi, feet))
    places = np.column_stack([0.3 * np.cos(turn), 0.3 * np.sin(turn), np.full(feet, -0.3)])
    for k, place in enumerate([*places, np.array([0.05, 0.02, -0.25])]):
        frame(model, f"at {k}", joint, pin.SE3(np.eye(3), place))
    contacts = [pn.PointContact(f"at {k}", mu=0.7, static_ratio=1.0) for k in range(feet)]
    push = [*rng.uniform(-100.0, 100.0, 2), 0.0, 0.0, 0.0, rng.uniform(-8.0, 8.0)]
    q0 = [0.0, 0.0, 0.3, 0.0, 0.0, 0.0, 1.0]
    return pn.Scene(model, contacts=contacts, forces=[pn.Wrench(f"at {feet}", push)], q0=q0)


@pytest.mark.parametrize("count", [4, pytest.param(20, marks=pytest.mark.slow)])
def test_random_tables_slide_without_a_halt(count):
    """On 4 to 12 feet, numerical dissipation is far below the kinetic energy of several joules."""
    rng, taken = np.random.default_rng(0), []
    for _ in range(count):
        scene = random_table(rng)
        run = pn.simulate(scene, 0.3, method="moreau", dt=1e-3, output_dt=0.3, record="energy")
        taken.append(np.abs(run.energy["projection"]).max())
    assert max(taken) < 1e-4  # [J]; a foot that wrongly sticks dissipates up to 2 J


@pytest.mark.parametrize("count", [5, pytest.param(60, marks=pytest.mark.slow)])
def test_tables_share_their_load_as_in_event_driven_runs(count):
    """The friction of a table that turns depends on the loads of its feet: 4 to 12 forces, 3 equations."""
    rng = np.random.default_rng(1)
    for _ in range(count):
        scene = random_table(rng)
        events = pn.simulate(scene, 0.2, progress=False)
        steps = pn.simulate(scene, 0.2, method="moreau", dt=1e-3, progress=False)
        if events.closed.all():  # a tilted table lands with an impact
            assert steps.closed.all()
            np.testing.assert_allclose(steps.v[-1], events.v[-1], atol=5e-3)


@pytest.mark.parametrize("count", [3, 30])
def test_contacts_far_off_change_no_bit(count):
    """A rotating pendulum reaches one floor; other floors are too far away."""
    model = empty()
    half, whole = np.array([0.0, 0.0, -0.5]), pin.SE3(np.eye(3), np.array([0.0, 0.0, -1.0]))
    rod = {"lever": half, "inertia": np.diag([0.08, 0.08, 0.01])}
    upper = body(model, 0, pin.JointModelRY(), "upper", 1.0, **rod)
    lower = body(model, upper, pin.JointModelRY(), "lower", 1.0, place=whole, **rod)
    frame(model, "tip", lower, whole)
    near = pn.PointContact("tip", mu=0.1, height=-1.5, restitution=0.3)
    far = [pn.PointContact("tip", mu=0.5, height=-2.1 - 0.1 * k, name=f"far {k}") for k in range(count)]
    runs = [
        pn.simulate(pn.Scene(model, contacts=contacts), 2.0, q=[1.9, 0.2], method="moreau", dt=1e-3)
        for contacts in ([near], [near, *far])
    ]
    assert len(runs[0].events) >= 2
    assert np.array_equal(runs[0].q, runs[1].q)
    assert np.array_equal(runs[0].v, runs[1].v)


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_a_ball_bounces_and_rests(restitution):
    contact = pn.PointContact("mass", restitution=restitution)
    scene = pn.Scene(point_mass("Z"), contacts=[contact], q0=[1.0])
    run = pn.simulate(scene, 4.0, method="moreau", dt=1e-3, record="energy")
    fall = np.sqrt(2.0 / GRAVITY)
    landed = run.t[1:][np.argmax(np.diff(run.v[:, 0]) > 0.0)]
    assert landed == pytest.approx(fall, abs=2e-3)
    assert run.q.min() >= -1e-3 * np.sqrt(2.0 * GRAVITY)  # approach in one step
    height = run.q[run.t > landed + 1e-6, 0].max()
    assert height == pytest.approx(restitution**2, abs=0.02)
    assert abs(run.q[-1, 0]) < 1e-9
    assert run.v[-1, 0] == 0.0
    assert run.energy["impacts"][-1] < 0.0
    assert np.abs(run.energy["balance"]).max() < 1e-9
    assert max(run.stats.signorini, run.stats.coulomb, run.stats.dissipation) < 1e-10


def test_a_resumed_run_is_bitwise_the_same(kept, tmp_path):
    scene = box(0.6)
    q = np.concatenate([[0.0, 0.0, 0.35], pin.Quaternion(pin.rpy.rpyToMatrix(0.3, 0.5, 0.2)).coeffs()])
    path, options = tmp_path / "run", {"q": q, "method": "moreau", "dt": 2e-3, "record": ("energy", "forces")}
    whole = pn.simulate(scene, 0.6, **options)
    assert_same_run(whole, pn.simulate(scene, 0.6, checkpoint=path, checkpoint_interval=0.0, **options))
    states = list(kept)
    for k in np.linspace(0, len(states) - 1, 8).astype(int):
        path.write_bytes(states[k])
        assert_same_run(whole, pn.resume(path, scene, checkpoint_interval=1e9))


@pytest.mark.parametrize("count", [20, pytest.param(1000, marks=pytest.mark.stress)])
def test_random_bodies_dropped(count):
    """1 to 8 points of a body fall on a plane: no NaN, no hang, penetration below one step's approach."""
    rng = np.random.default_rng(0)
    deepest, failed = 0.0, []
    for k in range(count):
        model = empty()
        inertia = np.diag(rng.uniform(0.2, 1.0, 3)) * 0.05
        mass = float(10.0 ** rng.uniform(-2, 2))
        joint = body(model, 0, pin.JointModelFreeFlyer(), "base", mass, inertia=mass * inertia)
        frame(model, "middle", joint)
        places = rng.uniform(-0.2, 0.2, (int(rng.integers(1, 9)), 3))
        mus, restitutions = rng.uniform(0, 1.2, len(places)), rng.uniform(0, 0.8, len(places))
        contacts = [
            pn.PointContact("middle", mu, offset=tuple(p), restitution=e, name=f"c{i}")
            for i, (p, mu, e) in enumerate(zip(places, mus, restitutions, strict=True))
        ]
        turn = pin.Quaternion(pin.exp3(rng.standard_normal(3))).coeffs()
        q, v = np.concatenate([[0.0, 0.0, 0.5], turn]), rng.standard_normal(6)
        dt = 2e-3
        try:
            run = pn.simulate(pn.Scene(model, contacts=contacts), 1.0, q=q, v=v, method="moreau", dt=dt)
        except pn.RunError as error:
            failed.append((k, str(error)))
            continue
        assert np.isfinite(run.q).all()
        R = [pin.XYZQUATToSE3(x) for x in run.q]
        depths = np.array([[-(M * p)[2] for p in places] for M in R])
        fastest = np.abs(run.v[:, :3]).max() + 0.4 * np.abs(run.v[:, 3:]).max()
        deepest = max(deepest, depths.max() / (fastest * dt))
    print(f"{count} bodies: deepest penetration {deepest:.2f} of one step's approach; failed: {failed}")
    assert failed == []
    assert deepest <= 1.0


@pytest.mark.parametrize("seed", [1, 2])
def test_a_humanoid_lands_on_its_soles(seed):
    """Corners of soles and dry joint friction share the loads; the violation is reported and small.

    The impulse of the ground equals the impulse of gravity plus the change of momentum.
    """
    robot, soles, edges = pn.load("talos"), ("left_sole_link", "right_sole_link"), np.array([0.2, 0.1, 0.02])
    model, data = robot.model, robot.model.createData()
    bent = np.concatenate([np.zeros(6), 0.02 * np.random.default_rng(seed).standard_normal(model.nv - 6)])
    q0, v0 = pin.integrate(model, robot.q0, bent), np.zeros(model.nv)
    pin.framesForwardKinematics(model, data, q0)
    corners = [0.5 * edges * np.array([x, y, -1.0]) for x in (-1.0, 1.0) for y in (-1.0, 1.0)]
    q0[2] += 1e-3 - min((data.oMf[model.getFrameId(s)] * c)[2] for s in soles for c in corners)
    scene = pn.Scene(
        model,
        contacts=[contact for sole in soles for contact in pn.box_contacts(sole, edges, mu=0.6)],
        laws=[pn.JointFriction(str(name), coulomb=20.0) for name in list(model.names)[2:]],
        actuation=pn.HoldPosition(kp=500.0, kd=20.0),
        q0=robot.q0,
    )
    dt = 1e-3
    run = pn.simulate(scene, 0.3, q0, v0, method="moreau", dt=dt, record=["forces"])
    assert max(run.stats.signorini, run.stats.coulomb, run.stats.dissipation) < UNCHANGEABLE
    momentum = [
        pin.computeCentroidalMomentum(model, data, q, v).linear for q, v in zip(run.q, run.v, strict=True)
    ]
    given = dt * sum(run.contact_forces[name][1:].sum(axis=0) for name in scene.contact_names)
    gained = momentum[-1] - momentum[0] - 0.3 * pin.computeTotalMass(model) * model.gravity.linear
    np.testing.assert_allclose(given, gained, atol=STEPPED * np.linalg.norm(gained))


def at(place):
    return pin.SE3(np.eye(3), np.array(place))


@pytest.mark.parametrize("method", ["moreau", "rk4"])
@pytest.mark.parametrize("height", [-0.25, 0.0])
@pytest.mark.parametrize("feet", [3, 6, 7, 8, 9])
def test_feet_that_carry_nothing_slide_with_the_others(feet, height, method):
    """x = a t^2 / 2 under a force above mu m g; some of many feet in a plane have zero load."""
    model, mass, mu, push = empty((0.0, 0.0, -GRAVITY)), 10.0, 0.7, 90.0
    table = body(model, 0, pin.JointModelFreeFlyer(), "table", mass, inertia=0.3 * np.eye(3))
    turn = 2.0 * np.pi * np.arange(feet) / feet
    for k, angle in enumerate(turn):
        frame(model, f"foot {k}", table, at([0.3 * np.cos(angle), 0.3 * np.sin(angle), -0.3]))
    frame(model, "pushed", table, at([0.0, 0.0, height]))
    contacts = [pn.PointContact(f"foot {k}", mu=mu, static_ratio=1.0) for k in range(feet)]
    scene = pn.Scene(model, contacts=contacts, forces=[pn.Wrench("pushed", [push, 0.0, 0.0, 0.0, 0.0, 0.0])])
    run = pn.simulate(
        scene, 0.5, q=[0.0, 0.0, 0.3, 0.0, 0.0, 0.0, 1.0], v=np.zeros(6), method=method, dt=1e-3
    )
    slid = 0.5 * (push / mass - mu * GRAVITY) * run.t**2
    np.testing.assert_allclose(run.q[:, 0], slid, atol=1e-3 * slid[-1])
    assert run.q[:, 2] == pytest.approx(0.3, abs=1e-9)


@pytest.mark.parametrize("dt", [1e-3, 5e-4, 2.5e-4])
@pytest.mark.parametrize(("feet", "mu", "torsional", "rolling"), TURNED)
def test_feet_that_resist_turning_come_to_rest(feet, mu, torsional, rolling, dt):
    """A table slides, rotates and drops onto one or two feet; resistance is load-dependent."""
    model = empty()
    joint = body(model, 0, pin.JointModelFreeFlyer(), "table", 2.0, inertia=0.05 * np.eye(3))
    resists = {"mu": mu, "torsional": torsional, "rolling": rolling}
    contacts = []
    for k, angle in enumerate(2.0 * np.pi * np.arange(feet) / feet):
        place = np.array([0.3 * np.cos(angle), 0.3 * np.sin(angle), -0.05])
        frame(model, f"f{k}", joint, pin.SE3(np.eye(3), place))
        contacts.append(pn.PointContact(f"f{k}", **resists))
    scene = pn.Scene(model, contacts=contacts, q0=[0, 0, 0.05, 0, 0, 0, 1], v0=[0.3, 0.2, 0, 0.1, 0.2, 1.0])
    run = pn.simulate(scene, 0.5, method="moreau", dt=dt)
    assert np.abs(run.v[-1]).max() == 0.0
    for miss in (run.stats.signorini, run.stats.coulomb, run.stats.dissipation):
        assert miss < UNCHANGEABLE
