"""Unilateral contacts with impacts and rest, against closed forms and published references.

Numbers come from the references named in each class: textbook closed forms evaluated with 30 digits,
Housner's rocking block (Bull. Seism. Soc. Am. 53, 1963, 403), quadratures of energy integrals, and impact
problems solved by enumeration.
"""

from __future__ import annotations

import itertools
from typing import ClassVar

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ...support.mechanisms import GRAVITY, TIGHT, at, body, empty, frame, planar, point_mass
from ...support.same_run import assert_same_run

TIME = 1e-9  # tolerance of reference times [s]
ROUNDING = 1e-12


def ball(restitution=0.8, **more):
    contact = pn.PointContact("mass", restitution=restitution, **more)
    return pn.Scene(point_mass("Z"), contacts=[contact], q0=[1.0])


class TestBouncingBall:
    """A point mass dropped from 1 m, e = 0.8; instants in closed form."""

    FIRST = np.sqrt(2.0 / GRAVITY)
    LIMIT = FIRST * 1.8 / 0.2

    @pytest.fixture(scope="class")
    @classmethod
    def run(cls):
        return pn.simulate(ball(), 6.0, record=("energy", "forces"))

    def test_impacts_to_the_limit_instant(self, run):
        flights = 2.0 * self.FIRST * 0.8 ** np.arange(1, 40)
        times = np.concatenate([[self.FIRST], self.FIRST + np.cumsum(flights)])
        impacts = at(run, "impact")
        assert np.abs(impacts[:40] - times).max() < TIME
        assert at(run, "touch_down") == pytest.approx([self.LIMIT], abs=TIME)
        assert run.stats.steps <= 200

    def test_rests_exactly(self, run):
        after = run.t > self.LIMIT + TIME
        assert after.any()
        assert (run.v[after] == 0.0).all()
        assert np.abs(run.q[after]).max() < ROUNDING
        assert run.contact_forces["PointContact(mass)"][-1] == pytest.approx([0.0, 0.0, GRAVITY], rel=1e-12)
        assert run.closed[after].all()

    def test_books_what_impacts_take(self, run):
        first = next(e for e in run.events if e.kind == "impact")
        speed = GRAVITY * self.FIRST
        assert first.impulse == pytest.approx([1.8 * speed, 0.0, 0.0], abs=ROUNDING)
        assert first.energy_change == pytest.approx(-0.5 * speed**2 * (1.0 - 0.64), abs=1e-9)
        assert first.v_plus == pytest.approx(-0.8 * first.v_minus, rel=1e-14)
        assert np.abs(run.energy["balance"]).max() < 1e-11
        assert run.energy["impacts"][-1] == pytest.approx(-GRAVITY, abs=1e-9)

    def test_keeps_both_samples_of_an_impact(self, run):
        pair = np.flatnonzero(run.t == at(run, "impact")[0])
        assert len(pair) == 2
        assert run.v[pair[1]] == pytest.approx(-0.8 * run.v[pair[0]], rel=1e-14)

    def test_goes_on_bitwise(self, tmp_path):
        whole = pn.simulate(ball(), 4.5, record="energy", output_dt=0.01)
        path = tmp_path / "run"
        pn.simulate(ball(), 2.0, record="energy", output_dt=0.01, checkpoint=path)
        again = pn.rollout(ball(), np.array([[1.0]]), np.zeros((1, 1)), 4.5, record="energy", output_dt=0.01)[
            0
        ]
        assert_same_run(whole, again)

    def test_survives_a_file(self, run, tmp_path):
        read = pn.Trajectory.load(run.save(tmp_path / "run"))
        assert read.events == run.events
        assert (read.closed == run.closed).all()


@pytest.mark.parametrize("method", ["dop853", "dopri5", "rk4", "semi_implicit_euler"])
def test_nothing_is_leapt_over(method):
    """A sphere of 1 mm at 100 m/s above a plane: the first step has no upper bound."""
    contact = pn.PointContact("mass", radius=1e-3, restitution=0.5)
    scene = pn.Scene(point_mass("Z"), contacts=[contact], q0=[1.0], v0=[-100.0])
    step = {} if method.startswith("dop") else {"dt": 0.05}
    run = pn.simulate(scene, 1.0, method=method, **step)
    assert run.q.min() > 1e-3 - 1e-10
    assert len(at(run, "impact")) == 1


