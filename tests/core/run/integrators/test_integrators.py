"""Observed orders, dense output, output times, energy ledger and independence of runs."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

import pin_nonideal as pn
from oracles.differences import rows_at

from ....support.random_trees import state, tree
from ....support.row_cases import TREES, parallel_cranks

TIGHT = {"rtol": 1e-13, "atol": 1e-14}
# Error floor: the reference, a hundred steps of order 8, has rounding of 1e-13.
FLOOR = 5e-13
# Difference of observed and theoretical order by higher terms of the error.
ORDER = 0.7


def free(kinds, seed=0):
    rng = np.random.default_rng(seed)
    model = tree(kinds, rng, parents=range(len(kinds)))
    q, v = state(model, rng)
    return (lambda actuation=None: pn.Scene(model, actuation=actuation)), q, v


def constrained(kind, seed=0):
    rng = np.random.default_rng(seed)
    base = TREES[kind](rng)
    q, v = base.project(base.q0, 0.5 * rng.standard_normal(base.model.nv))

    def make(actuation=None):
        kinds = {"constraints": base.constraints, "contacts": base.contacts}
        return pn.Scene(base.model, q0=base.q0, actuation=actuation, **kinds)

    return make, q, v


CASES = {
    "spherical": free(["spherical"]),
    "free flyer": free(["free flyer", "spherical", "endless x"], 1),
    "planar": free(["planar", "endless z", "revolute x"]),
    "composite": free(["composite", "universal"]),
    "point between trees": constrained("point between trees"),
    "hinge between trees": constrained("hinge between trees"),
    "moving length": constrained("distance sinusoid"),
    "knife edge": constrained("knife edge", 2),
    "disk on a moving plane": constrained("disk on a moving plane"),
}
FREE = [case for case in CASES if case in ("spherical", "free flyer", "planar", "composite")]


def length_at_start():
    """Return the initial distance l; the scene's distance is l (1 + 0.1 sin(3 t))."""
    return CASES["moving length"][0]().constraints[0].length.offset


def fixed_steps(make, q, v, duration, method, n, **options):
    """Run n equal steps.

    A control that is sampled at every step fixes the steps of adaptive methods, which accept any error.
    """
    h = duration / n
    if method not in ("dop853", "dopri5"):
        return pn.simulate(make(), duration, q, v, method=method, dt=h, **options)
    hold = pn.SampledControl(lambda t, q, v: np.zeros(v.size), period=h)
    run = pn.simulate(make(hold), duration, q, v, method=method, rtol=0.1, atol=1e3, **options)
    assert n <= run.stats.steps <= n + 3  # the first period starts with a smaller step
    return run


def gap(model, one, two):
    """Return the largest difference of two runs over common samples, in tangent coordinates."""
    q = [np.abs(pin.difference(model, a, b)).max() for a, b in zip(one.q, two.q, strict=True)]
    return max(max(q), float(np.abs(one.v - two.v).max()))


def observed_order(case, method, ladder, **grid):
    """Return the order between the finest grid above the error floor and a grid with a third of its steps.

    The random direction of errors would affect the order between closer grids.
    """
    make, q, v = CASES[case]
    reference = fixed_steps(make, q, v, 1.0, "dop853", 100, **grid)
    errors = []
    for n in ladder:
        errors.append(gap(reference.scene.model, fixed_steps(make, q, v, 1.0, method, n, **grid), reference))
        if len(errors) > 2 and errors[-1] < FLOOR:
            errors.pop()
            break
    fine = len(errors) - 1
    coarse = max(k for k in range(fine) if ladder[k] <= ladder[fine] / 3)
    return np.log(errors[coarse] / errors[fine]) / np.log(ladder[fine] / ladder[coarse])


LADDERS = {
    "dop853": (3, 4, 6, 8, 12, 16, 24, 32, 48, 64),
    "dopri5": (15, 30, 60, 120),
    "rk4": (25, 50, 100),
    "semi_implicit_euler": (200, 400, 800),
}


@pytest.mark.parametrize(
    ("method", "order"), [("dop853", 8), ("dopri5", 5), ("rk4", 4), ("semi_implicit_euler", 1)]
)
@pytest.mark.parametrize("case", CASES)
def test_observed_order(case, method, order):
    assert observed_order(case, method, LADDERS[method], output_dt=1.0) > order - ORDER


