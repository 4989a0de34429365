"""Loops whose rows depend on each other and vanish in passing; statics of loops on turned mounts."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

import pin_nonideal as pn

from ...support.seeds import seeds

DURATION = 3.0
# Global error of the angles [rad] at rtol 1e-8, and of Runge-Kutta's classic method at 2 ms.
ADAPTIVE, FIXED = 3e-5, 1e-4
METHODS = (
    {"method": "dop853", "rtol": 1e-8},
    {"method": "dopri5", "rtol": 1e-8},
    {"method": "rk4", "dt": 2e-3},
)
# Rounding that the linkage magnifies [rad, and part of the largest velocity].
ON_PATH = 1e-10
# Relative error of forces: a closed form against a solution of linear equations.
STATICS = 1e-7


def turned_about_x(length: float, twist: float) -> pin.SE3:
    return pin.SE3(pin.utils.rotate("x", twist), np.array([length, 0.0, 0.0]))


class Bennett:
    """Three revolute joints and a hinge: lengths a, b, a, b and twists with sin(alpha) / a = sin(beta) / b.

    tan(q1 / 2) tan(q2 / 2) = sin((beta + alpha) / 2) / sin((beta - alpha) / 2).
    [Bennett, A new mechanism, 1903.]
    """

    def __init__(self, seed: int) -> None:
        draw = np.random.default_rng(seed)
        while True:
            a, alpha, beta = draw.uniform(0.2, 0.6), draw.uniform(0.3, 1.2), draw.uniform(1.0, 2.6)
            b = a * np.sin(beta) / np.sin(alpha)
            if 0.15 < b < 1.2 and beta - alpha > 0.3:
                break
        self.product = np.sin((beta + alpha) / 2.0) / np.sin((beta - alpha) / 2.0)
        self.model = model = pin.Model()
        model.gravity.linear = 5.0 * draw.standard_normal(3)
        parent, place = 0, pin.SE3.Identity()
        for length, twist in ((a, alpha), (b, beta), (a, alpha)):
            parent = model.addJoint(parent, pin.JointModelRZ(), place, f"joint {parent + 1}")
            spread = draw.standard_normal((3, 3))
            inertia = 0.01 * (spread @ spread.T + 3.0 * np.eye(3))
            lever = 0.2 * draw.standard_normal(3)
            model.appendBodyToJoint(
                parent, pin.Inertia(draw.uniform(0.5, 2.0), lever, inertia), pin.SE3.Identity()
            )
            place = turned_about_x(length, twist)
        model.addFrame(pin.Frame("tip", parent, 0, place, pin.FrameType.OP_FRAME))
        ground = turned_about_x(b, beta).inverse()
        model.addFrame(pin.Frame("ground", 0, 0, ground, pin.FrameType.OP_FRAME))
        self.angle = draw.uniform(0.5, 2.5)
        self.rate = draw.uniform(4.0, 12.0) * draw.choice([-1.0, 1.0])

    def path(self, angle: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q and its first two derivatives by the first angle."""
        k, s, c = self.product, np.sin(angle / 2.0), np.cos(angle / 2.0)
        below = s * s + k * k * c * c
        return (
            np.array([angle, 2.0 * np.arctan2(k * c, s), -angle]),
            np.array([1.0, -k / below, -1.0]),
            np.array([0.0, k * s * c * (1.0 - k * k) / below**2, 0.0]),
        )

    def end(self) -> float:
        """The first angle at the end, by the equation of motion of the one freedom."""
        data = self.model.createData()

        def rate(_: float, y: np.ndarray) -> list[float]:
            q, first, second = self.path(y[0])
            M = pin.crba(self.model, data, q)
            M = np.triu(M) + np.triu(M, 1).T
            bias = pin.nonLinearEffects(self.model, data, q, first * y[1])
            return [y[1], -(first @ (bias + M @ second * y[1] ** 2)) / (first @ M @ first)]

        span, start = (0.0, DURATION), [self.angle, self.rate]
        return float(solve_ivp(rate, span, start, method="DOP853", rtol=1e-12, atol=1e-13).y[0, -1])


@pytest.mark.parametrize("seed", seeds(range(300)))
def test_a_bennett_linkage_turns_through_its_collinear_poses(seed: int) -> None:
    linkage = Bennett(seed)
    q, first, _ = linkage.path(linkage.angle)
    hinge = pn.HingeAnchor("tip", "ground", "z", name="loop")
    scene = pn.Scene(linkage.model, constraints=[hinge], q0=q, v0=first * linkage.rate)
    expected = linkage.path(linkage.end())[0]
    for options in METHODS:
        run = pn.simulate(scene, DURATION, **options)
        missed = np.abs(np.angle(np.exp(1j * (run.q[-1] - expected)))).max()
        assert missed < (FIXED if options["method"] == "rk4" else ADAPTIVE), options["method"]


