"""Contacts that slide in two directions until rest or rolling, against closed forms."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ...support.mechanisms import GRAVITY, TIGHT, assert_close, at_events, body, empty, point_mass

# Tolerance of times and states of events.
EVENT = 1e-9


def kinds(run):
    return [event.kind for event in run.events]


def times(run):
    return [event.time for event in run.events]


class TestBallThatSlidesThenRolls:
    """For I = c m r^2 the slip ends at t1 = v0 c/((1 + c) mu g) with v1 = v0/(1 + c), its direction kept."""

    @staticmethod
    def ball(c, mass, radius, mu, slides):
        """Return a ball on three slides and a ball joint, or as a free body with velocities in body axes."""
        model = point_mass(mass=0.0) if slides else empty()
        joint = pin.JointModelSpherical() if slides else pin.JointModelFreeFlyer()
        inertia = c * mass * radius**2 * np.eye(3)
        body(model, 3 if slides else 0, joint, "ball", mass, inertia=inertia)
        rub = pn.PointContact("ball", mu=mu, radius=radius)
        return pn.Scene(model, contacts=[rub], q0=[0.0, 0.0, radius, 0.0, 0.0, 0.0, 1.0])

    @staticmethod
    def velocity(run, k):
        """Return velocity of the center and angular velocity, in world axes."""
        model, data = run.scene.model, run.scene.model.createData()
        pin.forwardKinematics(model, data, run.q[k], run.v[k])
        return pin.getFrameVelocity(model, data, model.getFrameId("ball"), pin.LOCAL_WORLD_ALIGNED)

    @pytest.mark.parametrize("slides", [True, False])
    @pytest.mark.parametrize("c", [0.4, 1.0, 0.5])
    def test_straight(self, c, slides):
        mu, radius, speed, end = 0.3, 0.1, 2.0, 0.8
        t1, v1 = speed * c / ((1.0 + c) * mu * GRAVITY), speed / (1.0 + c)
        x1 = speed * t1 - 0.5 * mu * GRAVITY * t1**2
        scene = self.ball(c, 1.0, radius, mu, slides)
        run = pn.simulate(scene, end, v=[speed, 0.0, 0.0, 0.0, 0.0, 0.0], **TIGHT)
        assert kinds(run) == ["stick"]
        assert_close(times(run), t1, EVENT)
        here = at_events(run)[0]
        assert_close(run.q[[here, -1], 0], [x1, x1 + v1 * (end - t1)], EVENT)
        for k in (here, -1):
            assert_close(self.velocity(run, k).linear, [v1, 0.0, 0.0], 1e-10)
            assert_close(self.velocity(run, k).angular, [0.0, v1 / radius, 0.0], 1e-9)

    @pytest.mark.parametrize("rtol", [1e-12, 1e-11, 1e-10])
    @pytest.mark.parametrize("slides", [True, False])
    def test_billiard_with_side_spin(self, slides, rtol):
        """u0 = v0 + w0 x (-r z), t_f = 2 |u0|/(7 mu g), v_f = v0 - (2/7) u0; a parabola until t_f."""
        scene = self.ball(0.4, 0.17, 0.0285, 0.2, slides)
        start = [2.0, 0.0, 0.0, -30.0, 10.0, 0.0]
        run = pn.simulate(scene, 0.5, v=start, rtol=rtol, atol=0.1 * rtol)
        assert kinds(run) == ["stick"]
        assert_close(times(run), 0.27906095257132574, EVENT)
        here = at_events(run)[0]
        assert_close(run.q[here, :2], (0.4897519717626767, 0.03408530206406907), EVENT)
        for k in (here, -1):
            assert_close(self.velocity(run, k).linear, (1.51, 0.24428571428571427, 0.0), EVENT)


@pytest.mark.parametrize("across", [0.0, 0.7, -1.3])
@pytest.mark.parametrize("options", [{}, TIGHT, {"method": "rk4", "dt": 0.01}, {"method": "rk4", "dt": 0.1}])
def test_puck_comes_to_rest(across, options):
    """Constant deceleration mu g against the velocity in any direction: all methods are exact."""
    start = np.array([2.0, across, 0.0])
    speed = np.linalg.norm(start)
    scene = pn.Scene(point_mass(), contacts=[pn.PointContact("mass", mu=0.2)])
    run = pn.simulate(scene, 2.0, v=start, **options)
    assert kinds(run) == ["stick"]
    assert_close(times(run), speed / (0.2 * GRAVITY), EVENT)
    assert_close(run.q[-1], 0.5 * speed / (0.2 * GRAVITY) * start, EVENT)


# A lateral force m c below mu m g rotates the slip; mu g |v| + c v_y decreases to zero at (mu g)^2 - c^2.
CURVE_TIME = 0.2 * GRAVITY * 2.0 / ((0.2 * GRAVITY) ** 2 - 1.0)


@pytest.mark.parametrize("rtol", [1e-13, 1e-12, 1e-11, 1e-10])
def test_puck_that_is_pulled_aside(rtol):
    model = point_mass(gravity=(0.0, 1.0, -GRAVITY))
    scene = pn.Scene(model, contacts=[pn.PointContact("mass", mu=0.2)], v0=[2.0, 0.0, 0.0])
    run = pn.simulate(scene, 3.0, rtol=rtol, atol=0.1 * rtol)
    assert kinds(run) == ["stick"]
    assert_close(times(run), CURVE_TIME, EVENT)


CURVING = """
import numpy as np
import pinocchio as pin
import pin_nonideal as pn