@pytest.mark.parametrize(("method", "order"), [("dop853", 7), ("dopri5", 4), ("rk4", 3)])
@pytest.mark.parametrize("case", ["free flyer", "planar", "point between trees", "knife edge"])
def test_dense_output_between_steps(case, method, order):
    """Samples between the steps keep the interpolant's order."""
    assert observed_order(case, method, LADDERS[method], output_dt=1.0 / 37) > order - ORDER


@pytest.mark.parametrize("method", ["dop853", "dopri5"])
@pytest.mark.parametrize("case", ["free flyer", "point between trees"])
def test_errors_follow_the_tolerance(case, method):
    make, q, v = CASES[case]
    reference = pn.simulate(make(), 2.0, q, v, output_dt=2.0, **TIGHT)
    errors, steps = [], []
    for rtol in (1e-5, 1e-7, 1e-9):
        run = pn.simulate(make(), 2.0, q, v, output_dt=2.0, method=method, rtol=rtol, atol=rtol)
        errors.append(gap(make().model, run, reference))
        steps.append(run.stats.steps)
        assert errors[-1] < 1e3 * rtol  # a hundred steps with error growth
    assert steps[0] < steps[1] < steps[2]
    assert errors[2] < 1e-2 * errors[0]


def test_quaternions_stay_unit():
    make, q, v = CASES["free flyer"]
    run = pn.simulate(make(), 5.0, q, v, output_dt=0.013)
    for part in (slice(3, 7), slice(7, 11), slice(11, 13)):
        np.testing.assert_allclose(np.linalg.norm(run.q[:, part], axis=1), 1.0, atol=4e-16)


# --- Output times -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["dop853", "dopri5", "rk4", "semi_implicit_euler", "moreau"])
@pytest.mark.parametrize(
    ("t0", "duration", "output_dt"),
    [(0.0, 1.0, 0.1), (0.3, 1.0, 0.3), (-2.5, 0.7, 1.0), (1e4, 0.5, 0.125)],
)
def test_output_grid_has_both_ends(method, t0, duration, output_dt):
    make, q, v = CASES["spherical"]
    fixed = {} if method in ("dop853", "dopri5") else {"dt": 0.017}
    run = pn.simulate(make(), duration, q, v, t0=t0, output_dt=output_dt, method=method, **fixed)
    inside = [t0 + k * output_dt for k in range(int(np.ceil(duration / output_dt - 1e-9)))]
    np.testing.assert_allclose(run.t, [*inside, t0 + duration], rtol=4e-16, atol=0)
    assert (np.diff(run.t) > 0.0).all()


def test_without_output_dt_every_step_is_a_sample():
    make, q, v = CASES["spherical"]
    run = pn.simulate(make(), 1.0, q, v)
    assert len(run) == run.stats.steps + 1
    assert (run.t[0], run.t[-1]) == (0.0, 1.0)
    assert pn.simulate(make(), 1.0, q, v, method="rk4", dt=0.3).t.tolist() == [0.0, 0.3, 0.6, 0.3 * 3, 1.0]


def test_the_clock_of_a_scene_starts_at_t0():
    """A run from t0 continues a run that ends at t0: functions of time, control samples and tables."""
    base = TREES["distance sinusoid"](np.random.default_rng(0))
    model = base.model
    controls = {
        "function": lambda t, q, v: 0.3 * np.sin(5.0 * t) * np.ones(model.nv),
        "table": pn.Table([0.0, 0.31, 0.9], 0.2 * np.outer([0.0, 1.0, -1.0], np.ones(model.nv))),
    }
    for control in controls.values():
        scene = pn.Scene(model, constraints=base.constraints, q0=base.q0, actuation=control)
        whole = pn.simulate(scene, 0.8, rtol=1e-12, atol=1e-13)
        half = pn.simulate(scene, 0.5, rtol=1e-12, atol=1e-13)
        rest = pn.simulate(scene, 0.3, half.q[-1], half.v[-1], t0=0.5, rtol=1e-12, atol=1e-13)
        assert rest.t[-1] == 0.8
        np.testing.assert_allclose(rest.q[-1], whole.q[-1], atol=1e-10)
        np.testing.assert_allclose(rest.v[-1], whole.v[-1], atol=1e-10)


