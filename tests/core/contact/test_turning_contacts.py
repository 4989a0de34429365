"""Torsional and rolling resistance of contacts with a plane, against closed forms and a dense sphere."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

import pin_nonideal as pn

from ...support.mechanisms import GRAVITY, TIGHT, TIGHTER, again, assert_close, body, empty, frame
from ...support.refusals import refuses

MASS, RADIUS = 2.0, 0.1
UP = np.array([0.0, 0.0, 1.0])


def ball(v, *, contact=None, rolling=None, forces=(), slope=0.0, J=None, plane=None, **options):
    """Return a ball of RADIUS on a plane tilted about y; v is (velocity, angular velocity) in world axes."""
    model = empty((GRAVITY * np.sin(slope), 0.0, -GRAVITY * np.cos(slope)))
    J = 0.4 * MASS * RADIUS**2 if J is None else J
    index = body(model, 0, pin.JointModelFreeFlyer(), "ball", MASS, inertia=J * np.eye(3))
    frame(model, "center", index)
    if plane is not None:
        frame(model, "ground", 0, plane)
    name = None if plane is None else "ground"
    contacts = (
        []
        if contact is None
        else [pn.PointContact("center", radius=RADIUS, plane=name, name="floor", **contact)]
    )
    rolls = (
        []
        if rolling is None
        else [pn.Rolling("center", RADIUS, axis=None, plane=name, name="floor", **rolling)]
    )
    q0 = [0.0, 0.0, RADIUS, 0.0, 0.0, 0.0, 1.0]
    return pn.Scene(model, contacts=contacts, constraints=rolls, forces=forces, q0=q0, v0=v, **options)


def rolling_along(angle, speed):
    """Return velocity and angular velocity of a ball that rolls in a direction."""
    along = np.array([np.cos(angle), np.sin(angle), 0.0])
    return [*(speed * along), *(speed / RADIUS * np.cross(UP, along))]


WAYS = {
    "contact": lambda **r: {"contact": {"mu": 0.8, **r}},
    "rolling": lambda **r: {"rolling": r},
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("terms", ["core", "pinocchio"])
class TestSpinning:
    TORSIONAL = 0.003

    @pytest.mark.parametrize("rate", [8.0, -3.0])
    def test_stops_in_time(self, way, terms, rate):
        """J w' = -torsional m g."""
        scene = ball([0, 0, 0, 0, 0, rate], J=0.005, terms=terms, **WAYS[way](torsional=self.TORSIONAL))
        run = pn.simulate(scene, 1.5, record="energy", **TIGHT)
        (event,) = [e for e in run.events if e.element == "floor torsional"]
        assert event.kind == "stick"
        assert event.time == pytest.approx(0.005 * abs(rate) / (self.TORSIONAL * MASS * GRAVITY), rel=1e-9)
        assert_close(run.v[-1], 0.0, 0.0 if way == "contact" else 1e-15)
        assert run.energy["floor"][-1] == pytest.approx(-0.5 * 0.005 * rate**2, rel=1e-9)

    @pytest.mark.parametrize(("share", "mode"), [(1.0 - 1e-9, 0), (1.0 + 1e-6, 1)])
    def test_holds_a_torque(self, way, terms, share, mode):
        torque = share * self.TORSIONAL * MASS * GRAVITY
        push = pn.Wrench("center", [0, 0, 0, 0, 0, torque])
        scene = ball(np.zeros(6), forces=[push], terms=terms, **WAYS[way](torsional=self.TORSIONAL))
        modes = dict(zip(scene.element_names, scene.solve(scene.q0, scene.v0).modes, strict=True))
        assert modes["floor torsional"] == mode


