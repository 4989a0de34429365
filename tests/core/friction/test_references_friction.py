"""Dry friction against closed forms: times and states of every stick, slip and reversal.

Each problem is modelled in several ways that are the same mechanics: friction of a joint, of a contact, of a
hinge anchor, or a user's own along constraint rows.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ...support.mechanisms import (
    GRAVITY,
    TIGHT,
    assert_close,
    at_events,
    body,
    empty,
    frame,
    hinge,
    point_mass,
    sample,
)

# Tolerance of times and states of events.
EVENT = 1e-9


def kinds(run):
    return [event.kind for event in run.events]


def times(run):
    return [event.time for event in run.events]


def slider(joint="mass", gravity=(0.0, 0.0, -GRAVITY)):
    """A mass of 1 kg on a slide along x."""
    model = empty(gravity)
    body(model, 0, pin.JointModelPX(), joint, 1.0)
    return model


class TestBelt:
    """m x'' + k x = F on a belt: sticks up to Fs, slips under Fk; m = 1, k = 100, v = 0.1, Fs = 8, Fk = 5.

    T_slip = (2/om)(pi - atan((Fs - Fk) om/(k v))), T_stick = 2 (Fs - Fk)/(k v), sticks again at
    x = (2 Fk - Fs)/k.
    """

    STIFFNESS, SPEED, KINETIC, RATIO = 100.0, 0.1, 5.0, 8.0 / 5.0
    SLIP, PERIOD = 0.37850937623830777, 0.9785093762383077
    BREAK_AWAY, RESTICK = 0.08, 0.02

    @property
    def drive(self):
        return pn.PrescribedMotion("belt", pn.polynomial([self.BREAK_AWAY, self.SPEED]))

    def on_the_belt(self):
        """The mass slides on the belt's body, whose motion is prescribed; q = (belt, mass on belt)."""
        model = empty()
        belt = body(model, 0, pin.JointModelPX(), "belt", 3.0)
        body(model, belt, pin.JointModelPX(), "mass", 1.0)
        spring = pn.UserForce(lambda t, q, v: np.full(2, -self.STIFFNESS * (q[0] + q[1])))
        rub = pn.JointFriction("mass", coulomb=self.KINETIC, static_ratio=self.RATIO)
        start = {"q0": [self.BREAK_AWAY, 0.0], "v0": [self.SPEED, 0.0]}
        scene = pn.Scene(model, constraints=[self.drive], laws=[rub], forces=[spring], **start)
        return scene, lambda x: x.sum(axis=1)

    def pressed_by_its_weight(self):
        """The mass lies on the belt as a contact, with mu m g = Fk; q = (belt, x, z)."""
        model = empty()
        body(model, 0, pin.JointModelPX(), "belt", 3.0)
        slide = body(model, 0, pin.JointModelPX(), "x", 0.0)
        body(model, slide, pin.JointModelPZ(), "mass", 1.0)
        rub = pn.PointContact("mass", mu=self.KINETIC / GRAVITY, static_ratio=self.RATIO, plane="belt")
        start = {"q0": [self.BREAK_AWAY, self.BREAK_AWAY, 0.0], "v0": [self.SPEED, self.SPEED, 0.0]}
        spring = pn.JointSpring("x", self.STIFFNESS)
        scene = pn.Scene(model, constraints=[self.drive], contacts=[rub], forces=[spring], **start)
        return scene, lambda x: x[:, 1]

    @pytest.mark.parametrize("build", [on_the_belt, pressed_by_its_weight])
    def test_limit_cycle(self, build):
        scene, of_mass = build(self)
        run = pn.simulate(scene, 4.0, **TIGHT)
        cycles = np.arange(5) * self.PERIOD
        expected = np.column_stack([cycles, cycles + self.SLIP]).ravel()[:9]
        assert kinds(run) == ["slip", "stick"] * 4 + ["slip"]
        assert_close(times(run), expected, EVENT)
        at = at_events(run)
        x, v = of_mass(run.q)[at], of_mass(run.v)[at]
        assert_close(x[0::2], self.BREAK_AWAY, EVENT)
        assert_close(x[1::2], self.RESTICK, EVENT)
        assert_close(v, self.SPEED, EVENT)


