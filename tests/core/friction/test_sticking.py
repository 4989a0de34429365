"""Sticking elements have exactly zero velocity below the limit, and slip at the limit."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from oracles.rods import rods

from ...support.mechanisms import (
    GRAVITY,
    TIGHT,
    assert_close,
    at_events,
    body,
    dof,
    empty,
    frame,
    hinge,
    point_mass,
)


def arm(laws, angles=(0.5,), actuation=None, forces=()):
    """Return a hanging chain of rods of 1 kg and 1 m with joints "pin0", "pin1", ..."""
    model = rods(np.ones(len(angles)), along=(0.0, 0.0, -1.0), joint=hinge(0.0, -1.0, 0.0), name="pin")
    return pn.Scene(model, laws=laws, q0=angles, actuation=actuation, forces=forces)


def rotor(law, actuation, mass=2.0, inertia=0.3):
    """Return a balanced wheel on a horizontal pin, which carries the weight, under a torque."""
    model = empty()
    body(model, 0, hinge(0.0, 1.0, 0.0), "pin", mass, inertia=inertia * np.eye(3))
    return pn.Scene(model, laws=[law], actuation=actuation)


# Projection of closed loops may round a position once.
ROUNDING = 1e-13


class AtRest:
    """Scenes with a load below the friction limit."""

    @staticmethod
    def arm_dry():
        return arm([pn.JointFriction("pin0", coulomb=3.0)])  # load m g l/2 sin(0.5) = 2.4

    @staticmethod
    def arm_loaded():
        return arm([pn.JointFriction("pin0", mu=0.3, radius=0.1)], (0.05,))

    @staticmethod
    def two_arms_loaded():
        return arm([pn.JointFriction(f"pin{i}", mu=0.3, radius=0.2) for i in range(2)], (0.05, 0.02))

    @staticmethod
    def trembling_arm():
        """Return an arm under an oscillating torque up to 0.9 of the limit."""
        return arm([pn.JointFriction("pin0", coulomb=1.0)], (0.0,), lambda t, q, v: [0.9 * np.sin(3.0 * t)])

    @staticmethod
    def slide_on_slope():
        model = empty()
        body(
            model,
            0,
            pin.JointModelPX(),
            "slide",
            1.0,
            place=pin.SE3(pin.utils.rotate("y", -0.5), np.zeros(3)),
        )
        return pn.Scene(model, laws=[pn.JointFriction("slide", mu=0.6)])

    @staticmethod
    def block_on_slope():
        model = point_mass()
        frame(model, "plane", 0, pin.SE3(pin.utils.rotate("y", -0.5), np.zeros(3)))
        return pn.Scene(model, contacts=[pn.PointContact("mass", mu=0.6, plane="plane", unilateral=False)])

    @staticmethod
    def users_own():
        rub = pn.UserFriction(lambda t, q: [1.0, 0.5], lambda t, q, v, reactions: 30.0)
        hold = pn.JointFriction("pin1", coulomb=20.0)
        return arm([rub, hold], (0.4, 0.3))

    @staticmethod
    def cut_pin(frames=("arm", "ground")):
        """Return a free body on a hinge anchor with friction."""
        model = empty()
        body(model, 0, pin.JointModelFreeFlyer(), "arm", 1.0, lever=(0.1, 0.2, -0.5), inertia=0.1 * np.eye(3))
        frame(model, "ground", 0)
        pivot = pn.HingeAnchor(*frames, axis="y", name="pivot")
        return pn.Scene(model, constraints=[pivot], laws=[pn.JointFriction("pivot", coulomb=3.0)])

    @staticmethod
    def cut_pin_the_other_way():
        return AtRest.cut_pin(("ground", "arm"))

    @staticmethod
    def four_bar(*joints):
        robot = pn.load("four_bar")
        laws = [pn.JointFriction(joint, coulomb=20.0) for joint in joints or ("crank_joint",)]
        return pn.Scene(robot.model, constraints=robot.constraints, laws=laws, q0=robot.q0)

    @staticmethod
    def four_bar_held_twice():
        """Return two sticking pins with one degree of freedom: loads are not unique, but nothing moves."""
        return AtRest.four_bar("crank_joint", "rocker_joint")

    @staticmethod
    def four_bar_held_everywhere():
        return AtRest.four_bar("crank_joint", "coupler_joint", "rocker_joint")


SCENES = [value.__func__ for value in vars(AtRest).values() if isinstance(value, staticmethod)]


def assert_still(run):
    assert run.events == []
    assert np.abs(run.v).max() == 0.0
    assert np.abs(run.q - run.q[0]).max() < ROUNDING


class TestRest:
    @pytest.mark.parametrize("scene", SCENES)
    def test_for_ten_thousand_seconds(self, scene):
        assert_still(pn.simulate(scene(), 1e4))

    @pytest.mark.parametrize("method", ["dopri5", "rk4", "semi_implicit_euler", "moreau"])
    @pytest.mark.parametrize("scene", SCENES)
    def test_with_every_method(self, scene, method):
        step = {} if method == "dopri5" else {"dt": 0.01}
        assert_still(pn.simulate(scene(), 20.0, method=method, **step))

    @pytest.mark.parametrize("scene", [AtRest.arm_dry, AtRest.slide_on_slope])
    def test_for_a_million_steps(self, scene):
        run = pn.simulate(scene(), 1e4, method="rk4", dt=0.01, output_dt=100.0)
        assert run.stats.steps == 1_000_000
        assert_still(run)

    def test_a_long_rest_costs_nothing(self):
        assert pn.simulate(AtRest.two_arms_loaded(), 1e4).stats.steps < 50

    @pytest.mark.parametrize("law", [{"coulomb": 1.3}, {"mu": 0.3, "radius": 0.05}])
    def test_a_billionth_decides(self, law):
        limit = law.get("coulomb") or 0.3 * 0.05 * 2.0 * GRAVITY
        for part, expected in ((1.0 - 1e-9, 0), (1.0 + 1e-9, 1)):
            scene = rotor(pn.JointFriction("pin", **law), [part * limit])
            assert scene.solve([0.0], [0.0]).modes.tolist() == [expected]
            run = pn.simulate(scene, 100.0)
            # a = 1e-9 limit/I: rest is exact.
            assert_close(run.v[-1, 0], expected * 1e-9 * limit / 0.3 * 100.0, 1e-12)


LIMIT = 0.3 * 0.05 * 2.0 * GRAVITY
BREAK_AWAY = [
    (pn.JointFriction("pin", coulomb=1.3), 1.3),
    (pn.JointFriction("pin", coulomb=1.3, static_ratio=1.25), 1.625),
    (pn.JointFriction("pin", coulomb=1.3, static_ratio=1.25, stribeck_velocity=0.1), 1.625),
    (pn.JointFriction("pin", coulomb=0.3, preload=1.0, viscous=2.0), 1.3),
    (pn.JointFriction("pin", mu=0.3, radius=0.05), LIMIT),
    (pn.JointFriction("pin", mu=0.3, radius=0.05, static_ratio=1.4), 1.4 * LIMIT),
    (pn.JointFriction("pin", mu=0.3, radius=0.05, reaction="ideal"), LIMIT),
    (pn.UserFriction(lambda t, q: [2.0], lambda t, q, v, reactions: 0.65), 1.3),
    (pn.UserFriction(lambda t, q: [1.0], lambda t, q, v, reactions: 1.0, static_ratio=1.3), 1.3),
]
METHODS = [
    {},
    TIGHT,
    {"method": "dopri5"},
    {"method": "rk4", "dt": 0.1},
    {"method": "rk4", "dt": 0.0123},
    {"method": "semi_implicit_euler", "dt": 0.01},
]


class TestBreakAway:
    """A torque rate t moves the wheel when it reaches the static limit."""

    @pytest.mark.parametrize("options", METHODS)
    @pytest.mark.parametrize("rate", [0.1, 1.0, 37.0])
    @pytest.mark.parametrize(("law", "limit"), BREAK_AWAY)
    def test_ramp(self, law, limit, rate, options):
        run = pn.simulate(rotor(law, lambda t, q, v: [rate * t]), 1.2 * limit / rate, **options)
        assert [event.kind for event in run.events] == ["slip"]
        torque = rate * run.events[0].time
        assert abs(torque - limit) <= 1e-9 * limit
        assert_close(run.v[run.t <= run.events[0].time], 0.0, 1e-14)

    @pytest.mark.parametrize("options", METHODS)
    @pytest.mark.parametrize("limits", [(1.0, 1.0), (1.0, 3.0), (0.1, 1.0, 2.0)])
    def test_brakes_on_geared_wheels(self, limits, options):
        """Several brakes on one degree of freedom hold the sum of their limits."""
        model, n = empty(), len(limits)
        for k in range(n):
            body(model, 0, pin.JointModelRY(), f"wheel{k}", 1.0, inertia=np.eye(3))
        gears = [pn.JointCoupling(f"wheel{k}", "wheel0", ratio=-1.0) for k in range(1, n)]
        brakes = [pn.JointFriction(f"wheel{k}", coulomb=limit) for k, limit in enumerate(limits)]
        first = np.eye(n)[0]
        scene = pn.Scene(model, constraints=gears, laws=brakes, actuation=lambda t, q, v: t * first)
        total = sum(limits)
        run = pn.simulate(scene, 1.5 * total, **options)
        assert {event.kind for event in run.events} == {"slip"}
        assert len(run.events) == n
        assert_close([event.time for event in run.events], total, 1e-9 * total)
        assert np.abs(run.v[run.t < 0.999 * total]).max() == 0.0
        # n alpha = t - total: exact except for the first-order method, with an error of half a step
        order_one = options.get("method") == "semi_implicit_euler"
        assert_close(run.v[-1, 0], (0.5 * total) ** 2 / (2.0 * n), 0.01 * total if order_one else 1e-9)

    @pytest.mark.parametrize("options", [{}, TIGHT, {"output_dt": 0.1}, {"method": "dopri5"}])
    def test_load_that_swings_past_the_limit(self, options):
        """A wheel under 1.1 sin t with the limit 1 begins to move at sin t = 1/1.1 in every half period."""
        law = pn.JointFriction("pin", coulomb=1.0)
        run = pn.simulate(rotor(law, lambda t, q, v: [1.1 * np.sin(t)], inertia=1.0), 19.0, **options)
        first = np.arcsin(1.0 / 1.1)
        slips = [event.time for event in run.events if event.kind == "slip"]
        assert_close(slips, first + np.pi * np.arange(6), 1e-9)

    @pytest.mark.parametrize("excess", [1e-3, 1e-5, 1e-7])
    @pytest.mark.parametrize("options", [{}, TIGHT, {"method": "rk4", "dt": 0.01}])
    def test_load_that_hardly_passes_the_limit(self, options, excess):
        """The load exceeds the limit for sqrt(2 excess) / 3 s on each side of its peak, less than a step."""
        law = pn.JointFriction("pin", coulomb=1.0, static_ratio=1.5)
        scene = rotor(law, lambda t, q, v: [1.5 * (1.0 + excess) * np.sin(3.0 * t)], inertia=1.0)
        run = pn.simulate(scene, 1.0, **options)
        assert run.events[0].kind == "slip"
        # For a load error of 1e-12 the time error grows as the load rate decreases.
        assert_close(run.events[0].time, np.arcsin(1.0 / (1.0 + excess)) / 3.0, 1e-9)

    @pytest.mark.parametrize("width", [0.01, 0.1, 1.0])
    def test_pulse_after_a_long_rest(self, width):
        """A torque 3 exp(-((t - 50) / width)^2) exceeds the limit 1 after 50 s at rest."""
        law = pn.JointFriction("pin", coulomb=1.0)
        scene = rotor(law, lambda t, q, v: [3.0 * np.exp(-(((t - 50.0) / width) ** 2))], inertia=1.0)
        run = pn.simulate(scene, 60.0)
        assert [event.kind for event in run.events] == ["slip", "stick"]
        assert_close(run.events[0].time, 50.0 - width * np.sqrt(np.log(3.0)), 1e-9)

    def test_floor_that_shakes(self):
        """The ground moves with |x''| = 1.1 |sin t| against mu g = 1."""
        model = empty()
        ground = body(model, 0, pin.JointModelPX(), "ground", 1.0)
        body(model, ground, pin.JointModelPX(), "rider", 1.0)
        shake = pn.PrescribedMotion("ground", pn.sinusoid(1.1, 1.0))
        rub = pn.JointFriction("rider", mu=1.0 / GRAVITY)
        run = pn.simulate(pn.Scene(model, constraints=[shake], laws=[rub], v0=[1.1, 0.0]), 19.0, **TIGHT)
        slips = [event.time for event in run.events if event.kind == "slip"]
        assert_close(slips, np.arcsin(1.0 / 1.1) + np.pi * np.arange(6), 1e-9)


class TestOrder:
    """Observed orders of dop853 (order 8) over runs with events, from error against number of steps."""

    def test_across_turns(self):
        """The third reversal of a pendulum with constant friction in the pivot has a closed form."""
        turn, turn_time = -0.8336202985738322, 3.220318773990451
        model = empty()
        body(model, 0, hinge(0.0, -1.0, 0.0), "pivot", 1.0, lever=(0.0, 0.0, -1.0))
        scene = pn.Scene(model, laws=[pn.JointFriction("pivot", coulomb=0.5)], q0=[1.2])
        steps, errors = [], []
        for k in range(10):
            tolerance = 10.0 ** (-5.0 - 0.7 * k)
            run = pn.simulate(scene, 3.3, rtol=tolerance, atol=tolerance)
            last = at_events(run)[2]
            steps.append(run.stats.steps)
            errors.append(abs(run.q[last, 0] - turn) + abs(run.t[last] - turn_time))
        order = -np.polyfit(np.log(steps), np.log(errors), 1)[0]
        assert order > 6.0, f"order {order:.2f} from steps {steps}, errors {errors}"
        assert errors[-1] < 1e-9

    def test_across_sticking(self):
        """Stick-slip cycles of a mass on a belt with a hardening spring, against a tight run."""
        model = empty()
        belt = body(model, 0, pin.JointModelPX(), "belt", 1.0)
        body(model, belt, pin.JointModelPX(), "mass", 1.0)
        drive = pn.PrescribedMotion("belt", pn.polynomial([0.0, 0.3]))
        spring = pn.UserForce(lambda t, q, v: np.full(2, -100.0 * q.sum() - 3000.0 * q.sum() ** 3))
        rub = pn.JointFriction("mass", coulomb=5.0, static_ratio=1.6)
        scene = pn.Scene(model, constraints=[drive], laws=[rub], forces=[spring], v0=[0.3, 0.0])
        reference = pn.simulate(scene, 2.5, rtol=1e-14, atol=1e-14)
        kinds = [event.kind for event in reference.events]
        assert kinds.count("stick") >= 3
        steps, errors = [], []
        for k in range(8):
            tolerance = 10.0 ** (-5.0 - 0.8 * k)
            run = pn.simulate(scene, 2.5, rtol=tolerance, atol=tolerance)
            assert [event.kind for event in run.events] == kinds
            steps.append(run.stats.steps)
            errors.append(np.abs(run.q[-1] - reference.q[-1]).max())
        order = -np.polyfit(np.log(steps), np.log(errors), 1)[0]
        assert order > 6.0, f"order {order:.2f} from steps {steps}, errors {errors}"


class TestModesAndLoads:
    """Loads may depend on modes: selected modes must be consistent with their loads."""

    def test_a_limit_on_ideal_reactions_is_the_same_in_every_mode(self):
        """The ideal motion has no friction, so sticking does not change its reactions."""
        laws = [pn.JointFriction(f"pin{i}", mu=0.3, radius=0.05, reaction="ideal") for i in range(2)]
        scene = arm(laws, (0.4, 0.3))
        runner, rest = scene._compiled.program.runner(), np.zeros(2)
        limits = [
            runner.solve(scene.q0, rest, 0.0, None, modes).limits
            for modes in ([1, 1], [0, 1], [1, 0], [0, 0])
        ]
        for other in limits[1:]:
            np.testing.assert_allclose(other, limits[0], rtol=1e-12)

    @pytest.mark.parametrize("share", [0.5, 0.9, 0.99])
    def test_slowly_converging_limits(self, share):
        """A push holds a block on a slope, and friction reduces its load: mu k is close to 1.

        With friction T along (1, -k) and N = m g - push + k T, the block sticks while |T| = m a_x <= mu N.
        """
        k, mu = 2.0, share / 2.0
        model = empty()
        x = body(model, 0, pin.JointModelPX(), "x", 0.0)
        z = body(model, x, pin.JointModelPZ(), "z", 1.0)
        frame(model, "block", z)
        frame(model, "ground", 0)
        ground = pn.PointAnchor("block", "ground", axes="z", name="ground")
        rub = pn.UserFriction(
            lambda t, q: [1.0, k], lambda t, q, v, reactions: mu * abs(reactions["ground"][0]), name="rub"
        )
        scene = pn.Scene(model, constraints=[ground], laws=[rub])
        for part, mode in ((1.0 - 1e-6, 0), (1.0 + 1e-6, 1)):
            push = part * mu * GRAVITY / (1.0 - mu * k)  # N = m g + k T and T = -mu N at the limit
            s = scene.solve([0.0, 0.0], [0.0, 0.0], tau=[push, 0.0])
            assert list(s.modes) == [mode]

    @pytest.mark.parametrize("dt", [2e-3, 1e-3, 5e-4])
    def test_time_stepping_beside_a_loop(self, dt):
        """One motor of a five-bar comes to rest and sticks while an elbow slips, as with located events.

        The error of time stepping decreases with its step.
        """
        robot = pn.load("five_bar")
        laws = [pn.JointFriction("motor1", coulomb=50.0), pn.JointFriction("elbow2", mu=0.1, radius=0.01)]
        scene = pn.Scene(robot.model, constraints=robot.constraints[:1], laws=laws, q0=robot.q0)
        v = scene.project(scene.q0, [0.0, 0.0, 5.0, 0.0])[1]
        exact = pn.simulate(scene, 0.1, v=v)
        run = pn.simulate(scene, 0.1, v=v, method="moreau", dt=dt)
        np.testing.assert_array_equal(run.modes[1:, 0], 0)
        np.testing.assert_array_equal(run.v[1:, dof(scene, "motor1")], 0.0)
        np.testing.assert_array_equal(run.modes[-1], exact.modes[-1])
        assert_close(run.v[-1], exact.v[-1], 6.0 * dt)


@pytest.mark.parametrize(
    "law",
    [
        pn.JointFriction("pin0", coulomb=6.0),
        pn.UserFriction(lambda t, q: [1.0, 0.0], lambda t, q, v, reactions: 6.0),
    ],
)
def test_a_joint_that_sticks_while_others_move(law):
    """The velocity is exactly zero at every sample, for each law."""
    run = pn.simulate(arm([law], (0.0, 1.0)), 5.0, v=[1.0, -2.0], output_dt=0.01)
    stuck = run.modes[:, 0] == 0
    assert stuck.sum() > 100
    assert (run.v[stuck, 0] == 0.0).all()
    assert np.abs(run.v[stuck, 1]).max() > 1.0


@pytest.mark.parametrize("rtol", [1e-6, 1e-9])
def test_slip_that_turns_in_a_dead_point_stops_nothing(rtol):
    """The rocker of a rotating crank is at rest for an instant, where friction in its pin cannot hold it."""
    lengths = (0.3, 0.8, 0.6)
    model, joint = empty(), 0
    for k, length in enumerate(lengths):
        place = pin.SE3(np.eye(3), np.array([lengths[k - 1] if k else 0.0, 0.0, 0.0]))
        solid = np.diag([1e-3, length**2 / 12.0, length**2 / 12.0])
        joint = body(
            model,
            joint,
            hinge(0.0, 1.0, 0.0),
            f"j{k}",
            1.0,
            place=place,
            lever=(0.5 * length, 0.0, 0.0),
            inertia=solid,
        )
    frame(model, "tip", joint, pin.SE3(np.eye(3), np.array([lengths[2], 0.0, 0.0])))
    frame(model, "ground", 0, pin.SE3(np.eye(3), np.array([0.7, 0.0, 0.0])))
    scene = pn.Scene(
        model,
        constraints=[pn.HingeAnchor("tip", "ground", axis="y", name="pin")],
        laws=[pn.JointFriction("pin", coulomb=0.2)],
        q0=[-1.2, 0.9, 1.4],
        v0=[3.0, 0.0, 0.0],
    )
    run = pn.simulate(scene, 0.5, rtol=rtol, atol=0.01 * rtol, record="energy")
    assert [event.kind for event in run.events] == ["reverse", "reverse"]
    assert run.v[:, 0].min() > 4.0
    assert np.abs(run.energy["balance"]).max() < 10.0 * rtol