model = pin.Model()
model.gravity = pin.Motion(np.array([0.0, 1.0, -9.81]), np.zeros(3))
joint = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "slides")
model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
model.addJointFrame(joint)
scene = pn.Scene(model, contacts=[pn.PointContact("slides", mu=0.2)], v0=[2.0, 0.0, 0.0])
run = pn.simulate(scene, 3.0, method="rk4", dt=%r)
print(*[f"{event.kind} {event.time:.6f}" for event in run.events])
"""


@pytest.mark.parametrize("dt", [0.01, 0.001])
def test_fixed_steps_find_the_rest_of_a_curving_slide(dt):
    """Run in a separate process with a time limit: repeated events at one instant must not hang."""
    command = [sys.executable, "-c", CURVING % dt]
    done = subprocess.run(command, capture_output=True, text=True, timeout=20, check=True)
    kind, time = done.stdout.split()
    assert kind == "stick"
    # The slip direction rotates fast at the end, which reduces the order of rk4.
    assert abs(float(time) - CURVE_TIME) < 0.1 * dt


LIFTS = [
    ("dop853", {}, EVENT),
    ("dopri5", {}, EVENT),
    ("rk4", {"dt": 0.01}, EVENT),
    ("moreau", {"dt": 0.01}, 0.01),
]


@pytest.mark.parametrize("mu", [0.0, 0.1])
@pytest.mark.parametrize(("method", "options", "late"), LIFTS)
def test_a_pull_is_reported_when_it_begins(method, options, late, mu):
    """A lift of 30 N/s balances the weight of 1 kg at g / 30."""
    scene = pn.Scene(
        point_mass(),
        contacts=[pn.PointContact("mass", mu=mu, unilateral=False)],
        actuation=lambda t, q, v: [0.0, 0.0, 30.0 * t],
    )
    run = pn.simulate(scene, 1.0, method=method, **options)
    assert "pull" in kinds(run)
    began = next(event.time for event in run.events if event.kind == "pull")
    assert -EVENT < began - GRAVITY / 30.0 < late


def test_time_stepping_keeps_the_books_of_a_slip_that_turns():
    """A lateral force rotates the slip by more than a half circle; friction only dissipates."""
    scene = pn.Scene(
        point_mass(),
        contacts=[pn.PointContact("mass", mu=0.05, unilateral=False, name="rub")],
        actuation=lambda t, q, v: [-3.0 * v[1], 3.0 * v[0], 0.0],
    )
    options = {"v": [2.0, 0.0, 0.0], "record": "energy"}
    fine = pn.simulate(scene, 1.5, rtol=1e-10, **options)
    run = pn.simulate(scene, 1.5, method="moreau", dt=1e-3, **options)
    assert run.energy["rub"][-1] == pytest.approx(fine.energy["rub"][-1], rel=1e-2)  # first order
    assert (np.diff(run.energy["rub"]) <= 0.0).all()
    assert (
        np.abs(run.energy["balance"]).max() < 1e-8
    )  # balance of 2 J; the error of a 1 ms step has third order


def table(places, height=0.0, **keywords):
    """Return a body of 1 kg on contacts, with its center at a height above them."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "table")
    inertia = pin.Inertia(1.0, np.array([0.0, 0.0, height]), np.diag([0.1, 0.1, 0.15]))
    model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    for i, (x, y) in enumerate(places):
        place = pin.SE3(np.eye(3), np.array([x, y, 0.0]))
        model.addFrame(pin.Frame(f"leg{i}", joint, place, pin.FrameType.OP_FRAME))
    ratio = keywords.pop("static_ratio", 1.0)
    contacts = [pn.PointContact(f"leg{i}", mu=0.3, static_ratio=ratio) for i in range(len(places))]
    return pn.Scene(model, contacts=contacts, **keywords)