class TestCoulombOscillator:
    """m x'' + k x = -F sgn x': each half period the amplitude falls by 2 F/k; m = 1, k = 100, F = 3."""

    TURNING = (-0.44, 0.38, -0.32, 0.26, -0.2, 0.14, -0.08, 0.02)
    HALF_PERIOD = np.pi / 10.0
    COULOMB = 3.0
    SPRING = pn.JointSpring("mass", 100.0)

    def constant(self):
        return pn.Scene(
            slider(), laws=[pn.JointFriction("mass", coulomb=self.COULOMB)], forces=[self.SPRING], q0=[0.5]
        )

    def loaded(self, reaction="total"):
        """The guide carries the weight: limit mu m g."""
        rub = pn.JointFriction("mass", mu=self.COULOMB / GRAVITY, reaction=reaction)
        return pn.Scene(slider(), laws=[rub], forces=[self.SPRING], q0=[0.5])

    def loaded_ideal(self):
        return self.loaded("ideal")

    def user(self):
        rub = pn.UserFriction(lambda t, q: [1.0], lambda t, q, v, reactions: self.COULOMB)
        return pn.Scene(slider(), laws=[rub], forces=[self.SPRING], q0=[0.5])

    def user_loaded(self):
        """The same limit read from the wrench of the guide."""

        def limit(t, q, v, reactions):
            return self.COULOMB / GRAVITY * abs(reactions.wrench("mass")[2])

        rub = pn.UserFriction(lambda t, q: [-2.0], lambda *given: 0.5 * limit(*given))
        return pn.Scene(slider(), laws=[rub], forces=[self.SPRING], q0=[0.5])

    def contact(self, axes="XZ"):
        rub = pn.PointContact("mass", mu=self.COULOMB / GRAVITY)
        start = [0.5] + [0.0] * (len(axes) - 1)
        return pn.Scene(point_mass(axes), contacts=[rub], forces=[pn.JointSpring("x", 100.0)], q0=start)

    def contact_in_space(self):
        return self.contact("XYZ")

    @pytest.mark.parametrize(
        "build", [constant, loaded, loaded_ideal, user, user_loaded, contact, contact_in_space]
    )
    def test_turning_points(self, build):
        run = pn.simulate(build(self), 3.0, **TIGHT)
        assert kinds(run) == ["reverse"] * 7 + ["stick"]
        assert_close(times(run), self.HALF_PERIOD * np.arange(1, 9), EVENT)
        at = at_events(run)
        assert_close(run.q[at, 0], self.TURNING, EVENT)
        assert_close(run.v[at, 0], 0.0, EVENT)
        assert_close(run.q[-1, 0], self.TURNING[-1], EVENT)

    @pytest.mark.parametrize(
        "build", [constant, loaded, loaded_ideal, user, user_loaded, contact, contact_in_space]
    )
    def test_rest_position_at_default_tolerances(self, build):
        """Default step control, 1e-8: eight half swings keep the amplitude to a few times that."""
        run = pn.simulate(build(self), 3.0)
        assert_close(run.q[-1, 0], self.TURNING[-1], 1e-8)


