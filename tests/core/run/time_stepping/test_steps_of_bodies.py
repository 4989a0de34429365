"""Time stepping of free bodies: momentum of collisions, thin plates, ends of steps, samples."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ....support.seeds import seeds

DT = 1e-3
PASSED_EDGES = {(182, 0.5)}
GAIN = 1e-2  # largest gain of a step, by the turn of normals within it, relative to the energy


def bodies(rng, shapes, gravity=0.0):
    """Return a model of free bodies with shapes of random mass, and its collision model."""
    model, geometry = pin.Model(), pin.GeometryModel()
    model.gravity.linear = np.array([0.0, 0.0, -gravity])
    for k, shape in enumerate(shapes):
        pn.free_body(model, f"body{k}", shape, mass=10.0 ** rng.uniform(-1.0, 1.0), collision_model=geometry)
    return model, geometry


def random_shape(rng):
    a, b = rng.uniform(0.05, 0.2), rng.uniform(0.1, 0.4)
    kinds = (
        lambda: coal.Sphere(a),
        lambda: coal.Capsule(a, b),
        lambda: coal.Box(*rng.uniform(0.1, 0.4, 3)),
        lambda: coal.Cylinder(a, b),
        lambda: coal.Cone(a, b),
    )
    return kinds[rng.integers(len(kinds))]()


@pytest.mark.parametrize("seed", seeds(range(60)))
def test_collisions_keep_the_linear_momentum(seed):
    """Impulses on two bodies are equal and opposite, whatever the projection moves."""
    rng = np.random.default_rng(seed)
    model, geometry = bodies(rng, [random_shape(rng) for _ in range(2)])
    restitution = rng.choice([0.0, 0.5, 1.0])
    contact = pn.GeometryContact("body0", "body1", mu=0.5 * (restitution == 0.0), restitution=restitution)
    scene = pn.Scene(model, contacts=[contact], collision_model=geometry)
    way = np.linalg.qr(rng.normal(size=(3, 3)))[0][0]
    speed, q, v = rng.uniform(0.5, 5.0), [], []
    for side in (1.0, -1.0):
        turn = pin.exp3(rng.normal(size=3))
        q += [*(0.45 * side * way + 0.03 * rng.normal(size=3)), *pin.Quaternion(turn).coeffs()]
        v += [*(-side * speed * turn.T @ way), *rng.normal(size=3)]
    run = pn.simulate(scene, 1.5 / speed, q=q, v=v, method="moreau", dt=DT)
    data = model.createData()
    momenta = []
    for x, u in zip(run.q, run.v, strict=True):
        pin.computeCentroidalMomentum(model, data, x, u)
        momenta.append(data.hg.linear.copy())
    scale = sum(inertia.mass for inertia in model.inertias) * speed
    assert np.abs(np.array(momenta) - momenta[0]).max() <= 1e-11 * scale


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("seed", seeds(range(200), always=[10, 61, 75]))
def test_spinning_boxes_that_strike_gain_no_energy(seed, restitution):
    """Corners sink by millimeters in a step, and edges behind them meet the other body's edges from inside.

    Spins are up to 150 rad/s, so that a box turns by 0.1 rad in a step.
    """
    if (seed, restitution) in PASSED_EDGES:
        pytest.xfail("an edge passes another one within a step, see limits.md")
    rng = np.random.default_rng(seed)
    shapes, masses = [], []
    for _ in range(2):
        shapes.append(coal.Box(*rng.uniform(0.05, 0.2, 3)))
        masses.append(10.0 ** rng.uniform(-1.0, 1.0))
    model, geometry = pin.Model(), pin.GeometryModel()
    model.gravity.linear[:] = 0.0
    for k, (shape, mass) in enumerate(zip(shapes, masses, strict=True)):
        pn.free_body(model, f"body{k}", shape, mass=mass, collision_model=geometry)
    contact = pn.GeometryContact("body0", "body1", restitution=restitution)
    scene = pn.Scene(model, contacts=[contact], collision_model=geometry)
    way = np.linalg.qr(rng.normal(size=(3, 3)))[0][0]
    speed, q, v = rng.uniform(0.5, 5.0), [], []
    for side in (1.0, -1.0):
        turn = pin.exp3(rng.normal(size=3))
        q += [*(0.25 * side * way + 0.01 * rng.normal(size=3)), *pin.Quaternion(turn).coeffs()]
        v += [*(-side * speed * turn.T @ way), *(rng.uniform(5.0, 50.0) * rng.normal(size=3))]
    run = pn.simulate(scene, 0.6 / speed, q=q, v=v, method="moreau", dt=DT)
    data = model.createData()
    energy = [pin.computeKineticEnergy(model, data, x, u) for x, u in zip(run.q, run.v, strict=True)]
    assert np.diff(energy).max() <= GAIN * energy[0]


@pytest.mark.parametrize("shape", [coal.Sphere(0.03), coal.Box(0.05, 0.05, 0.05)], ids=["ball", "box"])
@pytest.mark.parametrize("seed", seeds(range(40)))
def test_no_body_passes_a_thin_plate(seed, shape):
    rng = np.random.default_rng(seed)
    model, geometry = bodies(rng, [shape])
    plate = pin.GeometryObject("plate", 0, pin.SE3.Identity(), coal.Box(0.6, 0.6, 2e-3))
    geometry.addGeometryObject(plate)
    contact = pn.GeometryContact("body0", "plate", mu=0.3)
    scene = pn.Scene(model, contacts=[contact], collision_model=geometry)
    turn, speed = pin.exp3(rng.normal(size=3)), 10.0 ** rng.uniform(0.0, 1.6)
    down = turn.T @ np.array([*(0.2 * speed * rng.uniform(-1.0, 1.0, 2)), -speed])
    q = [*rng.uniform(-0.1, 0.1, 2), 0.1 + rng.uniform(0.0, DT) * speed, *pin.Quaternion(turn).coeffs()]
    v = [*down, *(3.0 * rng.normal(size=3))]
    run = pn.simulate(scene, 0.2 / speed + 0.02, q=q, v=v, method="moreau", dt=DT, record="energy")
    assert run.q[:, 2].min() > -1e-3
    assert run.energy["total"].max() <= run.energy["total"][0] * (1.0 + 1e-6)


def test_a_corner_beside_an_edge_is_stopped_by_the_face():
    """Aligned boxes meet with corners 2 mm inside a side face: no step may pass the nearer face."""
    rng = np.random.default_rng(0)
    model, geometry = bodies(rng, [coal.Box(0.288, 0.393, 0.308), coal.Box(0.284, 0.153, 0.149)])
    contact = pn.GeometryContact("body0", "body1", restitution=1.0)
    scene = pn.Scene(model, contacts=[contact], collision_model=geometry)
    q = [0.0, 0.455, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -0.455, 0.0, 0.0, 0.0, 0.0, 1.0]
    v = np.zeros(12)
    v[1], v[7] = -1.4635, 1.4635
    run = pn.simulate(scene, 0.5, q=q, v=v, method="moreau", dt=DT)
    assert (run.q[:, 1] - run.q[:, 8]).min() > 0.5 * (0.393 + 0.153) - 2.0 * DT * 1.4635
    assert run.v[-1, 1] - run.v[-1, 7] == pytest.approx(2.0 * 1.4635, rel=1e-6)


@pytest.mark.parametrize("above", [None, 0.2], ids=["joint", "joint and contact"])
@pytest.mark.parametrize("seed", seeds(range(20)))
def test_steps_end_at_times_of_a_held_table_and_of_samples(seed, above):
    """Times that differ by rounding are one end: no step is as short as rounding, and the motion is exact."""
    rng = np.random.default_rng(seed)
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slide")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(2.0, 0.1), pin.SE3.Identity())
    period, count = rng.uniform(0.01, 0.03), 40
    times, torque = period * np.arange(count), rng.uniform(-1.0, 1.0, count)
    drive = pn.Table(times, torque[:, None], interpolation="hold")
    contacts = [] if above is None else [pn.PointContact("slide", radius=0.1, height=-above)]
    scene = pn.Scene(model, contacts=contacts, actuation=drive)
    duration, dt = times[-1], rng.choice([0.007, 1.0 / 60.0, period])
    run = pn.simulate(scene, duration, method="moreau", dt=DT, output_dt=dt)
    assert run.stats.steps <= duration / DT + count + len(run.t)
    ends = np.append(times, duration)
    for t, x in zip(run.t, run.q[:, 0], strict=True):
        spent = np.clip(t - ends[:-1], 0.0, np.diff(ends))
        gained = np.concatenate([[0.0], np.cumsum(0.5 * torque * spent)])
        assert x == pytest.approx(float(spent @ gained[:-1] + 0.25 * spent**2 @ torque), abs=1e-13)


@pytest.mark.parametrize("count", [3, 8])
def test_samples_do_not_change_the_steps(count):
    """A pile is sampled at each step and at the end only: its states are the same to the bit."""
    rng = np.random.default_rng(count)
    model, geometry = bodies(rng, [coal.Sphere(0.05) for _ in range(count)], 9.81)
    geometry.addGeometryObject(pn.ground())
    contacts = [pn.GeometryContact(f"body{k}", "ground", mu=0.4) for k in range(count)]
    contacts += [pn.GeometryContact(f"body{i}", f"body{j}", mu=0.4) for i in range(count) for j in range(i)]
    scene = pn.Scene(model, contacts=contacts, collision_model=geometry)
    q = np.zeros((count, 7))
    q[:, :2], q[:, 2], q[:, 6] = 0.02 * rng.normal(size=(count, 2)), 0.06 + 0.11 * np.arange(count), 1.0
    ends = [
        pn.simulate(scene, 0.4, q=q.ravel(), method="moreau", dt=DT, output_dt=dt, record=("a", "lam"))
        for dt in (DT, 0.4)
    ]
    assert np.array_equal(ends[0].q[-1], ends[1].q[-1])
    assert np.array_equal(ends[0].v[-1], ends[1].v[-1])


def test_a_stack_at_rest_does_not_move():
    """Ten boxes, each a little beside the one below, and the heaviest on top."""
    rng = np.random.default_rng(0)
    model, geometry = bodies(rng, [coal.Box(0.2, 0.2, 0.2) for _ in range(10)], 9.81)
    geometry.addGeometryObject(pn.ground())
    contacts = [pn.GeometryContact("body0", "ground", mu=0.5)]
    contacts += [pn.GeometryContact(f"body{k + 1}", f"body{k}", mu=0.5) for k in range(9)]
    scene = pn.Scene(model, contacts=contacts, collision_model=geometry)
    q = np.zeros((10, 7))
    q[:, 0], q[:, 2], q[:, 6] = 0.003 * np.arange(10), 0.1 + 0.2 * np.arange(10), 1.0
    run = pn.simulate(scene, 1.0, q=q.ravel(), method="moreau", dt=DT, output_dt=0.1)
    assert np.abs(run.q - run.q[0]).max() < 1e-14
    assert not run.v.any()


def test_samples_of_a_long_run_are_due_on_time():
    """Sums of steps drift off the grid of samples by rounding, which no sample may wait for."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slide")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(2.0, 0.1), pin.SE3.Identity())
    run = pn.simulate(pn.Scene(model, v0=[1.0]), 100.0, method="moreau", dt=DT, output_dt=0.03)
    grid = np.append(0.03 * np.arange(3334), 100.0)
    assert len(run.t) == len(grid)
    assert np.abs(run.t - grid).max() < 1e-10