@pytest.mark.parametrize("way", WAYS)
class TestRolling:
    LEVER = 0.002

    @pytest.mark.parametrize("angle", [0.0, 0.8, 2.2])
    def test_stops_after_its_distance(self, way, angle):
        """(J + m R^2) w' = -rolling m g, so that the ball rolls v^2 (J/R^2 + m) R/(2 rolling m g) far."""
        speed, inertia = 1.2, 1.4 * MASS
        scene = ball(rolling_along(angle, speed), **WAYS[way](rolling=self.LEVER))
        run = pn.simulate(scene, 10.0, record="energy", **TIGHTER)
        slowing = self.LEVER * MASS * GRAVITY / (RADIUS * inertia)
        distance = speed**2 / (2.0 * slowing) * np.array([np.cos(angle), np.sin(angle)])
        assert_close(run.q[-1, :2], distance, 1e-8)
        (event,) = [e for e in run.events if e.element == "floor rolling"]
        assert event.time == pytest.approx(speed / slowing, rel=1e-8)
        assert_close(run.v[-1], 0.0, 1e-12)
        assert run.energy["floor"][-1] == pytest.approx(-0.5 * inertia * speed**2, rel=1e-8)

    @pytest.mark.parametrize("share", [1.0 - 1e-6, 1.1])
    def test_rests_on_a_slope(self, way, share):
        """A ball rests on slopes up to tan(slope) = rolling/radius."""
        slope = np.arctan(share * self.LEVER / RADIUS)
        run = pn.simulate(ball(np.zeros(6), slope=slope, **WAYS[way](rolling=self.LEVER)), 2.0, **TIGHT)
        if share < 1.0:
            assert_close(run.v[-1], 0.0, 1e-15)
            return
        torque = MASS * GRAVITY * (np.sin(slope) * RADIUS - self.LEVER * np.cos(slope))
        assert np.linalg.norm(run.v[-1, :3]) == pytest.approx(
            2.0 * RADIUS * torque / (1.4 * MASS * RADIUS**2), rel=1e-6
        )

    def test_moving_plane_of_other_axes(self, way):
        """The orientation of the plane's frame has no effect."""
        turned = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, 1.1), np.array([3.0, 1.0, 0.0]))
        options = WAYS[way](rolling=self.LEVER, torsional=0.001)
        v = [*rolling_along(0.3, 1.0)[:5], 4.0]
        a, b = (ball(v, plane=plane, **options) for plane in (None, turned))
        assert_close(a.acceleration(a.q0, v), b.acceleration(b.q0, v), 1e-12)


def test_disk_that_rolls_upright():
    """A wheel of Rolling comes to rest like the ball, with its moment of inertia."""
    model = empty()
    index = body(model, 0, pin.JointModelFreeFlyer(), "wheel", MASS, inertia=np.diag([0.006, 0.011, 0.006]))
    frame(model, "hub", index)
    wheel = pn.Rolling("hub", RADIUS, axis="y", rolling=0.004, name="tread")
    v0 = [0.5, 0.0, 0.0, 0.0, 5.0, 0.0]
    scene = pn.Scene(model, constraints=[wheel], q0=[0, 0, RADIUS, 0, 0, 0, 1], v0=v0)
    run = pn.simulate(scene, 2.0, **TIGHTER)
    slowing = 0.004 * MASS * GRAVITY * RADIUS / (0.011 + MASS * RADIUS**2)
    event = next(e for e in run.events if e.element == "tread rolling")
    assert event.time == pytest.approx(0.5 / slowing, rel=1e-8)
    assert run.q[-1, 0] == pytest.approx(0.5**2 / (2.0 * slowing), rel=1e-7)


@pytest.mark.parametrize("seed", range(4))
def test_modes_that_are_prescribed_go_the_way_of_the_velocity(seed):
    """`solve(modes=)` with the modes of the velocity has the same result for either direction."""
    v = np.random.default_rng(seed).normal(0.0, 1.0, 6)
    scene = ball(v, contact={"mu": 0.3, "torsional": 0.004, "rolling": 0.002})
    q, v = scene.project(scene.q0, v)
    s = scene.solve(q, v)
    assert_close(scene.solve(q, v, modes=s.modes).a, s.a, 1e-12)


class TestSphereOfItsOwn:
    """Simultaneous sliding, spinning and rolling, against Newton's and Euler's equations of the sphere."""

    MU, TORSIONAL, LEVER = 0.2, 0.004, 0.006
    J = 0.4 * MASS * RADIUS**2

    def rate(self, t, y):
        """Return the derivative of (velocity, angular velocity) while all elements slip."""
        v, w = y[:3], y[3:]
        weight, arm = MASS * GRAVITY, -RADIUS * UP
        u = v + np.cross(w, arm)
        rub = -self.MU * weight * u / np.linalg.norm(u)
        over = w - w[2] * UP
        torque = np.cross(arm, rub) - self.LEVER * weight * over / np.linalg.norm(over)
        torque = torque - self.TORSIONAL * weight * np.sign(w[2]) * UP
        return np.concatenate([rub / MASS, torque / self.J])

    @pytest.mark.parametrize("seed", range(6))
    def test_trajectory(self, seed):
        rng = np.random.default_rng(seed)
        y0 = np.concatenate([rng.normal(0.0, 2.0, 2), [0.0], rng.normal(0.0, 20.0, 3)])
        y0[3:5] += 15.0
        contact = {"mu": self.MU, "torsional": self.TORSIONAL, "rolling": self.LEVER}
        scene = ball(y0, contact=contact)
        run = pn.simulate(scene, 3.0, record="energy", **TIGHT)
        assert np.abs(run.energy["balance"]).max() < 1e-9
        until = run.events[0].time
        assert until > 0.05
        own = solve_ivp(self.rate, (0.0, until), y0, rtol=1e-12, atol=1e-13, method="DOP853")
        i = int(np.flatnonzero(run.t == until)[0])
        turn = pin.Quaternion(run.q[i, 3:7]).toRotationMatrix()
        assert_close(np.concatenate([turn @ run.v[i, :3], turn @ run.v[i, 3:]]), own.y[:, -1], 1e-8)


