"""Loops of hinges whose rows depend on each other, beside the motion of their one freedom by screws."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from oracles import hinge_loops
from oracles.hinge_loops import APART, FAMILIES, HingeLoop

from ..support.seeds import seeds

DURATION, SPEED = 1.5, 5.0
RTOL = 1e-9
# Global error of the angles by the largest one or 1 rad, and that of SciPy's methods at a wider rtol.
NEAR, SCIPY_NEAR = 1e3 * RTOL, 1e-4
# Error of a fixed step that rounding and the oracle may leave; least ratio of errors when the step is halved.
FLOOR, RATIOS = 1e-8, {"rk4": 8.0, "semi_implicit_euler": 1.6, "moreau": 2.5}
# Steps with larger errors are too long for the order of a method: their errors do not yet add up.
COARSE = 0.04
# Families of driven loops: every fourth one, the others with -m slow.
DRIVEN = [pytest.param(each, marks=[pytest.mark.slow] * (k % 4 > 0)) for k, each in enumerate(FAMILIES)]
# Goldberg linkages take the most steps.
FREE = [pytest.param(each, marks=[pytest.mark.slow] * (each is hinge_loops.goldberg)) for each in FAMILIES]
# Factors of rows in Python: the first family takes them by default, the others with -m slow.
FACTORS = (1e3, 1e-3)
BETWEEN = 10  # poses in each interval of samples at which a loop is apart: fast hinges turn by half a radian
# Least rate of the driven hinge along the unit vector of all rates.
TURNS = 0.2


class Case:
    """A loop that stays apart from poses of a second freedom, and its motion at the given times."""

    def __init__(self, family: Callable[..., Any], seed: int, damping: float = 0.0) -> None:
        between = np.linspace(0.0, DURATION, 15 * BETWEEN + 1)
        self.times = between[::BETWEEN]
        for further in range(100):
            self.loop = hinge_loops.drawn(family, 1000 * seed + further)
            self.damping = damping * self.loop.length**2
            still = np.zeros(self.loop.count)
            self.v0 = self.loop.velocity(still, SPEED)
            q, v = self.loop.motion(still, self.v0, between, self.damping)
            if min(self.loop.margin(each) for each in q) > APART:
                self.q, self.v = q[::BETWEEN], v[::BETWEEN]
                return
        raise AssertionError("no regular loop")

    def missed(self, scene: pn.Scene, **options: Any) -> float:
        """Largest error of the angles of a run, by the largest one or 1 rad."""
        run = pn.simulate(scene, DURATION, output_dt=self.times[1], **options)
        missed = np.abs(run.q[:, : self.loop.count - 1] - self.q[:, :-1]).max()
        return float(missed / max(1.0, np.abs(self.q).max()))


def frame(model: pin.Model, name: str, joint: int, at: np.ndarray) -> None:
    model.addFrame(pin.Frame(name, joint, 0, pin.SE3(np.eye(3), at), pin.FrameType.OP_FRAME), False)


def by_hinge(loop: HingeLoop, model: pin.Model) -> list[pn.Constraint]:
    return [pn.HingeAnchor("tip", "ground", tuple(loop.axes[-1]), name="loop")]


def by_hinge_twice(loop: HingeLoop, model: pin.Model) -> list[pn.Constraint]:
    axis = tuple(-loop.axes[-1])
    return [*by_hinge(loop, model), pn.HingeAnchor("ground", "tip", axis, name="the same")]


def by_points(loop: HingeLoop, model: pin.Model) -> list[pn.Constraint]:
    """Two points of the axis."""
    along = 0.3 * loop.length * loop.axes[-1]
    for name in ("tip", "ground"):
        known = model.frames[model.getFrameId(name)]
        frame(model, f"{name} further on", known.parentJoint, known.placement.translation + along)
    return [
        pn.PointAnchor("tip", "ground", name="loop"),
        pn.PointAnchor("tip further on", "ground further on", name="alignment"),
    ]


def by_weld(loop: HingeLoop, model: pin.Model) -> list[pn.Constraint]:
    """A joint of the tree instead of the hinge, and the body behind it welded to the ground."""
    known = model.frames[model.getFrameId("tip")]
    last = model.addJoint(
        known.parentJoint, pin.JointModelRevoluteUnaligned(loop.axes[-1]), known.placement, "last hinge"
    )
    plate = pin.Inertia(1.0, np.zeros(3), loop.length**2 * np.eye(3))
    model.appendBodyToJoint(last, plate, pin.SE3.Identity())
    frame(model, "plate", last, np.zeros(3))
    return [pn.FrameAnchor("plate", "ground", name="loop")]


def by_user(loop: HingeLoop, model: pin.Model, factor: float = 1.0) -> list[pn.Constraint]:
    """Rows of one's own, each times a factor, and one of them twice."""
    tip, at, axis = model.getFrameId("tip"), loop.points[-1], loop.axes[-1]
    across = np.linalg.svd(axis[None])[2][1:]
    stated = factor * np.concatenate([np.eye(5), np.eye(5)[2:3]])

    def turned(R: np.ndarray) -> np.ndarray:
        return R @ axis

    def rows(t: float, q: np.ndarray, v: np.ndarray, data: pin.Data) -> tuple[np.ndarray, np.ndarray]:
        where = (model, data, tip, pin.LOCAL_WORLD_ALIGNED)
        J, u = pin.getFrameJacobian(*where), pin.getFrameVelocity(*where)
        du = pin.getFrameClassicalAcceleration(*where)
        a = turned(data.oMf[tip].rotation)
        levers = np.cross(a, across)
        bent = across @ np.cross(u.angular, np.cross(u.angular, a))
        A = np.concatenate([J[:3], levers @ J[3:]])
        return stated @ A, -stated @ np.concatenate([du.linear, levers @ du.angular + bent])

    def residual(t: float, q: np.ndarray) -> np.ndarray:
        R, x = (poses[-2] for poses in loop.poses(np.append(q, 0.0)))
        return stated @ np.concatenate([R @ at + x - at, across @ turned(R)])

    return [pn.UserConstraint(rows, 6, residual, name="loop")]