@pytest.mark.parametrize("seed", seeds(range(100)))
def test_states_between_steps_lie_on_the_path(seed: int) -> None:
    """`run.at` and starts that are off by 1e-4 rad: positions and velocities of the one freedom."""
    linkage, draw = Bennett(seed), np.random.default_rng(seed)
    q, first, _ = linkage.path(linkage.angle)
    hinge = pn.HingeAnchor("tip", "ground", "z", name="loop")
    scene = pn.Scene(linkage.model, constraints=[hinge], q0=q, v0=first * linkage.rate)
    run = pn.simulate(scene, 1.0, record="dense")
    between = run.at(np.sort(draw.uniform(0.0, 1.0, 50)))
    states = list(zip(between.q, between.v, strict=True))
    states.append(scene.project(q + 1e-4 * draw.standard_normal(3), first * linkage.rate))
    for at, velocity in states:
        expected, direction, _ = linkage.path(at[0])
        assert np.abs(np.angle(np.exp(1j * (at - expected)))).max() < ON_PATH
        assert np.abs(velocity - direction * velocity[0]).max() < ON_PATH * np.abs(velocity).max()


class SideRods:
    """Wheels in a row, joined by parallel side rods at several crank angles: all wheels turn alike.

    Each rod passes its dead centers, where its row vanishes and another one holds the wheels.
    """

    def __init__(self, seed: int, apart: float, *, gravity: float = 9.81, balanced: bool = False) -> None:
        draw = np.random.default_rng(seed)
        count, radius, distance = int(draw.integers(2, 4)), draw.uniform(0.1, 0.3), draw.uniform(0.5, 1.2)
        while True:
            cranks = np.sort(draw.uniform(0.0, 2.0 * np.pi, int(draw.integers(2, 4))))
            if np.abs(np.sin(cranks[:, None] - cranks)).max() > apart:
                break
        self.model = model = pin.Model()
        mount = pin.SE3(pin.rpy.rpyToMatrix(*draw.uniform(-3.0, 3.0, 3)), draw.standard_normal(3))
        model.gravity.linear = mount.rotation @ np.array([0.0, -gravity, 0.0])
        self.weight, self.inertia = np.zeros(2), 0.0
        for k in range(count):
            place = mount * pin.SE3(np.eye(3), np.array([k * distance, 0.0, 0.0]))
            joint = model.addJoint(0, pin.JointModelRZ(), place, f"wheel {k}")
            mass, moment = draw.uniform(1.0, 3.0), draw.uniform(0.01, 0.05)
            lever = np.zeros(2) if balanced else 0.05 * draw.standard_normal(2)
            body = pin.Inertia(mass, np.append(lever, 0.0), moment * np.eye(3))
            model.appendBodyToJoint(joint, body, pin.SE3.Identity())
            self.weight += mass * gravity * lever
            self.inertia += moment + mass * lever @ lever
            for i, crank in enumerate(cranks):
                arm = radius * np.array([np.cos(crank), np.sin(crank), 0.0])
                model.addFrame(
                    pin.Frame(f"pin {k} {i}", joint, 0, pin.SE3(np.eye(3), arm), pin.FrameType.OP_FRAME)
                )
        rods = [
            pn.Distance(f"pin {k} {i}", f"pin {k + 1} {i}", distance, name=f"rod {k} {i}")
            for k in range(count - 1)
            for i in range(len(cranks))
        ]
        self.angle, self.rate = draw.uniform(-3.0, 3.0), draw.uniform(8.0, 20.0) * draw.choice([-1.0, 1.0])
        still, moving = np.full(count, self.angle), np.full(count, self.rate)
        self.scene = pn.Scene(model, constraints=rods, q0=still, v0=moving)

    def end(self, duration: float) -> float:
        """The angle at the end, by the equation of motion of one wheel with the inertia of all."""

        def rate(_: float, y: np.ndarray) -> list[float]:
            moment = self.weight[0] * np.cos(y[0]) - self.weight[1] * np.sin(y[0])
            return [y[1], -moment / self.inertia]

        span, start = (0.0, duration), [self.angle, self.rate]
        return float(solve_ivp(rate, span, start, method="DOP853", rtol=1e-12, atol=1e-13).y[0, -1])


@pytest.mark.parametrize("output", [None, 0.01])
@pytest.mark.parametrize("seed", seeds(range(300)))
def test_wheels_on_side_rods_turn_alike_through_dead_centers(seed: int, output: float | None) -> None:
    """Crank angles whose dead centers come as close as 0.05 rad."""
    rods = SideRods(seed, apart=0.05)
    expected = rods.end(DURATION)
    for options in METHODS:
        run = pn.simulate(rods.scene, DURATION, output_dt=output, **options)
        assert np.abs(run.q[-1] - expected).max() < (FIXED if options["method"] == "rk4" else ADAPTIVE), (
            options
        )


@pytest.mark.parametrize("seed", seeds(range(300)))
def test_rows_that_turn_steadily_do_not_contradict_each_other(seed: int) -> None:
    """Without gravity and imbalance only centripetal accelerations act, and cancel in each row."""
    rods = SideRods(seed, apart=0.3, gravity=0.0, balanced=True)
    run = pn.simulate(rods.scene, 20.0, output_dt=0.05)
    expected = rods.angle + rods.rate * 20.0
    assert np.abs(run.q[-1] - expected).max() < 1e-9 * abs(expected)


