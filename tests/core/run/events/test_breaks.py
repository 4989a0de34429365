"""Prescribed motions whose pieces meet inside a run: splines, pulses, zigzags and functions with a kink."""

from __future__ import annotations

import re

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from oracles.moved_pendulum import CART_MASS, Pendulum

from ....support.orders import SIZES, is_of_order
from ....support.seeds import ranges, seeds

DURATION = 4.0
KINDS = ("clamped", "natural", "pulse", "zigzag", "profile")
# Kinds for fixed steps, and factors of the steps: functions in Python take steps of a quarter with -m slow.
LONGER = [
    pytest.param(kind, 1.0, marks=pytest.mark.slow) for kind in ("clamped", "pulse", "zigzag", "profile")
]
ORDERED = [("natural", 1.0), pytest.param("zigzag", 4.0, marks=pytest.mark.slow), *LONGER]
# Sum of the errors of all steps, in tolerances at 1 rad/s, and rounding of fast pulses.
ADDED, FLOOR = 300.0, 1e-10
BALANCE = 1e-9


class Pieces:
    """Polynomials in t - time, one after each time; constant before the first and after the last one."""

    def __init__(self, times, pieces, last):
        self.times, self.pieces, self.last = np.asarray(times, float), pieces, last

    def __call__(self, t):
        t = float(t)
        if t < self.times[0]:
            return (self.pieces[0][0], 0.0, 0.0)
        if t >= self.times[-1]:
            return (self.last, 0.0, 0.0)
        k = int(np.searchsorted(self.times, t, side="right")) - 1
        a, b, c = self.pieces[k]
        s = t - self.times[k]
        return (a + s * (b + s * c), b + 2.0 * c * s, 2.0 * c)


def times(rng, count, width):
    """Break times within `width` after a random instant."""
    inner = np.cumsum(rng.uniform(0.3, 1.0, count - 1))
    return rng.uniform(0.2, 2.0) + width * np.concatenate([[0.0], inner / inner[-1]])


def polyline(at, values):
    slopes = np.diff(values) / np.diff(at)
    return Pieces(
        at, [(float(x), float(k), 0.0) for x, k in zip(values, slopes, strict=False)], float(values[-1])
    )


def drive(rng, kind):
    """Return a random motion of the cart, and the times at which its pieces meet."""
    if kind in ("clamped", "natural"):
        at = times(rng, int(rng.integers(2, 6)), 10.0 ** rng.uniform(-2.0, 0.0))
        values = np.concatenate([[0.0], rng.uniform(-0.3, 0.3, len(at) - 2), [rng.choice([-0.3, 0.3])]])
        return pn.spline(at, values, ends=kind), at
    if kind == "pulse":
        at = times(rng, 4, 10.0 ** rng.uniform(-1.5, 0.0))
        return polyline(at, np.array([0.0, 0.2, 0.2, 0.0])), at
    if kind == "zigzag":
        at = times(rng, int(rng.integers(2, 6)), 1.5)
        return polyline(at, np.concatenate([[0.0], rng.uniform(-0.2, 0.2, len(at) - 1)])), at
    width = rng.uniform(0.1, 1.0)
    at, a = rng.uniform(0.2, 2.0) + width * np.arange(3), rng.uniform(0.5, 2.0) / width
    middle = 0.5 * a * width**2
    return Pieces(at, [(0.0, 0.0, 0.5 * a), (middle, a * width, -0.5 * a)], 2.0 * middle), at


def at(run, *kinds):
    return [event.time for event in run.events if event.kind in kinds]


def known(function, breaks):
    """Return the function with its attribute `breaks`."""

    def moves(t):
        return function(t)

    moves.breaks = breaks
    return moves