def test_a_spinning_rod_does_not_step_through():
    """Steps are unbounded without forces, but the rod's tip meets the plane in every turn."""
    model = empty((0.0, 0.0, 0.0))
    joint = body(model, 0, pin.JointModelRY(), "spin", 1.0, inertia=np.eye(3))
    frame(model, "tip", joint, pin.SE3(np.eye(3), np.array([1.0, 0.0, 0.0])))
    frame(model, "plane", 0, pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.999])))
    scene = pn.Scene(model, contacts=[pn.PointContact("tip", plane="plane", restitution=1.0)], v0=[50.0])
    run = pn.simulate(scene, 10.0)
    first = np.arcsin(0.999) / 50.0
    between = (2.0 * np.pi - 2.0 * (0.5 * np.pi - np.arcsin(0.999))) / 50.0
    impacts = at(run, "impact")
    assert impacts == pytest.approx(first + between * np.arange(len(impacts)), abs=TIME)
    assert len(impacts) == 1 + int((10.0 - first) / between)


class TestLadder:
    """A ladder between a smooth wall and a smooth floor leaves the wall at sin = 2/3 sin of its start."""

    LENGTH, MASS, START = 2.0, 3.0, np.deg2rad(70.0)
    DETACH, FLAT = 0.5975278060711656, 0.8383572339055728

    @pytest.fixture(scope="class")
    @classmethod
    def run(cls):
        half = 0.5 * cls.LENGTH
        model = planar(cls.MASS, cls.MASS * cls.LENGTH**2 / 12.0, [(-half, 0.0), (half, 0.0)])
        q0 = [half * np.cos(cls.START), half * np.sin(cls.START), cls.START]
        contacts = [
            pn.PointContact("c0", normal="x", name="wall"),
            pn.PointContact("c1", name="foot"),
            pn.PointContact("c0", name="top"),
        ]
        return pn.simulate(pn.Scene(model, contacts=contacts, q0=q0), 0.9, **TIGHT)

    def test_leaves_the_wall(self, run):
        assert at(run, "lift_off") == pytest.approx([self.DETACH], abs=TIME)
        k = int(np.searchsorted(run.t, self.DETACH - TIME))
        assert run.q[k, 2] == pytest.approx(0.6770054748534889, abs=TIME)
        assert run.v[k, 2] == pytest.approx(-2.146902956576026, abs=1e-8)
        assert run.v[k:, 0][run.t[k:] < self.FLAT] == pytest.approx(1.344952577225294, abs=1e-9)

    def test_lies_flat(self, run):
        assert at(run, "impact") == pytest.approx([self.FLAT] * 2, abs=TIME)
        assert run.closed[-1].tolist() == [False, True, True]
        assert (run.closed[0] == [True, True, False]).all()


