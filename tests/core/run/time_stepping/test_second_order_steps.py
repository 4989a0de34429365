"""Time stepping is of second order between events, and keeps the invariants of the motion."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

STEPS = (1e-3, 5e-4, 2.5e-4)


def spinning_body(inertia: tuple[float, float, float], com: np.ndarray, gravity: bool = False) -> pin.Model:
    model = pin.Model()
    if not gravity:
        model.gravity.setZero()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "body")
    turned = pin.utils.rotate("x", 0.7) @ pin.utils.rotate("z", -0.4)
    model.appendBodyToJoint(
        joint, pin.Inertia(1.3, com, turned @ np.diag(inertia) @ turned.T), pin.SE3.Identity()
    )
    return model


def errors(scene: pn.Scene, seconds: float) -> np.ndarray:
    exact = pn.simulate(scene, seconds, rtol=1e-12, atol=1e-13)
    out = []
    for dt in STEPS:
        run = pn.simulate(scene, seconds, method="moreau", dt=dt)
        out.append(max(np.abs(run.q[-1] - exact.q[-1]).max(), np.abs(run.v[-1] - exact.v[-1]).max()))
    return np.array(out)


def without_laws(name: str) -> pn.Scene:
    scene = pn.load(name)
    return pn.Scene(scene.model, constraints=scene.constraints, q0=scene.q0, v0=scene.v0)


def sprung_arm() -> pn.Scene:
    scene = pn.load("panda")
    return pn.Scene(
        scene.model, forces=[pn.JointSpring("panda_joint4", 40.0, rest=-1.0, damping=0.5)], q0=scene.q0
    )


@pytest.mark.parametrize(
    "make",
    [
        lambda: without_laws("panda"),
        lambda: without_laws("four_bar"),
        lambda: without_laws("double_pendulum"),
        lambda: pn.load("solo12_standing"),
        sprung_arm,
    ],
    ids=["panda", "four_bar", "double_pendulum", "held feet", "spring"],
)
def test_order(make: Callable[[], pn.Scene]) -> None:
    error = errors(make(), 0.4)
    slope = np.log2(error[0] / error[-1]) / np.log2(STEPS[0] / STEPS[-1])
    assert slope > 1.9


def arm_without_hand() -> pn.Scene:
    """Seven joints without friction; the fingers, which would slide out of the hand, are locked."""
    scene = pn.load("panda")
    fingers = [k for k, name in enumerate(scene.model.names) if "finger" in name]
    model = pin.buildReducedModel(scene.model, fingers, scene.q0)
    return pn.Scene(model, q0=scene.q0[: model.nq])


@pytest.mark.parametrize("seconds", [4.0, pytest.param(60.0, marks=pytest.mark.slow)])
def test_an_undriven_arm_keeps_its_energy(seconds: float) -> None:
    run = pn.simulate(arm_without_hand(), seconds, method="moreau", dt=1e-3, output_dt=0.05, record="energy")
    assert np.ptp(run.energy["kinetic"] + run.energy["potential"]) < 1.0  # of 85 J


@pytest.mark.parametrize("steps", [2000, pytest.param(100_000, marks=pytest.mark.slow)])
@pytest.mark.parametrize("speed", [3.0, 60.0])
def test_a_free_body_keeps_energy_and_momentum(steps: int, speed: float) -> None:
    com = np.array([0.1, -0.2, 0.05])
    model = spinning_body((0.02, 0.05, 0.06), com)
    v0 = np.array([0.3, -0.5, 0.2, 0.02 * speed, speed, 0.3 * speed])
    run = pn.simulate(pn.Scene(model, v0=v0), steps * 1e-3, method="moreau", dt=1e-3, output_dt=steps * 1e-4)
    data = model.createData()
    values = []
    for q, v in zip(run.q, run.v, strict=True):
        energy = pin.computeKineticEnergy(model, data, q, v)
        momentum = pin.computeCentroidalMomentum(model, data, q, v)
        values.append([energy, *momentum.linear, *momentum.angular])
    values_ = np.array(values)
    scale = np.array(
        [values_[0, 0], *[np.linalg.norm(values_[0, 1:4])] * 3, *[np.linalg.norm(values_[0, 4:])] * 3]
    )
    assert (np.abs(values_ - values_[0]) / scale).max() < 1e-12


def test_a_thrown_body_follows_its_parabola() -> None:
    com = np.array([0.1, -0.2, 0.05])
    model = spinning_body((0.02, 0.05, 0.06), com, gravity=True)
    v0 = np.array([1.0, 0.5, 4.0, 2.0, -3.0, 7.0])
    run = pn.simulate(pn.Scene(model, v0=v0), 0.6, method="moreau", dt=1e-3, output_dt=0.6)
    data = model.createData()
    start = pin.centerOfMass(model, data, run.q[0], run.v[0]).copy()
    speed = data.vcom[0].copy()
    end = pin.centerOfMass(model, data, run.q[-1], run.v[-1])
    expected = start + 0.6 * speed + 0.5 * 0.36 * model.gravity.linear
    assert np.abs(end - expected).max() < 1e-12


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_stiff_control_holds_its_target(friction: float) -> None:
    """Gains a thousand times beyond the limit of an explicit step; the rest position is that of statics."""
    scene = pn.load("panda")
    nv = scene.model.nv
    inertia = np.diag(pin.crba(scene.model, scene.model.createData(), scene.q0))
    kp, kd = 4e3 * inertia / 1e-6, 2e3 * inertia / 1e-3
    target = scene.q0 + 0.05
    laws = (
        [pn.JointFriction(name, coulomb=friction) for name in list(scene.model.names)[1:]] if friction else []
    )
    held = pn.Scene(scene.model, laws=laws, actuation=pn.HoldPosition(kp, kd, q=target), q0=scene.q0)
    run = pn.simulate(held, 1.0, method="moreau", dt=1e-3)
    assert np.abs(run.v).max() < 60.0
    load = pin.rnea(scene.model, scene.model.createData(), run.q[-1], np.zeros(nv), np.zeros(nv))
    rest = target - load / kp
    assert np.abs(run.q[-1] - rest).max() < 1e-9 + friction / kp.min()
    assert np.abs(run.v[-1]).max() < 1e-9


def test_critical_spring_decays_without_ringing() -> None:
    """k/m = 1e8 with critical damping, steps of 1 ms: ten time constants a step."""
    model = pin.Model()
    model.gravity.setZero()
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slide")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(2.0, 0.1), pin.SE3.Identity())
    spring = pn.JointSpring("slide", 2e8, damping=4e4)
    run = pn.simulate(pn.Scene(model, forces=[spring], q0=np.array([0.01])), 0.02, method="moreau", dt=1e-3)
    assert np.abs(run.q[3:, 0]).max() < 2e-4
    assert abs(run.q[-1, 0]) < 1e-9


def test_a_spring_keeps_its_amplitude() -> None:
    model = pin.Model()
    model.gravity.setZero()
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slide")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(2.0, 0.1), pin.SE3.Identity())
    spring = pn.JointSpring("slide", 2e4)
    run = pn.simulate(pn.Scene(model, forces=[spring], q0=np.array([0.01])), 5.0, method="moreau", dt=1e-3)
    energy = 1e4 * run.q[:, 0] ** 2 + run.v[:, 0] ** 2
    assert np.abs(energy - energy[0]).max() < 1e-10 * energy[0]


def test_the_ledger_tells_what_the_scheme_adds() -> None:
    scene = pn.load("panda")
    held = pn.Scene(
        scene.model, actuation=pn.HoldPosition(200.0, 20.0), q0=scene.q0, v0=np.full(scene.model.nv, 0.5)
    )
    run = pn.simulate(held, 0.5, method="moreau", dt=1e-3, record="energy")
    assert np.abs(run.energy["balance"]).max() < 1e-4


def test_an_idle_row_leaves_the_ledger_as_it_is() -> None:
    """A zero row in Python makes the rows redundant; the energy of the projection remains the same."""
    scene = pn.load("slider_crank")
    nv = scene.model.nv
    idle = pn.UserConstraint(
        lambda t, q, v, data: (np.zeros((1, nv)), np.zeros(1)),
        1,
        residual=lambda t, q: np.zeros(1),
        rate=lambda t, q, v: np.zeros(1),
        name="idle",
    )
    ledgers = [
        pn.simulate(s, 0.1, method="moreau", dt=1e-3, record="energy").energy["projection"]
        for s in (scene, scene.replace(constraints=[*scene.constraints, idle]))
    ]
    np.testing.assert_allclose(ledgers[1], ledgers[0], rtol=0, atol=1e-6 * np.abs(ledgers[0]).max())


def test_a_ball_rolls_down_at_the_exact_speed() -> None:
    radius, mass, slope, mu = 0.1, 1.0, 0.3, 0.6
    model = pin.Model()
    model.gravity.linear = 9.81 * np.array([np.sin(slope), 0.0, -np.cos(slope)])
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(mass, radius), pin.SE3.Identity())
    model.addFrame(pin.Frame("center", joint, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    floor = pn.PointContact("center", radius=radius, mu=mu)
    q0 = np.array([0.0, 0.0, radius, 0.0, 0.0, 0.0, 1.0])
    run = pn.simulate(pn.Scene(model, contacts=[floor], q0=q0), 1.0, method="moreau", dt=1e-3, output_dt=1.0)
    speed = 5.0 / 7.0 * 9.81 * np.sin(slope)
    world = pin.Quaternion(run.q[-1, 3:]).matrix() @ run.v[-1, :3]
    assert abs(world[0] - speed) < 1e-6 * speed