class Case:
    def __init__(self, seed, kind):
        rng = np.random.default_rng(seed)
        self.function, self.breaks = drive(rng, kind)
        self.pendulum = Pendulum(rng.uniform(0.5, 5.0), rng.uniform(0.5, 2.0), rng.uniform(1e-3, 0.1))
        self.start = rng.uniform(-1.0, 1.0, 2)
        (self.angle, self.rate), self.work = self.pendulum.motion(
            self.function, self.breaks, self.start, DURATION
        )

    def run(self, function=None, **options):
        moves = pn.PrescribedMotion("cart", function or self.function, name="drive")
        scene = pn.Scene(self.pendulum.model(), constraints=[moves])
        q0, v0 = [self.function(0.0)[0], self.start[0]], [0.0, self.start[1]]
        return pn.simulate(scene, DURATION, q0, v0, **options)

    def miss(self, run):
        return max(abs(run.q[-1, 1] - self.angle), abs(run.v[-1, 1] - self.rate))


# Splines with carts of 23 m/s to 270 m/s, which miss the end by 310 to 1,400 tolerances.
UNMET = [
    (25, "clamped", "dopri5", 1e-6),
    (122, "clamped", "dop853", 1e-12),
    (178, "clamped", "dop853", 1e-12),
    (224, "clamped", "dop853", 1e-12),
    (25, "natural", "dop853", 1e-12),
    (25, "natural", "dopri5", 1e-6),
    (196, "natural", "dopri5", 1e-6),
]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("many", ranges(3, 60, 300))
def test_no_break_is_leapt_over(kind, many):
    for seed in many:
        case = Case(seed, kind)
        for method in ("dop853", "dopri5"):
            for rtol in (1e-6, 1e-9, 1e-12):
                if (seed, kind, method, rtol) in UNMET:
                    continue
                run = case.run(method=method, rtol=rtol, atol=1e-2 * rtol, record=("energy",))
                assert case.miss(run) < max(ADDED * rtol, FLOOR), (seed, method, rtol)
                allowed = max(ADDED * rtol, BALANCE) * max(1.0, np.ptp(run.energy["kinetic"]))
                assert np.abs(run.energy["balance"]).max() < allowed, (seed, method, rtol)


@pytest.mark.slow
@pytest.mark.xfail(strict=True)
@pytest.mark.parametrize(("seed", "kind", "method", "rtol"), UNMET)
def test_a_fast_spline(seed, kind, method, rtol):
    case = Case(seed, kind)
    assert case.miss(case.run(method=method, rtol=rtol, atol=1e-2 * rtol)) < max(ADDED * rtol, FLOOR)


@pytest.mark.parametrize("kind", ["pulse", "zigzag", "profile"])
@pytest.mark.parametrize("seed", seeds(range(60)))
def test_breaks_that_a_function_tells_are_those_that_are_found(kind, seed):
    case = Case(seed, kind)
    found, told = case.run(), case.run(known(case.function, case.breaks))
    assert case.miss(told) < ADDED * 1e-8
    assert [event.kind for event in found.events] == [event.kind for event in told.events]
    assert [event.time for event in found.events] == pytest.approx([e.time for e in told.events], abs=1e-13)


@pytest.mark.parametrize(("kind", "coarser"), ORDERED)
@pytest.mark.parametrize("seed", [0])
def test_fixed_steps_have_their_order_across_breaks(kind, coarser, seed):
    case = Case(seed, kind)
    for method, order, dt in (("rk4", 4, 2e-3), ("semi_implicit_euler", 1, 1e-3)):
        misses = [case.miss(case.run(method=method, dt=coarser * dt * size)) for size in SIZES]
        assert is_of_order(misses, order, FLOOR), method


@pytest.mark.slow
@pytest.mark.parametrize("method", ["Radau", "BDF", "LSODA"])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(6))
def test_methods_outside_the_core_stop_at_breaks(kind, method, seed):
    case = Case(seed, kind)
    assert case.miss(case.run(method=method, rtol=1e-7, atol=1e-9)) < 1e3 * 1e-7


@pytest.mark.parametrize("kind", ["natural", "pulse", "zigzag"])
@pytest.mark.parametrize("seed", seeds(range(60)))
def test_a_rate_that_jumps_is_an_impulse_whose_work_is_the_drives(kind, seed):
    case = Case(seed, kind)
    run = case.run(rtol=1e-10, atol=1e-12, record=("energy",))
    jumps = [event for event in run.events if event.kind == "jump"]
    assert {event.element for event in jumps} == {"drive"}
    assert sum(event.energy_change for event in jumps) == pytest.approx(case.work, rel=1e-7, abs=1e-9)
    for event in jumps:
        model, q = case.pendulum.model(), run.q[np.searchsorted(run.t, event.time)]
        M = pin.crba(model, model.createData(), q)
        M = np.triu(M) + np.triu(M, 1).T
        assert M @ (event.v_plus - event.v_minus) == pytest.approx([event.impulse[0], 0.0], abs=1e-9)
        assert np.sum(run.t == event.time) == 2