class TestBox:
    """A box of 0.2 m by 0.5 m on an incline, at rest: it sticks, slides or tips."""

    WIDTH, HEIGHT, MASS = 0.2, 0.5, 2.0
    INERTIA = MASS * (WIDTH**2 + HEIGHT**2) / 12.0

    def solve(self, slope, mu):
        gravity = (GRAVITY * np.sin(slope), 0.0, -GRAVITY * np.cos(slope))
        b, h = 0.5 * self.WIDTH, 0.5 * self.HEIGHT
        model = planar(self.MASS, self.INERTIA, [(-b, -h), (b, -h)], gravity)
        contacts = [pn.PointContact(name, mu=mu) for name in ("c0", "c1")]
        scene = pn.Scene(model, contacts=contacts, q0=[0.0, h, 0.0])
        return scene.solve(scene.q0, scene.v0)

    def normal_forces(self, slope):
        weight = self.MASS * GRAVITY
        shift = 0.5 * self.HEIGHT * np.tan(slope) / (0.5 * self.WIDTH)
        return 0.5 * weight * np.cos(slope) * np.array([1.0 - shift, 1.0 + shift])

    @pytest.mark.parametrize("degrees", [10.0, 21.5])
    def test_sticks(self, degrees):
        now = self.solve(np.deg2rad(degrees), 0.5)
        assert np.abs(now.a).max() < TIME
        assert now.lam == pytest.approx(self.normal_forces(np.deg2rad(degrees)), abs=TIME)

    def test_slides(self):
        slope = np.deg2rad(20.0)
        now = self.solve(slope, 0.3)
        assert now.a == pytest.approx([GRAVITY * (np.sin(slope) - 0.3 * np.cos(slope)), 0.0, 0.0], abs=TIME)
        assert now.lam == pytest.approx([2.3045961524774405, 16.13217306734206], abs=TIME)

    @pytest.mark.parametrize("degrees", [22.0, 25.0, 30.0, 40.0])
    def test_tips(self, degrees):
        slope, mu = np.deg2rad(degrees), 0.45 if degrees == 30.0 else 0.5
        now = self.solve(slope, mu)
        b, h = self.WIDTH, self.HEIGHT
        arm = h * np.sin(slope) - b * np.cos(slope)
        turn = self.MASS * GRAVITY * arm / (2.0 * (self.INERTIA + 0.25 * self.MASS * (b * b + h * h)))
        assert now.a[2] == pytest.approx(turn, abs=TIME)
        assert now.closed.tolist() == [False, True]
        assert now.modes.tolist() == [2, 0]

    @pytest.mark.parametrize("side", [-1e-9, 1e-9])
    def test_thresholds(self, side):
        moves = side > 0.0
        at_mu = self.solve(np.arctan(0.3) + side, 0.3)
        assert at_mu.modes.tolist() == ([1, 1] if moves else [0, 0])
        assert (np.abs(at_mu.a).max() > 0.0) is np.bool_(moves)
        at_edge = self.solve(np.arctan(0.4) + side, 0.8)
        assert at_edge.closed.tolist() == [not moves, True]


class TestRockingBlock:
    """Housner's block, 0.1 m by 0.4 m (halves): each impact leaves 1 - 3/2 sin^2 of the speed."""

    RATIO = 0.9117647058823529
    IMPACTS = (
        0.3123085751126223, 0.8205922290826002, 1.2518767444618428, 1.6258666133099835,
        1.9545083364414038, 2.24587425737986, 2.5058174882183577, 2.7387975407110536,
    )  # fmt: skip
    REST = 5.022615621285641

    def scene(self, b, h, angle):
        model = planar(1.0, (b * b + h * h) / 3.0, [(-b, -h), (b, -h)])
        height = h * np.cos(angle) + b * np.sin(angle)
        contacts = [pn.PointContact(name, mu=10.0) for name in ("c0", "c1")]
        return pn.Scene(model, contacts=contacts, q0=[0.0, height, -angle])

    def test_impacts_and_rest(self):
        run = pn.simulate(self.scene(0.1, 0.4, 0.12248933156343207), 6.0, rtol=1e-11, atol=1e-12)
        times = np.unique(at(run, "impact"))
        assert times[:8] == pytest.approx(self.IMPACTS, abs=1e-8)
        for e in [e for e in run.events if e.kind == "impact"][:8]:
            assert e.v_plus[2] / e.v_minus[2] == pytest.approx(self.RATIO, abs=1e-10)
        assert at(run, "touch_down")[-1] == pytest.approx(self.REST, abs=1e-5)
        assert (run.v[-1] == 0.0).all()

    def test_a_squat_block_stops_at_once(self):
        run = pn.simulate(self.scene(0.4, 0.4 / np.sqrt(2.0) - 0.01, 0.1), 2.0)
        assert len(np.unique(at(run, "impact"))) == 1
        assert (run.v[-1] == 0.0).all()