def test_samples_without_forces_evaluate_none():
    """A run that records positions only needs no accelerations at the ends of its steps."""
    model, geometry = bodies(np.random.default_rng(0), [coal.Box(0.2, 0.2, 0.2)] * 2, gravity=9.81)
    geometry.addGeometryObject(pn.ground())
    scene = pn.Scene(model, contacts=pn.ground_contacts(model, geometry, mu=0.3), collision_model=geometry)
    q, v = [0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0], np.zeros(12)
    v[[0, 6]] = 1.0
    steps = 100
    brief = pn.simulate(scene, steps * DT, q, v, method="moreau", dt=DT)
    whole = pn.simulate(scene, steps * DT, q, v, method="moreau", dt=DT, record="forces")
    for field in ("q", "v", "modes", "closed", "violation", "violation_rate"):
        np.testing.assert_array_equal(getattr(brief, field), getattr(whole, field), err_msg=field)
    assert brief.stats.evaluations <= steps + 5
    assert whole.stats.evaluations >= 2 * steps


def test_a_falling_ball_shows_its_penetration_whatever_is_recorded():
    model, geometry = bodies(np.random.default_rng(0), [coal.Sphere(0.1)], gravity=9.81)
    geometry.addGeometryObject(pn.ground())
    scene = pn.Scene(model, contacts=pn.ground_contacts(model, geometry, mu=0.3), collision_model=geometry)
    q = [0.0, 0.0, 0.3, 0.0, 0.0, 0.0, 1.0]
    runs = [
        pn.simulate(scene, 0.3, q, method="moreau", dt=DT, output_dt=output_dt, record=record)
        for output_dt in (None, DT)
        for record in ((), "forces")
    ]
    assert 1e-5 < runs[0].violation.max() < 2.0 * DT
    assert runs[0].violation_rate.max() < 1e-12
    for run in runs[1:]:
        np.testing.assert_array_equal(run.violation, runs[0].violation)
        np.testing.assert_array_equal(run.violation_rate, runs[0].violation_rate)