CLOSINGS: dict[str, Callable[[HingeLoop, pin.Model], list[pn.Constraint]]] = {
    "hinge": by_hinge,
    "hinge twice": by_hinge_twice,
    "points": by_points,
    "weld": by_weld,
    "user's rows": by_user,
}


def closed(case: Case, closing: str = "hinge", length: float = 1.0, factor: float = 1.0) -> pn.Scene:
    """The scene of a loop, in another unit of length, with rows of the user times a factor."""
    loop = case.loop if length == 1.0 else case.loop.scaled(length)
    model = loop.model()
    constraints = by_user(loop, model, factor) if factor != 1.0 else CLOSINGS[closing](loop, model)
    laws = []
    if case.damping > 0.0:
        resist = case.damping * length**2
        laws = [pn.JointFriction(f"hinge {k}", viscous=resist) for k in range(1, loop.count)]
    v0 = case.v0[: model.nv]  # the weld's tree has a joint for the last hinge as well
    return pn.Scene(model, constraints=constraints, laws=laws, q0=np.zeros(model.nq), v0=v0)


@pytest.mark.parametrize("seed", seeds(range(300), count=1))
@pytest.mark.parametrize("family", FREE, ids=lambda family: family.__name__)
def test_overconstrained_loops_move_by_their_one_freedom(
    family: Callable[..., Any], seed: int, request: pytest.FixtureRequest
) -> None:
    """The motion has one freedom for every kind of closure, unit and method."""
    case = Case(family, seed, damping=0.02 * (seed % 2))
    for closing in CLOSINGS:
        assert case.missed(closed(case, closing), rtol=RTOL) < NEAR, closing
    if family is FAMILIES[0] or "slow" in request.keywords:
        for factor in FACTORS:
            assert case.missed(closed(case, factor=factor), rtol=RTOL) < NEAR, factor
    for length in (1e-3, 1e3):
        assert case.missed(closed(case, length=length), rtol=RTOL) < NEAR, length
    assert case.missed(closed(case), method="dopri5", rtol=RTOL) < NEAR
    for method, ratio in RATIOS.items():
        dt = 2e-4 if method == "semi_implicit_euler" else 1e-3
        while (once := case.missed(closed(case), method=method, dt=dt)) > COARSE:
            dt *= 0.5
        halved = case.missed(closed(case), method=method, dt=0.5 * dt)
        if halved < max(once / ratio, FLOOR):
            continue
        # The parts of second and third order may cancel in the longer step.
        assert halved < case.missed(closed(case), method=method, dt=2.0 * dt) / ratio**2, method


@pytest.mark.slow
@pytest.mark.parametrize("method", ["Radau", "BDF", "LSODA"])
@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.__name__)
def test_overconstrained_loops_by_scipy(family: Callable[..., Any], method: str) -> None:
    case = Case(family, seed=0)
    assert case.missed(closed(case), method=method, rtol=1e-8) < SCIPY_NEAR


@pytest.mark.parametrize("seed", seeds(range(300), count=1))
@pytest.mark.parametrize("family", DRIVEN, ids=lambda family: family.__name__)
def test_driven_loops_follow_their_drive(family: Callable[..., Any], seed: int) -> None:
    """A drive prescribes the first hinge: no freedom is left, and all other hinges follow at every sample."""
    times = np.linspace(0.0, DURATION, 16)

    def swing(t: float) -> tuple[float, float]:
        return 0.2 * np.sin(4.0 * t), 0.8 * np.cos(4.0 * t)

    for further in range(100):
        loop = hinge_loops.drawn(family, 1000 * seed + further)
        motion = loop.driven(np.zeros(loop.count), swing, times)
        if motion and all(loop.margin(q) > APART and abs(loop.along(q)[0][0]) > TURNS for q in motion[0]):
            break
    q, v = motion
    model = loop.model()
    drive = pn.PrescribedMotion("hinge 1", pn.sinusoid(0.2, 4.0), name="drive")
    v0 = v[0, : model.nv]
    scene = pn.Scene(model, constraints=[*by_hinge(loop, model), drive], q0=np.zeros(model.nq), v0=v0)
    for options in ({}, {"method": "dopri5"}, {"method": "rk4", "dt": 1e-2}):
        run = pn.simulate(scene, DURATION, output_dt=times[1], **options)
        assert np.abs(run.q - q[:, :-1]).max() < NEAR, options
        assert np.abs(run.v - v[:, :-1]).max() < 1e2 * NEAR, options