class TestJointLimit:
    """A pendulum of 1 m from 1.2 rad against a stop, e = 0.7."""

    CASES: ClassVar = {
        0.0: (0.5507706469031259, 1.5968451064906684, 2.619946943273085, 3.63258974569535, 4.640280139016768),
        -0.3: (0.6366135699489149, 1.925676652357668, 3.280769153941376, 4.731264581928147),
        0.25: (0.47950121853760114, 1.3277278689404999, 2.076983874445435, 2.7197003576524867),
    }

    @staticmethod
    def model():
        model = empty()
        body(model, 0, pin.JointModelRY(), "swing", 1.0, lever=(0.0, 0.0, -1.0))
        return model

    @pytest.mark.parametrize("stop", CASES)
    def test_impacts(self, stop):
        limit = pn.JointLimit("swing", lower=stop, restitution=0.7)
        scene = pn.Scene(self.model(), contacts=[limit], q0=[1.2])
        assert scene.contact_names == ["JointLimit(swing) lower"]
        run = pn.simulate(scene, 10.0 if stop == 0.25 else 5.6, record="forces", rtol=1e-11, atol=1e-12)
        known = self.CASES[stop]
        assert at(run, "impact")[: len(known)] == pytest.approx(known, abs=TIME)
        if stop == 0.25:  # the pendulum comes to rest on its stop
            assert run.v[-1] == 0.0
            assert run.lam[-1] == pytest.approx([2.42703284028687], abs=1e-9)

    def test_stops_of_the_model(self):
        model = self.model()
        model.lowerPositionLimit[0], model.upperPositionLimit[0] = -0.5, 2.0
        scene = pn.Scene(model, contacts=[pn.JointLimit("swing", name="stop")])
        assert scene.contact_names == ["stop lower", "stop upper"]

    @pytest.mark.parametrize(
        ("make", "message"),
        [
            (
                lambda: pn.JointLimit("swing", lower=1.0, upper=0.0),
                "JointLimit: lower must be below upper; got 1 and 0",
            ),
            (
                lambda: pn.JointLimit("swing", restitution=1.5),
                "JointLimit: restitution must be at most 1; got 1.5",
            ),
            (
                lambda: pn.PointContact("c", restitution=-0.1),
                "PointContact: restitution must not be negative; got -0.1",
            ),
            (
                lambda: pn.Scene(TestJointLimit.model(), contacts=[pn.JointLimit("swing")]),
                'JointLimit: the model gives joint "swing" no finite limits; give lower or upper',
            ),
        ],
    )
    def test_bad_input(self, make, message):
        with pytest.raises(pn.InputError) as error:
            make()
        assert str(error.value) == message or message.split(":", 1)[1] in str(error.value)


class TestPercussion:
    """A rod of 1.2 m and 2 kg swings at 3 rad/s onto a stop at s, e = 0.5."""

    @pytest.mark.parametrize("s", [0.4, 0.8, 1.2])
    def test_impulse(self, s):
        length, mass, speed, e = 1.2, 2.0, 3.0, 0.5
        model = empty((0.0, 0.0, 0.0))
        inertia = mass * length**2 / 12.0 * np.eye(3)
        joint = body(
            model, 0, pin.JointModelRY(), "hinge", mass, lever=(0.5 * length, 0.0, 0.0), inertia=inertia
        )
        frame(model, "hit", joint, pin.SE3(np.eye(3), np.array([s, 0.0, 0.0])))
        scene = pn.Scene(model, contacts=[pn.PointContact("hit", restitution=e)], v0=[speed])
        run = pn.simulate(scene, 0.1)
        (impact,) = (e for e in run.events if e.kind == "impact")
        assert impact.time == 0.0
        assert impact.v_plus == pytest.approx([-e * speed], rel=ROUNDING)
        P = (1.0 + e) * mass * length**2 * speed / (3.0 * s)
        assert impact.impulse == pytest.approx([P, 0.0, 0.0], rel=ROUNDING)


@pytest.mark.parametrize(
    ("count", "e", "gap", "after", "times"),
    [
        (3, 1.0, 0.0, (-1 / 3, 2 / 3, 2 / 3), ()),
        (3, 0.7, 0.0, (-2 / 15, 17 / 30, 17 / 30), ()),
        (5, 1.0, 0.0, (-0.6, 0.4, 0.4, 0.4, 0.4), ()),
        (3, 1.0, 0.01, (0.0, 0.0, 1.0), (0.01, 0.02)),
        (3, 0.7, 0.01, (0.130875, 0.146625, 0.7225), (0.01, 0.021764705882352926, 0.3877777777777798)),
        (5, 1.0, 0.01, (0.0, 0.0, 0.0, 0.0, 1.0), (0.01, 0.02, 0.03, 0.04)),
    ],
)
def test_chains_of_balls(count, e, gap, after, times):
    """The first of equal balls arrives at 1 m/s; touching balls collide at once, others one by one."""
    model = empty((0.0, 0.0, 0.0))
    for k in range(count):
        frame(model, f"ball {k}", body(model, 0, pin.JointModelPX(), f"x{k}", 1.0))
    contacts = [
        pn.PointContact(f"ball {k + 1}", plane=f"ball {k}", normal="x", radius=0.1, restitution=e)
        for k in range(count - 1)
    ]
    scene = pn.Scene(
        model, contacts=contacts, q0=[k * (0.1 + gap) for k in range(count)], v0=[1.0] + [0.0] * (count - 1)
    )
    run = pn.simulate(scene, 1.0)
    assert run.v[-1] == pytest.approx(after, abs=ROUNDING)
    if times:
        assert at(run, "impact") == pytest.approx(times, abs=ROUNDING)