class TestPendulumWithDryPivot:
    """m l^2 th'' = -m g l sin th - tau sgn th', with m = l = 1 and tau = 0.5, from rest at 1.2 rad.

    Turning points: (g/l)(cos a1 - cos a0) = tau/(m l^2)(a0 + a1).
    """

    START, TAU = 1.2, 0.5
    ANGLES = (-1.0722269853091775, 0.9505134435351651, -0.8336202985738322)
    TIMES = (1.09175148829423, 2.1640287812161425, 3.220318773990451)

    def joint(self, **law):
        model = empty()
        body(model, 0, hinge(0.0, -1.0, 0.0), "pivot", 1.0, lever=(0.0, 0.0, -1.0))
        rub = pn.JointFriction("pivot", **(law or {"coulomb": self.TAU}))
        return pn.Scene(model, laws=[rub], q0=[self.START]), lambda q: q[:, 0]

    def preloaded(self):
        return self.joint(preload=0.3, coulomb=0.2)

    def endless(self):
        """A joint that stores (cos, sin)."""
        model = empty()
        body(model, 0, pin.JointModelRUBY(), "pivot", 1.0, lever=(0.0, 0.0, -1.0))
        rub = pn.JointFriction("pivot", coulomb=self.TAU)
        start = [np.cos(self.START), -np.sin(self.START)]
        return pn.Scene(model, laws=[rub], q0=start), lambda q: np.arctan2(-q[:, 1], q[:, 0])

    def user(self):
        model = empty()
        body(model, 0, hinge(0.0, -1.0, 0.0), "pivot", 1.0, lever=(0.0, 0.0, -1.0))
        rub = pn.UserFriction(lambda t, q: [1.0], lambda t, q, v, reactions: self.TAU)
        return pn.Scene(model, laws=[rub], q0=[self.START]), lambda q: q[:, 0]

    def cartesian(self):
        """A point mass on a rod, with friction along the turn: direction d theta/dq."""
        rub = pn.UserFriction(
            lambda t, q: np.array([-q[1], q[0]]) / (q @ q), lambda t, q, v, reactions: self.TAU
        )
        start = [np.sin(self.START), -np.cos(self.START)]
        rod = pn.Distance("mass", "origin", length=1.0)
        scene = pn.Scene(point_mass("XZ"), constraints=[rod], laws=[rub], q0=start)
        return scene, lambda q: np.arctan2(q[:, 0], -q[:, 1])

    def cut(self, frames=("bob", "ground")):
        """A free body held by a hinge anchor; m l = 1 and m l^2 + I = 1."""
        model = empty()
        inertia = np.diag([0.3, 0.2, 0.1])
        body(model, 0, pin.JointModelFreeFlyer(), "bob", 1.25, lever=(0.0, 0.0, -0.8), inertia=inertia)
        frame(model, "ground", 0)
        pivot = pn.HingeAnchor(*frames, axis="y", name="pivot")
        start = [0.0, 0.0, 0.0, 0.0, -np.sin(0.5 * self.START), 0.0, np.cos(0.5 * self.START)]
        rub = pn.JointFriction("pivot", coulomb=self.TAU)
        scene = pn.Scene(model, constraints=[pivot], laws=[rub], q0=start)
        return scene, lambda q: -2.0 * np.arctan2(q[:, 4], q[:, 6])

    def cut_the_other_way(self):
        return self.cut(("ground", "bob"))

    @pytest.mark.parametrize("build", [joint, preloaded, endless, user, cartesian, cut, cut_the_other_way])
    def test_turning_points(self, build):
        scene, angle = build(self)
        run = pn.simulate(scene, 3.3, **TIGHT)
        assert kinds(run) == ["reverse"] * 3
        assert_close(times(run), self.TIMES, EVENT)
        assert_close(angle(run.q)[at_events(run)], self.ANGLES, EVENT)