@pytest.mark.parametrize("dt", [0.02, 0.003])
def test_friction_in_time_stepping_only_takes_energy(dt):
    """A mass on a spring with friction reverses inside steps, with mean velocity along the friction."""
    model = empty()
    body(model, 0, pin.JointModelPX(), "slide", 1.0)
    rub = pn.JointFriction("slide", coulomb=0.3, name="rub")
    scene = pn.Scene(model, laws=[rub], forces=[pn.JointSpring("slide", stiffness=40.0)], q0=[0.5])
    run = pn.simulate(scene, 5.0, method="moreau", dt=dt, record="energy")
    assert kinds(run).count("reverse") > 3
    assert (np.diff(run.energy["rub"]) <= 0.0).all()
    assert np.abs(run.energy["balance"]).max() < 1e-12  # of 5 J


@pytest.mark.parametrize("legs", [3, 4])
@pytest.mark.parametrize("speed", [0.0, 1.0])
def test_a_table_on_more_contacts_than_it_needs(legs, speed):
    """Nine or twelve rows on six degrees of freedom: the table sticks, or slides as a point would."""
    corners = [(0.3, 0.3), (-0.3, 0.3), (-0.3, -0.3), (0.3, -0.3)][:legs]
    scene = table(corners, v0=[speed, 0.0, 0.0, 0.0, 0.0, 0.0])  # centered on the ground: no tilting moment
    run = pn.simulate(scene, 0.2, rtol=1e-10)
    way = speed * 0.2 - (0.3 * GRAVITY * 0.2**2 / 2.0 if speed else 0.0)
    assert run.q[-1, 0] == pytest.approx(way, abs=1e-9)


TRIPOD = [(0.3, 0.0), (-0.15, 0.26), (-0.15, -0.26)]


@pytest.mark.parametrize("ratio", [1.0, 1.3])
@pytest.mark.parametrize("options", [{}, {"rtol": 1e-10}, {"method": "rk4", "dt": 0.01}])
def test_three_legs_break_away_together(options, ratio):
    """Under a growing force along x the friction of the legs is not unique, and all legs slip at once.

    The legs' loads differ and change with the tilting moment, but the total limit is mu m g.
    """
    scene = table(TRIPOD, 0.1, static_ratio=ratio, actuation=lambda t, q, v: [t, 0.0, 0.0, 0.0, 0.0, 0.0])
    limit = 0.3 * ratio * GRAVITY
    run = pn.simulate(scene, limit + 0.01, **options)
    assert kinds(run) == ["slip"] * 3
    assert_close(times(run), limit, 1e-10)
    assert (run.v[run.t < limit - 1e-9] == 0.0).all()


def test_a_body_that_rocks_on_two_contacts():
    """The body slides, sticks and slips again about the line through both contacts, without chatter."""
    scene = table(TRIPOD[:2], 0.1, v0=[1.0, 0.5, 0.0, 0.0, 0.0, 2.0])
    run = pn.simulate(scene, 3.0, record="energy")
    assert set(kinds(run)) >= {"stick", "slip"}
    assert "chatter" not in kinds(run)
    for leg in (0, 1):
        lost = run.energy[f"PointContact(leg{leg})"]
        assert (np.diff(lost) <= 1e-11 * -lost[-1]).all()
    assert np.abs(run.energy["balance"]).max() < 1e-8


@pytest.mark.parametrize("options", [{}, {"method": "moreau", "dt": 1e-2}])
@pytest.mark.parametrize("mu", [0.0, 0.5])
def test_a_contact_that_nothing_presses(mu, options):
    """The point always moves in the plane: the contact has no row, load, friction or tension."""
    model = point_mass("XZ")
    wall = pn.PointContact("mass", mu=mu, normal="y", unilateral=False, name="wall")
    scene = pn.Scene(model, contacts=[wall], v0=[1.0, 2.0])
    assert scene.dropped == [("wall", 0, "vanishes")]
    run = pn.simulate(scene, 0.5, record="forces", **options)
    assert run.events == []
    np.testing.assert_array_equal(run.lam, 0.0)
    assert_close(run.q[-1], [0.5, 1.0 - 0.5 * GRAVITY * 0.25], 0.05 if options else 1e-12)
    assert_close(run.v[-1], [1.0, 2.0 - GRAVITY * 0.5], 1e-12)