def test_sampled_control_is_held_and_sampled_on_its_grid():
    calls = []

    def control(t, q, v):
        calls.append(t)
        return [np.sign(np.sin(40.0 * t + 0.1))]

    model = tree(["prismatic x"], np.random.default_rng(0), gravity=False)
    scene = pn.Scene(model, actuation=pn.SampledControl(control, period=0.05))
    run = pn.simulate(scene, 1.0, t0=0.2, record="a")
    assert calls == pytest.approx([0.2 + 0.05 * k for k in range(20)], abs=1e-12)
    mass = float(scene._compiled.program.runner().terms(run.q[0], run.v[0])[0][0])
    held = [np.sign(np.sin(40.0 * t + 0.1)) / mass for t in calls]
    assert run.v[-1, 0] == pytest.approx(0.05 * np.sum(held), abs=1e-12)


# --- Constraints over a run -------------------------------------------------------------------------------


@pytest.mark.parametrize("rtol", [1e-4, pytest.param(1e-9, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", TREES)
def test_projection_keeps_every_kind_at_rounding(kind, rtol):
    make, q, v = constrained(kind, 1)
    run = pn.simulate(make(), 0.25, q, v, rtol=rtol, output_dt=0.03)
    assert run.violation.max() < 1e-12
    assert run.violation_rate.max() < 1e-11


@pytest.mark.parametrize("case", CASES)
def test_the_energy_ledger_closes(case):
    make, q, v = CASES[case]
    run = pn.simulate(make(), 1.0, q, v, rtol=1e-11, atol=1e-12, record=("energy", "power", "forces"))
    size = np.abs(run.energy["kinetic"]).max() + np.ptp(run.energy["potential"])
    assert np.abs(run.energy["balance"]).max() < 1e-9 * size
    if case in FREE:
        assert np.ptp(run.energy["total"]) < 1e-9 * size
    elif case != "moving length":  # scleronomic ideal constraints and projection do no work
        assert np.abs(run.energy["constraints"]).max() < 1e-8 * size
        assert np.abs(run.energy["projection"]).max() < 1e-8 * size
        assert np.ptp(run.energy["total"]) < 1e-8 * size
    else:
        rate = 3.0 * 0.1 * length_at_start() * np.cos(3.0 * run.t)
        np.testing.assert_allclose(run.power["constraints"], rate * run.lam[:, 0], rtol=1e-10)


def test_a_driven_scene_with_springs_drag_and_friction_closes_its_ledger():
    rng = np.random.default_rng(3)
    base = TREES["hinge between trees"](rng)
    wave = pn.PrescribedMotion("c2", pn.sinusoid(0.3, 4.0, offset=base.q0[-2]))
    scene = pn.Scene(
        base.model,
        constraints=[*base.constraints, wave],
        q0=base.q0,
        laws=[
            pn.Drag("a3 tip", 0.4, 2.0),
            pn.JointFriction("c3", viscous=0.3),
            pn.JointFriction("a1", viscous=0.1),
        ],
        forces=[
            pn.SpringDamper("b2 tip", "c3 tip", stiffness=30.0, damping=0.5, rest_length=0.2),
            pn.JointSpring("a1", 2.0, 0.1, 0.05),
            pn.Wrench("c0 tip", lambda t: [np.sin(t), 0.0, 1.0, 0.1, 0.0, 0.0]),
            pn.UserForce(lambda t, q, v: -0.01 * v),
        ],
        actuation=lambda t, q, v: 0.2 * np.cos(3.0 * t) * np.ones(v.size),
    )
    run = pn.simulate(scene, 1.0, rtol=1e-11, atol=1e-12, record="energy")
    ledger = run.energy
    size = np.abs(ledger["kinetic"]).max() + np.ptp(ledger["potential"])
    assert np.abs(ledger["balance"]).max() < 1e-9 * size
    for column in ("actuation", "forces", "constraints", *scene.law_names):
        assert np.abs(ledger[column]).max() > 1e-4 * size, column
    for law in scene.law_names:
        assert (np.diff(ledger[law]) <= 0.0).all(), law


def test_three_parallel_cranks_swing_as_one_pendulum():
    """Redundant rows are independent off the constraints; the motion has one equation."""
    scene = parallel_cranks()
    radius, rod, bar = 0.3, 1.0, 2.0
    turning = 3 * (1e-3 + rod * radius**2 / 4) + bar * radius**2
    weight = 9.81 * (3 * rod * radius / 2 + bar * radius)

    def pendulum(t, y):
        return [y[1], weight * np.sin(y[0]) / turning]

    oracle = solve_ivp(pendulum, (0.0, 3.0), [0.4, 2.0], "DOP853", rtol=1e-13, atol=1e-13)
    run = pn.simulate(scene, 3.0, rtol=1e-11, atol=1e-12, record="energy")
    assert run.violation.max() < 1e-13
    expected = oracle.y[:, -1]
    np.testing.assert_allclose(run.q[-1], expected[0] * np.array([1, -1, 1, 1]), atol=1e-9)
    np.testing.assert_allclose(run.v[-1], expected[1] * np.array([1, -1, 1, 1]), atol=1e-9)
    assert np.ptp(run.energy["total"]) < 1e-9 * weight


# --- Independence of runs ------------------------------------------------------------------------


def loops():
    """Return two anchors and a coupling on three trees."""
    base = TREES["point between trees"](np.random.default_rng(5))
    first = {name: base.model.joints[base.model.getJointId(name)].idx_q for name in ("a1", "c1")}
    follower = np.arctan2(base.q0[first["c1"] + 1], base.q0[first["c1"]])
    gear = pn.JointCoupling("c1", "a1", 0.5, follower - 0.5 * base.q0[first["a1"]], name="gear")
    return base, [*base.constraints, pn.PointAnchor("c3 tip", axes="xz", name="held"), gear]


def final(base, constraints, q=None, v=None):
    scene = pn.Scene(base.model, constraints=constraints, q0=base.q0)
    if q is None:
        q, v = scene.project(base.q0, np.linspace(-1.0, 1.0, base.model.nv))
    run = pn.simulate(scene, 1.0, q, v, rtol=1e-10, atol=1e-11, output_dt=0.5)
    return run, q, v


# Difference of two runs at rtol 1e-10 with different rounding.
SAME_RUN = 1e-8


def test_the_order_of_constraints_does_not_matter():
    base, parts = loops()
    run, q, v = final(base, parts)
    for order_ in ([2, 1, 0], [1, 2, 0]):
        other, _, _ = final(base, [parts[i] for i in order_], q, v)
        assert gap(base.model, run, other) < SAME_RUN
        assert other.stats.steps == run.stats.steps


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e5])
def test_copies_scaled_by_any_factor_do_not_matter(scale):
    base, parts = loops()
    run, q, v = final(base, parts)
    plain = pn.Scene(base.model, constraints=parts, q0=base.q0)
    runner = plain._compiled.program.runner()
    m = len(rows_at(plain, runner, q, v, 0.0)[1])

    def pick(part, t, q, v):
        return scale * rows_at(plain, runner, q, v, t)[part]

    copy = pn.UserConstraint(
        lambda t, q, v, data: (pick(0, t, q, v), pick(1, t, q, v)),
        m,
        residual=lambda t, q: pick(2, t, q, np.zeros(base.model.nv)),
        rate=lambda t, q, v: pick(3, t, q, v),
    )
    alone, _, _ = final(base, [copy], q, v)
    assert gap(base.model, run, alone) < SAME_RUN
    doubled, _, _ = final(base, [*parts, copy], q, v)
    assert gap(base.model, run, doubled) < SAME_RUN


def test_duplicates_are_dropped_and_do_not_matter():
    base, parts = loops()
    run, q, v = final(base, parts)
    again = pn.PointAnchor("a3 tip", "meet", axes="xy", name="again")
    turned = pn.JointCoupling("a1", "c1", 2.0, -2.0 * parts[-1].offset, name="gear turned")
    twice = [*parts, again, turned]
    scene = pn.Scene(base.model, constraints=twice, q0=base.q0)
    anchor, gear = 'copy of a row of "PointAnchor(a3 tip, meet)"', 'copy of a row of "gear"'
    assert scene.dropped == [("again", 0, anchor), ("again", 1, anchor), ("gear turned", 0, gear)]
    other, _, _ = final(base, twice, q, v)
    assert gap(base.model, run, other) < SAME_RUN
    assert other.stats.steps == run.stats.steps