class TestBlockOnIncline:
    """Thrown up at 3 m/s on a slope of 30 degrees: s'' = -g (sin a + mu cos a), returns when tan a > mu."""

    SLOPE, MU, SPEED = np.pi / 6.0, 0.2, 3.0
    TOP_TIME, TOP = 0.4542603826009345, 0.6813905739014018
    RETURN_TIME, RETURN_SPEED = 1.1062503408749726, 2.0901873265201623
    NORMAL = 8.495709211125344
    UP = np.array([np.cos(SLOPE), 0.0, np.sin(SLOPE)])
    OUT = np.array([-np.sin(SLOPE), 0.0, np.cos(SLOPE)])
    PLANE = pin.SE3(np.column_stack([UP, [0.0, 1.0, 0.0], OUT]), np.zeros(3))

    def guide(self, mu, reaction="total"):
        """A slide along the slope, whose load is the normal force."""
        model = empty()
        body(model, 0, pin.JointModelPX(), "block", 1.0, place=self.PLANE)
        rub = pn.JointFriction("block", mu=mu, reaction=reaction)
        return pn.Scene(model, laws=[rub], v0=[self.SPEED]), lambda x: x[:, 0]

    def guide_ideal(self, mu):
        return self.guide(mu, "ideal")

    def contact(self, mu, axes="XZ"):
        model = point_mass(axes)
        frame(model, "plane", 0, self.PLANE)
        rows = ["XYZ".index(a) for a in axes]
        rub = pn.PointContact("mass", mu=mu, plane="plane", name="plane")
        scene = pn.Scene(model, contacts=[rub], v0=self.SPEED * self.UP[rows])
        return scene, lambda x: x @ self.UP[rows]

    def contact_in_space(self, mu):
        return self.contact(mu, "XYZ")

    def user(self, mu, held=None):
        """A row of the user's that keeps the block on the plane, and friction from its multiplier."""
        normal, along = self.OUT[[0, 2]], self.UP[[0, 2]]
        model = point_mass("XZ")
        frame(model, "plane", 0, self.PLANE)
        rows = held or pn.UserConstraint(
            lambda t, q, v, data: (normal[None, :], [0.0]),
            1,
            residual=lambda t, q: [normal @ q],
            rate=lambda t, q, v: [normal @ v],
            name="plane",
        )
        rub = pn.UserFriction(lambda t, q: along, lambda t, q, v, reactions: mu * abs(reactions["plane"][0]))
        scene = pn.Scene(model, constraints=[rows], laws=[rub], v0=self.SPEED * along)
        return scene, lambda x: x @ along

    def anchored(self, mu):
        return self.user(mu, pn.PointAnchor("mass", "plane", axes="z", name="plane"))

    WAYS = (guide, guide_ideal, contact, contact_in_space, user, anchored)

    @pytest.mark.parametrize("build", WAYS)
    def test_returns(self, build):
        scene, along = build(self, self.MU)
        run = pn.simulate(scene, self.RETURN_TIME, record="forces", **TIGHT)
        assert kinds(run) == ["reverse"]
        assert_close(times(run), self.TOP_TIME, EVENT)
        top = at_events(run)[0]
        assert_close(along(run.q)[[top, -1]], [self.TOP, 0.0], 1e-10)
        assert_close(along(run.v)[[top, -1]], [0.0, -self.RETURN_SPEED], 1e-10)
        if "plane" in scene.constraint_slices:
            assert_close(run.lam[:, 0], self.NORMAL, 1e-10)

    @pytest.mark.parametrize("build", WAYS)
    def test_stays_up_on_a_rougher_plane(self, build):
        """With tan a < mu the block sticks at its highest point, and stays."""
        mu = 0.6
        deceleration = GRAVITY * (np.sin(self.SLOPE) + mu * np.cos(self.SLOPE))
        scene, along = build(self, mu)
        run = pn.simulate(scene, 5.0, **TIGHT)
        assert kinds(run) == ["stick"]
        assert_close(times(run), self.SPEED / deceleration, EVENT)
        assert_close(along(run.q)[at_events(run)[0] :], 0.5 * self.SPEED**2 / deceleration, 1e-10)

    @pytest.mark.parametrize("ways", [1.0 + 1e-6, 1.0 - 1e-6])
    def test_ball_rolls_when_rough_enough(self, ways):
        """A solid sphere rolls iff mu >= (2/7) tan a, with (5/7) g sin a; else it slides and spins up."""
        mu, radius = 0.16495721976846447 * ways, 0.1
        model = point_mass("XZ", mass=0.0)
        body(model, 2, hinge(0.0, 1.0, 0.0), "ball", 1.0, inertia=0.4 * radius**2 * np.eye(3))
        frame(model, "plane", 0, self.PLANE)
        rub = pn.PointContact("ball", mu=mu, radius=radius, plane="plane")
        start = [*(radius * self.OUT[[0, 2]]), 0.0]
        a = pn.Scene(model, contacts=[rub], q0=start).solve(start, np.zeros(3)).a
        if ways > 1.0:
            along = -5.0 / 7.0 * GRAVITY * np.sin(self.SLOPE)
            spin = along / radius
        else:
            along = -GRAVITY * (np.sin(self.SLOPE) - mu * np.cos(self.SLOPE))
            spin = -2.5 * mu * GRAVITY * np.cos(self.SLOPE) / radius
        assert_close(a, [*(along * self.UP[[0, 2]]), spin], 1e-10)


