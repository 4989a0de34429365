"""Friction of screws, worms and gears, against free bodies and the closed forms of machine elements."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from oracles.threads import Screw

from ..support.mechanisms import GRAVITY, TIGHT, again, assert_close, body, empty
from ..support.refusals import refuses
from ..support.seeds import seeds

# Accelerations and forces follow from a system of two equations: relative error of rounding.
EXACT = 1e-11
# The ledger's integrals at constant speed, and the closed forms of efficiency.
LEDGER = 1e-9


def screw_and_nut(law, *, J=0.02, m=3.0, ratio=0.01, gravity=(0.0, 0.0, 0.0), more=(), **options):
    """A screw about z and a nut along z, tied by the coupling "thread"; v = (screw, nut)."""
    model = empty(gravity)
    body(model, 0, pin.JointModelRZ(), "screw", 1.0, inertia=J * np.eye(3))
    body(model, 0, pin.JointModelPZ(), "nut", m, inertia=0.01 * np.eye(3))
    thread = pn.JointCoupling("nut", "screw", ratio=ratio, name="thread")
    return pn.Scene(model, constraints=[thread, *more], laws=[law], **options)


def gears(law, *, ratio=-0.5, inertia=(0.3, 0.2), more=(), **options):
    """Wheel 1 driven by wheel 2; v = (wheel 1, wheel 2)."""
    model = empty((0.0, 0.0, 0.0))
    for name, J in zip(("one", "two"), inertia, strict=True):
        body(model, 0, pin.JointModelRY(), name, 1.0, inertia=J * np.eye(3))
    mesh = pn.JointCoupling("one", "two", ratio=ratio, name="mesh")
    return pn.Scene(model, constraints=[mesh, *more], laws=[law], **options)


def draw(seed):
    """Return a thread, loads on nut and screw, and an angular velocity."""
    rng = np.random.default_rng(seed)
    angles = {"lead_angle": rng.uniform(0.03, 0.8), "pressure_angle": rng.uniform(0.0, 0.5)}
    thread = Screw(
        J=rng.uniform(0.005, 0.05),
        m=rng.uniform(0.2, 3.0),
        radius=rng.uniform(0.005, 0.05),
        mu=rng.uniform(0.02, 0.4),
        **angles,
    )
    law = pn.JointFriction("thread", mu=thread.mu, **angles, name="rub")
    force, torque = rng.normal(0.0, 30.0), rng.normal(0.0, 0.5)
    scene = screw_and_nut(law, J=thread.J, m=thread.m, ratio=thread.ratio, actuation=[torque, force])
    return thread, scene, force, torque, rng.choice([-1.0, 1.0]) * rng.uniform(0.1, 5.0)


class TestFreeBodies:
    @pytest.mark.parametrize("seed", seeds(range(60)))
    def test_sliding(self, seed):
        thread, scene, force, torque, rate = draw(seed)
        found = thread.sliding(force, torque, np.sign(rate))
        v = [rate, thread.ratio * rate]
        if len(found) != 1:
            with pytest.raises(pn.FrictionParadoxError):
                scene.solve(scene.q0, v)
            return
        ((a, N),) = found
        s = scene.solve(scene.q0, v)
        along_axis = np.cos(thread.pressure_angle) * np.cos(thread.lead_angle) * N
        np.testing.assert_allclose(s.a, [a, thread.ratio * a], rtol=EXACT)
        np.testing.assert_allclose(s.lam, [along_axis], rtol=EXACT)

    @pytest.mark.parametrize("seed", seeds(range(60)))
    def test_rest(self, seed):
        thread, scene, force, torque, _ = draw(seed)
        s = scene.solve(scene.q0, [0.0, 0.0])
        if thread.holds(force, torque) < 1.0:
            assert_close(s.a, 0.0, 0.0)
            assert list(s.modes) == [0]
            return
        (mode,) = s.modes
        accelerations = [a for a, _ in thread.sliding(force, torque, mode) if a * mode > 0.0]
        assert any(s.a[0] == pytest.approx(a, rel=EXACT) for a in accelerations)


class TestPowerScrew:
    """efficiency = tan(l)/tan(l + p) up and tan(l - p)/tan(l) down, with tan(p) = mu/cos(pressure_angle)."""

    @pytest.mark.parametrize("lead", [0.05, 0.2, 0.6])
    @pytest.mark.parametrize("flank", [0.0, np.radians(14.5)])
    @pytest.mark.parametrize("terms", ["core", "pinocchio"])
    def test_by_the_ledger(self, lead, flank, terms):
        mu, p = 0.12, np.arctan(0.12 / np.cos(flank))
        law = pn.JointFriction("thread", mu=mu, lead_angle=lead, pressure_angle=flank, name="rub")
        for rate in (2.0, -2.0):
            drive = pn.PrescribedMotion("screw", pn.polynomial([0.0, rate]), name="drive")
            scene = screw_and_nut(law, ratio=0.02, gravity=(0, 0, -GRAVITY), more=[drive], terms=terms)
            energy = pn.simulate(scene, 1.0, record="energy", **TIGHT).energy
            raised, spent = (np.ptp(energy["potential"]), energy["constraints"][-1])
            if rate > 0.0:
                assert raised / spent == pytest.approx(np.tan(lead) / np.tan(lead + p), rel=LEDGER)
            else:
                assert -spent / raised == pytest.approx(np.tan(lead - p) / np.tan(lead), rel=LEDGER)
            taken = spent - np.sign(rate) * raised
            assert energy["rub"][-1] == pytest.approx(-taken, rel=LEDGER)

    def test_equals_its_efficiencies(self):
        lead, p = 0.3, np.arctan(0.15)
        thread = pn.JointFriction("thread", mu=0.15, lead_angle=lead)
        stated = pn.JointFriction(
            "thread",
            efficiency=np.tan(lead) / np.tan(lead + p),
            efficiency_back=np.tan(lead - p) / np.tan(lead),
        )
        np.testing.assert_allclose(stated.tooth_losses, thread.tooth_losses, rtol=1e-13)
        for v in ([1.5, 0.015], [-1.5, -0.015]):
            a, b = (
                screw_and_nut(law, actuation=[0.3, -40.0]).acceleration([0.0, 0.0], v)
                for law in (thread, stated)
            )
            np.testing.assert_allclose(a, b, rtol=1e-12)


class TestWorm:
    """A worm with lead angle 0.08 and mu 0.2 is self-locking: loads on the wheel cannot move it."""

    MU, LEAD, RATIO, LOAD = 0.2, 0.08, 1.0 / 40.0, 20.0

    def scene(self, motor, **options):
        law = pn.JointFriction("mesh", mu=self.MU, lead_angle=self.LEAD, name="rub")
        return gears(
            law,
            ratio=self.RATIO,
            inertia=(0.1, 0.01),
            actuation=lambda t, q, v: [-self.LOAD, motor(t)],
            **options,
        )

    def test_holds_without_motor(self):
        run = pn.simulate(self.scene(lambda t: 0.0), 100.0)
        assert_close(run.v, 0.0, 0.0)
        assert not run.events

    def test_needs_torque_to_lower(self):
        """The load moves down when the motor pushes with -back ratio load, not earlier."""
        back = np.tan(self.LEAD - np.arctan(self.MU)) / np.tan(self.LEAD)
        least = -back * self.RATIO * self.LOAD
        assert least > 0.0
        run = pn.simulate(self.scene(lambda t: -0.2 * t), least / 0.2 + 1.0, **TIGHT)
        (event,) = run.events
        assert (event.kind, event.element) == ("slip", "rub")
        assert event.time == pytest.approx(least / 0.2, rel=1e-9)
        assert run.v[-1, 1] < 0.0

    def test_needs_torque_to_raise(self):
        forth = np.tan(self.LEAD) / np.tan(self.LEAD + np.arctan(self.MU))
        least = self.RATIO * self.LOAD / forth
        run = pn.simulate(self.scene(lambda t: 0.5 * t), least / 0.5 + 1.0, **TIGHT)
        (event,) = run.events
        assert event.time == pytest.approx(least / 0.5, rel=1e-9)
        assert run.v[-1, 1] > 0.0

    def test_stops_when_the_motor_stops(self):
        """Load and friction slow the turning screw at a constant rate until it sticks."""
        thread = Screw(0.01, 0.1, self.RATIO / np.tan(self.LEAD), self.LEAD, 0.0, self.MU)
        for rate in (30.0, -30.0):
            ((a, _),) = thread.sliding(-self.LOAD, 0.0, np.sign(rate))
            assert a * rate < 0.0
            run = pn.simulate(self.scene(lambda t: 0.0), 1.0, v=[self.RATIO * rate, rate], **TIGHT)
            (event,) = run.events
            assert (event.kind, event.element) == ("stick", "rub")
            assert event.time == pytest.approx(-rate / a, rel=1e-9)
            assert_close(run.v[-1], 0.0, 0.0)


class TestGearMesh:
    """Torques on the teeth: t1 v1 = -efficiency t2 v2 when wheel 2 drives, t2 v2 = -back t1 v1 else."""

    @pytest.mark.parametrize(
        ("forth", "back"), [(0.97, None), (0.9, 0.8), (0.6, 0.1), (0.45, -0.2), (0.3, -3.0)]
    )
    @pytest.mark.parametrize("ratio", [-0.5, 2.0])
    @pytest.mark.parametrize("rate", [4.0, -4.0])
    @pytest.mark.parametrize("seed", range(4))
    def test_torques(self, forth, back, ratio, rate, seed):
        given = np.random.default_rng(seed).normal(0.0, 3.0, 2)
        law = pn.JointFriction("mesh", efficiency=forth, efficiency_back=back)
        scene = gears(law, ratio=ratio, inertia=(0.3, 20.0), actuation=given)
        v = np.array([ratio * rate, rate])
        t1, t2 = scene.model.inertias[1].inertia[1, 1], scene.model.inertias[2].inertia[1, 1]
        on_teeth = np.array([t1, t2]) * scene.acceleration([0.0, 0.0], v) - given
        out, into = on_teeth * v
        if out > 0.0:
            assert out == pytest.approx(-forth * into, rel=1e-9)
        else:
            assert into == pytest.approx(-(forth if back is None else back) * out, rel=1e-9)

    def test_constant_and_viscous_parts_are_those_of_the_leading_joint(self):
        law = pn.JointFriction("mesh", coulomb=0.4, preload=0.1, viscous=0.05)
        scene = gears(law, inertia=(0.3, 0.2), actuation=[0.0, 2.0])
        a = scene.acceleration([0.0, 0.0], [-1.5, 3.0])
        assert a[1] == pytest.approx((2.0 - 0.5 - 0.05 * 3.0) / (0.2 + 0.25 * 0.3), rel=EXACT)

    def test_stribeck(self):
        law = pn.JointFriction("mesh", coulomb=0.4, static_ratio=1.5, stribeck_velocity=2.0)
        a = gears(law, inertia=(0.3, 0.2)).acceleration([0.0, 0.0], [-1.5, 3.0])
        assert a[1] == pytest.approx(-0.4 * (1.0 + 0.5 * np.exp(-2.25)) / (0.2 + 0.25 * 0.3), rel=EXACT)

    def test_a_reversal_inside_a_run(self):
        """Wheel 2 swings wheel 1; the work of the losses is found again in the ledger."""
        drive = pn.PrescribedMotion("two", pn.sinusoid(0.8, 5.0), name="drive")
        law = pn.JointFriction("mesh", efficiency=0.8, name="rub")
        run = pn.simulate(gears(law, more=[drive]), 3.0, record=("energy", "power"), **TIGHT)
        assert np.abs(run.energy["balance"]).max() < 1e-10
        assert run.power["rub"].max() <= 1e-12
        reversals = [e.time for e in run.events if e.element == "rub"]
        turns = np.pi / 10.0 + np.arange(len(reversals)) * np.pi / 5.0
        assert len(reversals) == 5
        assert_close(reversals, turns, 1e-9)


def test_the_order_of_a_list_decides_nothing():
    """Two equal couplings of the same wheels share the force of their teeth, and so their losses."""
    model = empty((0.0, 0.0, 0.0))
    for name in ("one", "two"):
        body(model, 0, pin.JointModelRY(), name, 1.0, inertia=0.2 * np.eye(3))
    meshes = [pn.JointCoupling("one", "two", ratio=0.5, name=n) for n in ("left", "right")]
    laws = [pn.JointFriction(n, efficiency=0.8, name=f"rub {n}") for n in ("left", "right")]
    results = []
    for order in ((0, 1), (1, 0)):
        scene = pn.Scene(
            model,
            constraints=[meshes[k] for k in order],
            laws=[laws[k] for k in order],
            actuation=[-3.0, 2.0],
        )
        results.append(scene.acceleration([0.0, 0.0], [1.0, 2.0]))
    np.testing.assert_allclose(results[0], results[1], rtol=1e-12)


def test_forces_balance_where_joint_and_teeth_stick():
    """Joint friction equals the load minus the force of the teeth, which are redundant with it."""
    laws = [pn.JointFriction("one", coulomb=5.0), pn.JointFriction("mesh", efficiency=0.7, coulomb=0.2)]
    torque = np.array([1.5, -0.8])
    scene = again(gears(laws[0], actuation=torque), laws=laws)
    s = scene.solve([0.0, 0.0], [0.0, 0.0], modes=[0, 0])
    assert_close(s.a, 0.0, 1e-15)
    assert_close(s.F_ideal + s.F_nonideal, -torque, 1e-14)


REFUSED = [
    ({"mu": 0.1}, "mu needs the lead_angle of the thread on a JointCoupling"),
    (
        {"efficiency": 0.9, "radius": 0.1},
        'radius is a parameter of a bearing, and "mesh" is a JointCoupling; leave it out',
    ),
    (
        {"efficiency": 0.9, "span": 0.1},
        'span is a parameter of a bearing, and "mesh" is a JointCoupling; leave it out',
    ),
]


@pytest.mark.parametrize(("arguments", "message"), REFUSED)
def test_refused_on_a_coupling(arguments, message):
    with refuses(message, pn.InputError):
        gears(pn.JointFriction("mesh", **arguments))


BAD = [
    ({"efficiency": 0.0}, "efficiency must lie between 0 and 1; got 0"),
    ({"efficiency": 1.0}, "efficiency must lie between 0 and 1; got 1"),
    ({"efficiency": 0.9, "efficiency_back": 1.0}, "efficiency_back must be below 1; got 1"),
    ({"efficiency_back": 0.5}, "efficiency_back needs efficiency too"),
    ({"efficiency": 0.9, "mu": 0.1}, "give either efficiency, or mu and lead_angle"),
    ({"lead_angle": 0.1}, "lead_angle needs a positive mu"),
    ({"mu": 0.1, "lead_angle": 0.0}, "lead_angle must be positive; got 0"),
    ({"mu": 0.1, "lead_angle": 1.6}, "lead_angle must be below pi/2 rad; got 1.6"),
    ({"mu": 0.1, "lead_angle": 0.1, "pressure_angle": 2.0}, "pressure_angle must be below pi/2 rad; got 2"),
    ({"mu": 0.1, "pressure_angle": 0.3}, "pressure_angle describes a thread; give its lead_angle too"),
]


@pytest.mark.parametrize(("arguments", "message"), BAD)
def test_refused_everywhere(arguments, message):
    with refuses(message, pn.InputError):
        pn.JointFriction("mesh", **arguments)


def test_teeth_are_no_part_of_a_joint():
    with refuses(
        'efficiency is a parameter of a JointCoupling, and joint "one" is JointModelRY; leave it out',
        pn.InputError,
    ):
        gears(pn.JointFriction("one", efficiency=0.9))