@pytest.mark.parametrize("ends", ["clamped", "natural"])
def test_what_rests_is_moved_by_a_spline_far_in_its_future(ends):
    """A cart alone, which needs no steps before the spline."""
    model = pin.Model()
    cart = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "cart")
    model.appendBodyToJoint(cart, pin.Inertia(CART_MASS, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    spline = pn.spline([50.0, 50.01, 50.02], [0.0, 0.1, 0.3], ends=ends)
    scene = pn.Scene(model, constraints=[pn.PrescribedMotion("cart", spline, name="drive")])
    run = pn.simulate(scene, 100.0, record=("a", "energy"))
    for t, q, v in zip(run.t, run.q, run.v, strict=True):
        if 50.0 < t < 50.02:
            # At 2,000 m/s^2 the rounding of t = 50 s alone is 1e-11 m/s.
            assert [q[0], v[0]] == pytest.approx(spline(t)[:2], abs=1e-10)
    assert {50.0, 50.01, 50.02} <= set(run.t)
    assert run.q[-1, 0] == pytest.approx(0.3, abs=1e-14)
    # The work is integrated to the run's own rtol.
    assert np.abs(run.energy["balance"]).max() < 1e-8 * np.ptp(run.energy["kinetic"])


def test_a_jump_throws_what_rests_on_the_cart():
    """A ball on a table takes the table's jump to 1 m/s, and flies when the table stops."""
    model = pin.Model()
    table = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "table")
    model.appendBodyToJoint(table, pin.Inertia(5.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    model.addFrame(pin.Frame("top", table, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    ball = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(ball, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    model.addFrame(pin.Frame("foot", ball, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    lift = polyline(np.array([0.5, 0.7]), np.array([0.0, 0.2]))
    scene = pn.Scene(
        model,
        constraints=[pn.PrescribedMotion("table", lift, name="lift")],
        contacts=[pn.PointContact("foot", plane="top", name="rests")],
    )
    run = pn.simulate(scene, 1.0, rtol=1e-10, atol=1e-12, record=("energy",))
    assert at(run, "jump") == pytest.approx([0.5, 0.7], abs=1e-12)
    assert at(run, "lift_off")[0] == pytest.approx(0.7, abs=1e-9)
    flight = 2.0 / 9.81
    landed = [time for time in at(run, "impact", "touch_down") if time > 0.75]
    assert landed[0] == pytest.approx(0.7 + flight, abs=1e-8)
    assert np.abs(run.energy["balance"]).max() < 1e-9


def test_a_value_that_jumps_is_refused_by_name():
    def steps(t):
        return (0.0, 0.0, 0.0) if t < 1.0 else (0.1, 0.0, 0.0)

    case = Case(0, "clamped")
    with pytest.raises(pn.LoopClosureError, match=re.escape('"drive"')):
        case.run(steps)


@pytest.mark.parametrize("times", [[1.0, 0.5], [0.0, np.nan], "soon"])
def test_breaks_are_ascending_times(times):
    with pytest.raises(pn.InputError, match="breaks"):
        Case(0, "clamped").run(known(lambda t: (0.0, 0.0, 0.0), times))


def test_samples_inside_steps_stay_on_their_side_of_a_break():
    case = Case(2, "natural")
    run = case.run(rtol=1e-10, atol=1e-12, record=("dense", "a"))
    at = np.sort(np.concatenate([case.breaks - 1e-9, case.breaks + 1e-9]))
    inside = run.at(at)
    for t, q, v, a in zip(at, inside.q, inside.v, inside.a, strict=True):
        assert [q[0], v[0], a[0]] == pytest.approx(case.function(t), abs=1e-9)