class TestTable:
    """A table on four legs with its weight at (x, y): minimum-norm nonnegative loads."""

    A, B, WEIGHT = 0.4, 0.3, 98.1
    LEGS = tuple(itertools.product((0.4, -0.4), (0.3, -0.3)))

    def scene(self, x, y, mu=0.5):
        model = empty()
        inertia = 1.0 * np.eye(3)
        joint = body(
            model,
            0,
            pin.JointModelFreeFlyer(),
            "table",
            self.WEIGHT / GRAVITY,
            lever=(x, y, 0.0),
            inertia=inertia,
        )
        for k, (u, v) in enumerate(self.LEGS):
            frame(model, f"leg {k}", joint, pin.SE3(np.eye(3), np.array([u, v, -0.5])))
        q0 = pin.neutral(model)
        q0[2] = 0.5
        return pn.Scene(model, contacts=[pn.PointContact(f"leg {k}", mu=mu) for k in range(4)], q0=q0)

    @pytest.mark.parametrize("place", [(0.0, 0.0), (0.1, 0.05), (0.2, 0.15)])
    def test_least_norm(self, place):
        scene = self.scene(*place)
        now = scene.solve(scene.q0, scene.v0)
        expected = [0.25 * self.WEIGHT * (1.0 + place[0] / u + place[1] / v) for u, v in self.LEGS]
        assert now.lam == pytest.approx(expected, abs=1e-9 * self.WEIGHT)
        assert np.abs(now.a).max() < 1e-10

    def test_an_unloaded_leg(self):
        scene = self.scene(0.25, 0.2)
        now = scene.solve(scene.q0, scene.v0)
        assert now.lam == pytest.approx([63.35625, 16.35, 18.39375, 0.0], abs=1e-9 * self.WEIGHT)
        assert now.closed.all()
        assert np.abs(now.a).max() < 1e-10
        run = pn.simulate(scene, 1.0)
        assert run.events == []
        assert (run.v == 0.0).all()


def test_methods_that_know_no_contacts_that_open():
    message = 'simulate: method "Radau" cannot open and close contacts, and "PointContact(mass)" may open'
    with pytest.raises(pn.InputError, match=message.replace("(", r"\(").replace(")", r"\)")):
        pn.simulate(ball(), 1.0, method="Radau")


def test_the_report_names_contacts_and_stops():
    """Limits with stops are not reported as limits that the motion may exceed."""
    model = TestJointLimit.model()
    model.lowerPositionLimit[0], model.upperPositionLimit[0] = -0.5, 2.0
    text = pn.Scene(model, contacts=[pn.JointLimit("swing", name="stop")]).report()
    assert "  contact stop lower: 1 rows, may open\n" in text
    assert "may pass" not in text
    assert "redundant" not in text
    assert "  contact PointContact(mass): 1 rows, may open\n" in ball().report()


def test_open_contacts_are_no_rows():
    """In flight a scene is bitwise the same as without contacts; its start takes one more evaluation."""
    plain = pn.simulate(pn.Scene(point_mass("XYZ"), q0=[0.0, 0.0, 1.0], v0=[1.0, 0.0, 3.0]), 0.5)
    contact = pn.PointContact("mass", mu=0.5)
    flying = pn.simulate(
        pn.Scene(point_mass("XYZ"), contacts=[contact], q0=[0.0, 0.0, 1.0], v0=[1.0, 0.0, 3.0]), 0.5
    )
    assert (flying.q == plain.q).all()
    assert flying.stats.evaluations <= plain.stats.evaluations + 1
    assert not flying.closed.any()
    assert (flying.violation == 0.0).all()


