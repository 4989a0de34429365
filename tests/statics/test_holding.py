"""Torques that dry friction holds, against scans of the torque by rest, textbooks and slow motions."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.errors import InputError

from ..support.mechanisms import body, empty, frame, point_mass
from ..support.refusals import refuses

G = 9.81
# Bisections end at 1e-9 of the largest torque, the tolerance of `rest`.
SCAN = 2e-8


def pendulum(**friction):
    """A uniform bar on a pin about y, level, 2 kg, center at 0.3 m, with friction in the pin."""
    model = empty()
    body(model, 0, pin.JointModelRY(), "pin", 2.0, lever=(0.3, 0.0, 0.0), inertia=0.01 * np.eye(3))
    return pn.Scene(model, laws=[pn.JointFriction("pin", **friction)])


def arm():
    """Three bars about y whose loaded pins rub, with gravity."""
    model, joint = empty(), 0
    for k in range(3):
        place = pin.SE3(np.eye(3), np.array([0.4 if k else 0.0, 0.0, 0.0]))
        joint = body(
            model, joint, pin.JointModelRY(), f"j{k}", 1.0 + k, place=place, lever=(0.2, 0.0, 0.0),
            inertia=0.01 * np.eye(3),
        )  # fmt: skip
    laws = [
        pn.JointFriction(f"j{k}", coulomb=0.4, mu=0.1, radius=0.03, static_ratio=1.0 + 0.2 * k)
        for k in range(3)
    ]
    return pn.Scene(model, laws=laws, q0=[0.3, -0.5, 0.8])


def holding_arm():
    """Return the arm and torques that nearly balance its weight."""
    scene = arm()
    tau = pn.inverse_dynamics(scene, scene.q0, np.zeros(3), np.zeros(3)).tau
    return scene, tau + np.array([0.2, -0.1, 0.15])


def four_bar():
    """A rough four-bar at rest, driven at its crank."""
    loaded = pn.load("rough_four_bar")
    scene = loaded.replace(actuation=None)
    tau = np.zeros(scene.model.nv)
    tau[0] = pn.inverse_dynamics(scene, scene.q0, np.zeros(3), np.zeros(3), actuated=["crank_pin"]).tau[0]
    return scene, tau


def jack():
    """A screw that lifts a nut by a thread with friction."""
    model = empty()
    for name, kind in (("screw", pin.JointModelRZ()), ("nut", pin.JointModelPZ())):
        body(model, 0, kind, name, 2.0, inertia=0.01 * np.eye(3))
    thread = pn.JointCoupling("nut", "screw", ratio=RADIUS * math.tan(LEAD), name="thread")
    law = pn.JointFriction("thread", mu=MU, lead_angle=LEAD, name="losses")
    return pn.Scene(model, constraints=[thread], laws=[law]), np.zeros(2)


def pressed():
    """A bar whose end rests on the ground: the contact holds downward torques of any size."""
    model = empty()
    body(model, 0, pin.JointModelRY(), "pin", 2.0, lever=(0.3, 0.0, 0.0), inertia=0.01 * np.eye(3))
    frame(model, "end", 1, pin.SE3(np.eye(3), np.array([0.6, 0.0, 0.0])))
    return (
        pn.Scene(
            model,
            laws=[pn.JointFriction("pin", coulomb=0.5)],
            contacts=[pn.PointContact("end", mu=0.3, name="foot")],
        ),
        np.zeros(1),
    )


def sled():
    """A slide on a rail that presses with its load, across a rough contact."""
    model = empty()
    joint = body(model, 0, pin.JointModelPX(), "rail", 3.0)
    joint = body(model, joint, pin.JointModelPZ(), "lift", 1.0)
    frame(model, "sole", joint)
    laws = [pn.JointFriction("rail", coulomb=1.0, mu=0.2), pn.JointFriction("lift", coulomb=0.7)]
    contacts = [pn.PointContact("sole", mu=0.4, name="sole", static_ratio=1.2)]
    return pn.Scene(model, laws=laws, contacts=contacts), np.array([0.5, -4.0])


LEAD, MU, RADIUS = 0.1, 0.15, 0.02
SCENES = {"arm": holding_arm, "four-bar": four_bar, "jack": jack, "pressed": pressed, "sled": sled}


def rests_at(scene, q, tau, dof, x):
    torque = tau.copy()
    torque[dof] = x
    return pn.rest(scene, q, torque).rests


def scanned(rests, inside, side):
    """The torque up to which the scene rests, by bisection to a thousandth, and the width of the bracket."""
    step = 1.0
    while rests(inside + side * step):
        step *= 4.0
        if step > 1e4:
            return side * math.inf, math.inf
    low, high = 0.0, step
    while high - low > 1e-3 * step:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if rests(inside + side * middle) else (low, middle)
    return inside + side * 0.5 * (low + high), high - low


MORE = [pytest.param(name, marks=pytest.mark.slow) for name in ("arm", "jack", "pressed")]


@pytest.mark.parametrize("name", ["four-bar", "sled", *MORE])
def test_bands_end_where_rest_ends(name):
    scene, tau = SCENES[name]()
    result = pn.rest(scene, None, tau)
    assert result.rests
    assert result.reason == ""
    assert result.holding
    q = scene.project(None)[0]
    for joint, held in list(result.holding.items())[:2]:
        dof = int(scene.model.idx_vs[scene.model.getJointId(joint)])
        assert held.band == (held.low, held.high)
        for side, end in ((-1.0, held.low), (1.0, held.high)):

            def rests(x, dof=dof):
                return rests_at(scene, q, tau, dof, x)

            near, width = scanned(rests, tau[dof], side)
            if math.isinf(near):
                assert end == near, (joint, side)
                continue
            assert abs(end - near) <= width, (joint, side, end, near)
            size = abs(end) + np.abs(tau).max() + 1.0
            assert rests(end - side * SCAN * size), (joint, side)
            assert not rests(end + side * SCAN * size), (joint, side)


def test_a_pendulum_by_hand():
    """Weight 2 g at 0.3 m turns about y with 0.6 g; friction holds 1.5 times 0.4 N m around its balance."""
    held = pn.rest(pendulum(coulomb=0.4, static_ratio=1.5)).holding["pin"]
    balance = -2.0 * G * 0.3
    assert held.band == pytest.approx((balance - 0.6, balance + 0.6), rel=1e-9)
    assert (held.lowering, held.raising) == pytest.approx((balance - 0.4, balance + 0.4), rel=1e-9)


def test_a_loaded_pin_by_hand():
    """The pin carries 2 g: a limit of mu radius 2 g."""
    held = pn.rest(pendulum(mu=0.2, radius=0.05)).holding["pin"]
    balance, limit = -2.0 * G * 0.3, 0.2 * 0.05 * 2.0 * G
    for low, high in (held.band, (held.lowering, held.raising)):
        assert (low, high) == pytest.approx((balance - limit, balance + limit), rel=1e-9)


def test_a_screw_jack_as_textbooks_say():
    """Raising W r tan(l + p), lowering W r tan(p - l) the other way: it locks itself, since p > l."""
    scene, tau = jack()
    weight, p = 2.0 * G, math.atan(MU)
    held = pn.rest(scene, None, tau).holding["screw"]
    wanted = (-weight * RADIUS * math.tan(p - LEAD), weight * RADIUS * math.tan(p + LEAD))
    assert held.band == pytest.approx(wanted, rel=1e-8)
    assert (held.lowering, held.raising) == pytest.approx(wanted, rel=1e-8)
    assert held.low < 0.0 < held.high


@pytest.mark.parametrize("name", ["arm", "four-bar", "jack", "pressed"])
def test_slow_motion_has_no_acceleration(name):
    """A slow motion continues under the raising torque; a larger torque accelerates it, a smaller one slows
    it."""
    scene, tau = SCENES[name]()
    q = scene.project(None)[0]
    checked = 0
    for joint, held in pn.rest(scene, q, tau).holding.items():
        dof = int(scene.model.idx_vs[scene.model.getJointId(joint)])
        for sign, x in ((-1.0, held.lowering), (1.0, held.raising)):
            if not math.isfinite(x):
                continue
            wish = np.zeros(scene.model.nv)
            wish[dof] = sign * 1e-7
            v = scene.project(q, {joint: sign * 1e-7})[1] if name == "four-bar" or name == "jack" else wish
            if not scene.model.nv or abs(v[dof]) < 1e-8:
                continue

            def gain(x, v=v, dof=dof):
                torque = tau.copy()
                torque[dof] = x
                return float(scene.acceleration(q, v, torque)[dof])

            try:
                below, at, above = (gain(x + sign * d) for d in (-1e-3, 0.0, 1e-3))
            except pn.InconsistentConstraintsError:
                continue
            assert sign * below < sign * at < sign * above
            assert abs(at) <= 1e-4 * abs(above - below) + 1e-9
            checked += 1
    assert checked


def test_inverse_dynamics_at_rest():
    scene = arm()
    still = np.zeros(3)
    found = pn.inverse_dynamics(scene, scene.q0, still, still)
    rested = pn.rest(scene, scene.q0, found.tau)
    assert list(found.holding) == ["j0", "j1", "j2"]
    for joint, held in found.holding.items():
        other = rested.holding[joint]
        assert held.band == pytest.approx(other.band, rel=1e-9)
        assert held.low < found.tau[int(joint[1])] < held.high
    some = pn.inverse_dynamics(scene, scene.q0, still, still, actuated=["j0", "j2"])
    assert list(some.holding) == ["j0", "j2"]
    assert pn.inverse_dynamics(scene, scene.q0, [0.1, 0.0, 0.0], still).holding == {}
    assert pn.inverse_dynamics(scene, scene.q0, still, [0.1, 0.0, 0.0]).holding == {}


def test_the_torque_is_the_whole_torque_of_the_drive():
    """Under actuation the band is that of the total torque; another actuation gives the same band."""
    scene = pendulum(coulomb=0.4)
    plain = pn.rest(scene).holding["pin"]
    driven = scene.replace(actuation=np.array([-5.7]))
    servo = scene.replace(actuation=pn.HoldPosition(100.0, 1.0, q=[0.06]))
    for made in (driven, servo):
        assert pn.rest(made).holding["pin"].band == pytest.approx(plain.band, rel=1e-9)
    assert pn.rest(driven).rests
    weak = scene.replace(actuation=pn.EffortLimits(np.array([-50.0]), 3.0))
    assert pn.rest(weak).holding["pin"].band == pytest.approx(plain.band, rel=1e-9)


def test_results_travel():
    scene, tau = holding_arm()
    found = pn.rest(scene, None, tau)
    again = pickle.loads(pickle.dumps(found))
    assert again.holding == found.holding
    assert again.reason == found.reason
    needed = pn.inverse_dynamics(scene, scene.q0, np.zeros(3), np.zeros(3))
    assert pickle.loads(pickle.dumps(needed)).holding == needed.holding


def test_joints_that_cannot_hold_alone():
    """The elbow falls, whatever the shoulder does."""
    model, joint = empty(), 0
    for name in ("shoulder", "elbow"):
        joint = body(
            model, joint, pin.JointModelRY(), name, 1.0, lever=(0.3, 0.0, 0.0), inertia=0.01 * np.eye(3)
        )
    scene = pn.Scene(model, laws=[pn.JointFriction("shoulder", coulomb=50.0)])
    found = pn.rest(scene)
    assert (found.rests, found.margin) == (False, -math.inf)
    held = found.holding["shoulder"]
    assert all(math.isnan(x) for x in held.band)
    assert found.reason == (
        'nothing holds the motion of joint "elbow": 2.943 (N or N m) is left on it, and no constraint, '
        "contact or friction acts along this motion"
    )


def test_reasons_name_what_is_at_its_limit():
    scene = pendulum(coulomb=2.0)
    found = pn.rest(scene)
    assert found.margin == pytest.approx(1.0 - 0.6 * G / 2.0, rel=1e-8)
    assert found.reason == (
        f'dry friction needs {0.6 * G / 2.0:.4g} times its limits; at their limits: "JointFriction(pin)"'
    )


def test_reasons_name_contacts_that_would_have_to_pull():
    """A block that is lifted by 3 N more than its weight."""
    model = empty()
    joint = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "block")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    scene = pn.Scene(model, contacts=[pn.PointContact("block", mu=0.5, name="ground")])
    found = pn.rest(scene, None, [0.0, 0.0, G + 3.0])
    assert found.margin == -math.inf
    assert found.reason == 'contacts would have to pull, with up to 3 N: "ground"'
    pushed = pn.rest(scene, None, [1.0, 0.0, G])
    assert pushed.reason == 'friction without a load would have to hold up to 1 (N or N m): "ground"'


def test_a_joint_that_jams():
    """On a rail whose friction grows faster than the push, no push moves the slide."""
    model = empty((0.0, 0.0, 0.0))
    place = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, 0.2), np.zeros(3))
    body(model, 0, pin.JointModelPX(), "rail", 1.0, place=place)
    frame(model, "grip", 1)
    law = pn.UserFriction(lambda t, q: [1.0], lambda t, q, v, r: 0.5, name="rub")
    held = pn.rest(pn.Scene(model, laws=[law])).holding["rail"]
    assert held.band == pytest.approx((-0.5, 0.5), rel=1e-9)
    screw, _ = jack()
    nut = pn.rest(screw).holding["nut"]
    assert (nut.low, nut.high) == (-math.inf, math.inf)  # no load moves a screw that locks itself
    assert nut.raising == math.inf
    assert nut.lowering == -math.inf


def test_scenes_without_friction_have_no_bands():
    assert pn.rest(pn.load("n_four_bar")).holding == {}
    scene = pn.Scene(point_mass(), contacts=[pn.PointContact("mass", mu=0.5)])
    assert pn.rest(scene).rests
    assert pn.rest(scene).holding == {}  # friction of contacts only
    with refuses("rest: scene must be a Scene", InputError):
        pn.rest(None)