def test_samples_at_events_record_their_own_accelerations():
    """A user's event reads the accelerations of each step, whatever the samples record."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "swing")
    inertia = pin.Inertia(1.0, np.array([0.5, 0.0, 0.0]), 0.01 * np.eye(3))
    model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    run = pn.simulate(
        pn.Scene(model),
        1.0,
        method="moreau",
        dt=DT,
        output_dt=0.2,
        record=("a", "reactions"),
        events=lambda t, q, v: q[0] - 1.0,
    )
    data = model.createData()
    exact = [pin.aba(model, data, q, v, np.zeros(1)) for q, v in zip(run.q, run.v, strict=True)]
    assert len(run.t) == 7
    np.testing.assert_allclose(run.a, exact, rtol=1e-12)


def summary(run):
    return [(event.kind, event.time, event.element) for event in run.events]


@pytest.mark.parametrize("seed", seeds(range(60)))
def test_sparse_samples_keep_all_events(seed):
    """Events of a contact follow from those of its points, not from samples."""
    rng = np.random.default_rng(seed)
    model, geometry = bodies(rng, [coal.Box(*rng.uniform(0.1, 0.3, 3)) for _ in range(3)], gravity=9.81)
    geometry.addGeometryObject(pn.ground())
    pairs = [("body0", "body1"), ("body1", "body2")]
    contacts = pn.ground_contacts(model, geometry, mu=0.4) + [
        pn.GeometryContact(*pair, mu=0.4) for pair in pairs
    ]
    scene = pn.Scene(model, contacts=contacts, collision_model=geometry)
    q = np.concatenate(
        [
            [0.02 * k, 0.0, 0.25 + 0.4 * k, *pin.Quaternion(pin.exp3(0.3 * rng.normal(size=3))).coeffs()]
            for k in range(3)
        ]
    )
    v = rng.normal(size=18)
    dense, sparse = (
        pn.simulate(scene, 512 * DT, q, v, method="moreau", dt=DT, output_dt=output_dt)
        for output_dt in (None, 64 * DT)
    )
    np.testing.assert_array_equal(sparse.q[-1], dense.q[-1])
    assert len(dense.events) > 1
    assert summary(sparse) == summary(dense)


def test_a_free_joint_carries_no_friction_of_a_contact_that_a_step_opens():
    """A law reads reactions in the middle of a step, where all contacts are open."""
    model, shapes, wrenches = pin.Model(), pin.GeometryModel(), []
    pn.free_body(model, "box", coal.Box(0.1, 0.1, 0.1), mass=4.0, collision_model=shapes, place=(0, 0, 0.05))

    def law(t, q, v, reactions):
        wrenches.append(reactions.wrench("box").copy())
        return np.zeros(6)

    contacts = pn.ground_contacts(model, shapes, mu=0.5)
    scene = pn.Scene(model, contacts=contacts, laws=[pn.UserLaw(law)], collision_model=shapes)
    run = pn.simulate(scene, 0.02, v=[0.5, 0.0, 0.0, 0.0, 0.0, 0.0], method="moreau", dt=1e-3)
    assert run.v[-1, 0] == pytest.approx(0.5 - 0.5 * 9.81 * 0.02, rel=1e-9)
    assert len(wrenches) > 20
    assert np.abs(wrenches).max() < 1e-6