def test_dropped_on_a_conveyor():
    """A point mass falls on a belt of 1.5 m/s with e = 0.5: friction at impacts accelerates it."""
    model = empty()
    frame(model, "belt", body(model, 0, pin.JointModelPX(), "drive", 1.0))
    joint = body(model, 0, pin.JointModelPX(), "x", 0.0)
    frame(model, "block", body(model, joint, pin.JointModelPZ(), "z", 1.0))
    drive = pn.PrescribedMotion("drive", pn.polynomial([0.0, 1.5]))
    contact = pn.PointContact("block", mu=0.25, plane="belt", restitution=0.5)
    scene = pn.Scene(model, constraints=[drive], contacts=[contact], q0=[0.0, 0.0, 0.2], v0=[1.5, 0.0, 0.0])
    run = pn.simulate(scene, 1.0, record="energy", rtol=1e-11, atol=1e-12)
    impacts = [(e.time, e.v_plus[1]) for e in run.events if e.kind == "impact"]
    known = [(0.2019275109384609, 0.7428408308648631), (0.4038550218769218, 1.1142612462972945)]
    assert np.array(impacts[:2]) == pytest.approx(np.array(known), abs=1e-8)
    assert at(run, "touch_down") == pytest.approx([0.6057825328153827], abs=1e-8)
    assert at(run, "stick") == pytest.approx([0.6116207951070336], abs=1e-8)
    assert np.abs(run.energy["balance"]).max() < 1e-11


@pytest.mark.parametrize(("part", "holds"), [(1.0 + 1e-9, True), (1.0 - 1e-9, False)])
def test_a_gripper(part, holds):
    """Two fingers with mu = 0.6 hold a block of 0.5 kg above m g / (2 mu), without creep."""
    model, force = empty(), part * 0.5 * GRAVITY / 1.2
    joint = body(model, 0, pin.JointModelPX(), "x", 0.0)
    joint = body(model, joint, pin.JointModelPZ(), "z", 0.5)
    for side, x in (("left", -0.02), ("right", 0.02)):
        place = pin.SE3(np.eye(3), np.array([x, 0.0, 0.0]))
        frame(model, side, joint, place)
        frame(model, f"{side} finger", body(model, 0, pin.JointModelPX(), f"{side} slide", 0.1), place)
    contacts = [
        pn.PointContact(side, mu=0.6, plane=f"{side} finger", normal=(sign, 0.0, 0.0))
        for side, sign in (("left", 1.0), ("right", -1.0))
    ]
    scene = pn.Scene(model, contacts=contacts, actuation=np.array([0.0, 0.0, force, -force]))
    now = scene.solve(scene.q0, scene.v0)
    assert now.lam == pytest.approx([force, force], rel=1e-12)
    assert now.a[1] == pytest.approx(0.0 if holds else 2.0 * 0.6 * force / 0.5 - GRAVITY, abs=1e-13)
    if holds:
        run = pn.simulate(scene, 60.0)
        assert (run.q == run.q[0]).all()


def test_a_stack_with_a_heavy_top():
    model = empty()
    for k, mass in enumerate((1.0, 1.0, 1000.0)):
        frame(model, f"b{k}", body(model, 0, pin.JointModelPZ(), f"z{k}", mass))
    above = [pn.PointContact(f"b{k}", plane=f"b{k - 1}", radius=0.1) for k in (1, 2)]
    scene = pn.Scene(model, contacts=[pn.PointContact("b0"), *above], q0=[0.0, 0.1, 0.2])
    now = scene.solve(scene.q0, scene.v0)
    assert now.lam == pytest.approx([9829.62, 9819.81, 9810.0], rel=1e-9)
    run = pn.simulate(scene, 60.0)
    assert (run.q == run.q[0]).all()


def test_a_deep_start_is_refused():
    """A penetration of 1 mm is corrected; more than a hundredth of the scene's size raises an error."""
    scene = pn.Scene(point_mass("Z"), contacts=[pn.PointContact("mass", name="foot")])
    q, _ = scene.project([-1e-3])
    assert abs(q[0]) < 1e-14
    with pytest.raises(pn.InputError) as error:
        pn.simulate(scene, 1.0, q=[-0.1])
    assert (
        'contact "foot" starts with a penetration of 0.1 (m or rad) at t = 0 s; it must start open, closed'
        in str(error.value)
    )