def test_the_order_of_a_list_decides_nothing():
    """Four feet spin and slide."""
    feet = [(0.3, 0.2, -0.1), (0.3, -0.2, -0.1), (-0.3, -0.2, -0.1), (-0.3, 0.2, -0.1)]
    model = empty()
    index = body(
        model, 0, pin.JointModelFreeFlyer(), "body", 10.0, lever=(0.05, 0.02, 0.0), inertia=0.3 * np.eye(3)
    )
    for k, place in enumerate(feet):
        frame(model, f"foot{k}", index, pin.SE3(np.eye(3), np.array(place)))
    q0, v0 = [0, 0, 0.1, 0, 0, 0, 1], [0.4, -0.2, 0, 0, 0, 1.5]
    contacts = [pn.PointContact(f"foot{k}", mu=0.3, torsional=0.01 * (k + 1), name=f"c{k}") for k in range(4)]
    powers = []
    for order in (range(4), (2, 0, 3, 1), (3, 2, 1, 0)):
        run = pn.simulate(
            pn.Scene(model, contacts=[contacts[k] for k in order], q0=q0, v0=v0), 0.02, record="power"
        )
        powers.append([run.power[f"c{k}"][0] for k in range(4)])
    np.testing.assert_allclose(powers[1:], [powers[0]] * 2, rtol=1e-10)
    assert len(set(np.round(powers[0], 9))) == 4


@pytest.mark.parametrize("key", ["torsional", "rolling"])
@pytest.mark.parametrize(
    "make", [lambda **k: pn.PointContact("a", **k), lambda **k: pn.Rolling("a", 0.1, **k)]
)
def test_refused(make, key):
    with refuses(f"{key} must not be negative; got -1", pn.InputError):
        make(**{key: -1.0})


@pytest.mark.parametrize(("method", "order"), [("rk4", 4), ("semi_implicit_euler", 1), ("moreau", 1)])
def test_fixed_steps(method, order):
    """All methods reach the same rest; first-order schemes have an error proportional to the step."""
    scene = again(ball(rolling_along(0.3, 0.6), contact={"mu": 0.8, "rolling": 0.004, "unilateral": False}))
    rest = pn.simulate(scene, 3.0, **TIGHT).q[-1, :2]
    missed = []
    for dt in (1e-3, 2.5e-4):
        run = pn.simulate(scene, 3.0, method=method, dt=dt)
        missed.append(np.linalg.norm(run.q[-1, :2] - rest))
        assert_close(run.v[-1], 0.0, 1e-9)
    assert missed[0] < (1e-9 if order > 1 else 0.01)
    assert order > 1 or missed[1] < missed[0] / 3.5


@pytest.mark.parametrize("tie", ["contact", "anchor"])
def test_loads_of_time_stepping(tie):
    """Velocity-dependent loads act in full: a ball that slides with spin, a rotating stone."""
    if tie == "contact":
        scene = ball([1.0, 0.5, 0.0, 20.0, -5.0, 30.0], contact={"mu": 0.2, "unilateral": False})
    else:
        model = empty((0.0, 0.0, 0.0))
        index = body(
            model, 0, pin.JointModelFreeFlyer(), "stone", 1.0, lever=(0.5, 0, 0), inertia=0.02 * np.eye(3)
        )
        frame(model, "end", index)
        law = pn.JointFriction("string", mu=0.2, radius=0.05)
        scene = pn.Scene(
            model, constraints=[pn.PointAnchor("end", name="string")], laws=[law], v0=[0, 0, 0, 0, 1.0, 6.0]
        )
    exact = pn.simulate(scene, 0.2, record="energy", **TIGHT)
    law = scene.law_names[0]
    missed = [
        abs(
            pn.simulate(scene, 0.2, method="moreau", dt=dt, record="energy").energy[law][-1]
            / exact.energy[law][-1]
            - 1.0
        )
        for dt in (1e-3, 2.5e-4)
    ]
    assert missed[0] < 0.05
    assert missed[1] < max(missed[0] / 3.0, 1e-11)  # the work of the sliding ball is exact to rounding