class TestBeadOnRoughRing:
    """m v' = -m g sin th - mu |N|, N = m (v^2/R + g cos th): linear in v^2 over the angle; R = 1, mu = 0.25.

    The vertical ring of Udwadia and Kalaba's nonideal examples.
    """

    MU = 0.25
    STOP_ANGLE, STOP_TIME = 0.9405244957806624, 0.45107459344945044
    ANGLE_AT_0P2, RATE_AT_0P2 = 0.6446178976906048, 2.354981131780303
    LOOP_TIME, SPEED_AFTER_LOOP = 1.201799564074831, 4.400375469951236

    def pivot(self, speed):
        """The mass on an arm whose pin of radius R rubs: the pin also carries mu' R |f| along the circle, so
        mu' = mu/sqrt(1 + mu^2) makes mu' |f| equal to mu |N|."""
        model = empty()
        body(model, 0, hinge(0.0, -1.0, 0.0), "pin", 1.0, lever=(0.0, 0.0, -1.0))
        rub = pn.JointFriction("pin", mu=self.MU / np.sqrt(1.0 + self.MU**2), radius=1.0)
        scene = pn.Scene(model, laws=[rub], v0=[speed])
        return scene, lambda run: (run.q[:, 0], run.v[:, 0])

    def _cartesian(self, speed, ring, rub):
        scene = pn.Scene(point_mass("XZ"), constraints=[ring], laws=[rub], q0=[0.0, -1.0], v0=[speed, 0.0])

        def angle_and_rate(run):
            (x, z), (vx, vz) = run.q.T, run.v.T
            return np.unwrap(np.arctan2(x, -z)), vz * x - vx * z

        return scene, angle_and_rate

    @property
    def circle(self):
        """x^2 + z^2 = R^2, as the paper writes it; its multiplier is N/R."""
        return pn.UserConstraint(
            lambda t, q, v, data: (q[None, :], [-v @ v]),
            1,
            residual=lambda t, q: [0.5 * (q @ q - 1.0)],
            rate=lambda t, q, v: [q @ v],
            name="ring",
        )

    def limit(self, t, q, v, reactions):
        return self.MU * abs(reactions["ring"][0])

    def friction(self, speed, ring=None):
        rub = pn.UserFriction(lambda t, q: [-q[1], q[0]], self.limit)
        return self._cartesian(speed, ring or self.circle, rub)

    def friction_on_a_rod(self, speed):
        return self.friction(speed, pn.Distance("mass", "origin", length=1.0, name="ring"))

    def law(self, speed, ring=None):
        """C = -mu |N| v/|v|: no modes, so no events."""

        def rubbing(t, q, v, reactions):
            return -self.limit(t, q, v, reactions) * v / max(np.linalg.norm(v), 1e-300)

        return self._cartesian(speed, ring or self.circle, pn.UserLaw(rubbing, reaction="total"))

    def law_on_a_rod(self, speed):
        return self.law(speed, pn.Distance("mass", "origin", length=1.0, name="ring"))

    WAYS = (pivot, friction, friction_on_a_rod, law, law_on_a_rod)

    @pytest.mark.parametrize("build", WAYS)
    def test_slow_bead(self, build):
        scene, angle_and_rate = build(self, 4.0)
        run = pn.simulate(scene, 0.4 if "law" in build.__name__ else 0.5, output_dt=0.2, **TIGHT)
        angle, rate = angle_and_rate(run)
        k = sample(run, 0.2)
        assert_close((angle[k], rate[k]), (self.ANGLE_AT_0P2, self.RATE_AT_0P2), 1e-10)
        if scene.element_names:
            assert kinds(run) == ["reverse"]  # too steep to stick there
            assert_close(times(run), self.STOP_TIME, EVENT)
            top = at_events(run)[0]
            assert_close((angle[top], rate[top]), (self.STOP_ANGLE, 0.0), EVENT)

    @pytest.mark.parametrize("build", WAYS)
    def test_fast_bead(self, build):
        """A bead passes the loop with two zeros of N, kinks of |N|, and loses two thirds of its speed."""
        scene, angle_and_rate = build(self, 12.0)
        run = pn.simulate(scene, self.LOOP_TIME, **TIGHT)
        angle, rate = angle_and_rate(run)
        assert_close((angle[-1], rate[-1]), (2.0 * np.pi, self.SPEED_AFTER_LOOP), EVENT)
        assert run.events == []