def four_bar(draw: np.random.Generator) -> tuple[pin.Model, np.ndarray, np.ndarray]:
    """A closed planar four-bar on a mount turned at random: model, q, and the velocity of crank rate 1."""
    while True:
        crank, coupler, rocker, base = draw.uniform(0.2, 1.0, 4)
        angle = draw.uniform(-np.pi, np.pi)
        pin1 = crank * np.array([np.cos(angle), np.sin(angle)])
        across = np.array([base, 0.0]) - pin1
        d = np.hypot(*across)
        if abs(coupler - rocker) + 0.05 < d < coupler + rocker - 0.05:
            break
    along = (coupler**2 - rocker**2 + d * d) / (2.0 * d)
    height = np.sqrt(coupler**2 - along**2) * draw.choice([-1.0, 1.0])
    pin2 = pin1 + (along * across + height * np.array([-across[1], across[0]])) / d
    second = np.arctan2(*(pin2 - pin1)[::-1])
    third = np.arctan2(*(pin2 - np.array([base, 0.0]))[::-1])
    model = pin.Model()
    mount = pin.SE3(pin.rpy.rpyToMatrix(*draw.uniform(-3.0, 3.0, 3)), draw.standard_normal(3))

    def link(parent: int, place: pin.SE3, name: str, length: float) -> int:
        joint = model.addJoint(parent, pin.JointModelRZ(), place, name)
        lever = np.array([length / 2.0, *draw.uniform(-0.1, 0.1, 2)])
        inertia = pin.Inertia(draw.uniform(0.5, 2.0), lever, np.diag(draw.uniform(0.02, 0.03, 3)))
        model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
        end = pin.SE3(np.eye(3), np.array([length, 0.0, 0.0]))
        model.addFrame(pin.Frame(f"end of {name}", joint, 0, end, pin.FrameType.OP_FRAME))
        return int(joint)

    first = link(0, mount, "crank", crank)
    link(first, pin.SE3(np.eye(3), np.array([crank, 0.0, 0.0])), "coupler", coupler)
    link(0, mount * pin.SE3(np.eye(3), np.array([base, 0.0, 0.0])), "rocker", rocker)

    def normal(at: float) -> np.ndarray:
        return np.array([-np.sin(at), np.cos(at)])

    rates = np.linalg.solve(
        np.column_stack([coupler * normal(second), -rocker * normal(third)]), -crank * normal(angle)
    )
    return model, np.array([angle, second - angle, third]), np.array([1.0, rates[0] - 1.0, rates[1]])


CLOSINGS = (
    pn.PointAnchor("end of coupler", "end of rocker", name="loop"),
    pn.PointAnchor("end of rocker", "end of coupler", name="loop"),
    pn.HingeAnchor("end of coupler", "end of rocker", "z", name="loop"),
)


@pytest.mark.parametrize("seed", seeds(range(300)))
def test_statics_of_a_loop_do_not_depend_on_the_mount(seed: int) -> None:
    """Virtual work: the torque of one motor times its rate is the power that lifts the links."""
    draw = np.random.default_rng(seed)
    model, q, rates = four_bar(draw)
    scene = pn.Scene(model, constraints=[CLOSINGS[seed % len(CLOSINGS)]], q0=q)
    weight = pin.computeGeneralizedGravity(model, model.createData(), q)
    motor = int(draw.integers(3))
    still = np.zeros(3)
    found = pn.inverse_dynamics(scene, q, still, still, actuated=[model.names[motor + 1]])
    size = np.abs(weight).max() * max(1.0, 1.0 / abs(rates[motor]))
    assert abs(found.tau[motor] - rates @ weight / rates[motor]) < STATICS * size
    assert (
        np.abs(scene.acceleration(q, still, tau=found.tau)).max()
        < STATICS * size / np.linalg.eigvalsh(pin.crba(model, model.createData(), q)).min()
    )
    resting = pn.equilibrium(scene, q)
    assert np.abs(scene.acceleration(resting.q, still)).max() < 1e-4
    assert not pn.rest(scene, q).rests


@pytest.mark.parametrize("seed", seeds(range(300)))
def test_a_held_velocity_does_not_depend_on_the_mount(seed: int) -> None:
    draw = np.random.default_rng(seed)
    model, q, rates = four_bar(draw)
    scene = pn.Scene(model, constraints=[CLOSINGS[seed % len(CLOSINGS)]], q0=q)
    speed, joint = 5.0 * draw.standard_normal(), int(draw.integers(3))
    _, v = scene.project(q, {model.names[joint + 1]: speed})
    expected = rates * speed / rates[joint]
    assert np.abs(v - expected).max() < 1e-7 * np.abs(rates / rates[joint]).max() * np.abs(expected).max()
