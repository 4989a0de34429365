"""Residuals of the laws of motion, against an independent computation from Pinocchio's terms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

MU, STATIC = 0.02, 1.3
STRONG, LIMIT, BEARING, RADIUS = 5.0, 0.02, 0.02, 0.05
FEET = ("foot0", "foot1", "foot2")
LEGS = ("leg0", "leg1", "leg2")
ROUNDING = 1e-11  # of residuals, whose smallest terms are 1e-5 of the largest
REST = 1e-11  # speed of a slip at rest, relative to 1 + the largest speed
ONSET, SMALL = 1e-6, 1e-10  # slip accelerations of an onset, and of rest


def stool() -> pin.Model:
    """A body on three hinged legs."""
    model = pin.Model()
    body = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "body")
    model.appendBodyToJoint(
        body, pin.Inertia(3.0, np.zeros(3), np.diag([0.05, 0.06, 0.08])), pin.SE3.Identity()
    )
    for k, name in enumerate(LEGS):
        turn = pin.rpy.rpyToMatrix(0.0, 0.0, 2.0 * np.pi * k / 3.0 + 0.1)
        place = pin.SE3(turn, turn @ np.array([0.2, 0.0, 0.0]))
        leg = model.addJoint(body, pin.JointModelRY(), place, name)
        lever = np.array([0.02, 0.01, -0.15])
        model.appendBodyToJoint(leg, pin.Inertia(0.4, lever, 2e-3 * np.eye(3)), pin.SE3.Identity())
        tip = pin.SE3(np.eye(3), np.array([0.05, 0.0, -0.3]))
        model.addFrame(pin.Frame(FEET[k], leg, 0, tip, pin.FrameType.OP_FRAME))
    return model


def scene() -> pn.Scene:
    """The stool on the ground with friction in its feet, and three kinds of friction in its hinges."""
    return pn.Scene(
        stool(),
        contacts=[
            pn.PointContact(foot, mu=MU, static_ratio=STATIC if foot == "foot2" else 1.0) for foot in FEET
        ],
        laws=[
            pn.JointFriction("leg0", coulomb=STRONG),
            pn.JointFriction("leg1", mu=BEARING, radius=RADIUS),
            pn.JointFriction("leg2", coulomb=LIMIT, static_ratio=STATIC, viscous=0.02),
        ],
    )


@dataclass
class Oracle:
    """Terms of Pinocchio at one state of the stool, and residuals of forces."""

    model: pin.Model
    q: np.ndarray
    v: np.ndarray
    closed: np.ndarray

    def __post_init__(self) -> None:
        data = self.model.createData()
        self.M = pin.crba(self.model, data, self.q)
        self.M = np.triu(self.M) + np.triu(self.M, 1).T
        self.nle = pin.nonLinearEffects(self.model, data, self.q, self.v)
        pin.forwardKinematics(self.model, data, self.q, self.v, np.zeros(self.model.nv))
        pin.updateFramePlacements(self.model, data)
        world = pin.LOCAL_WORLD_ALIGNED
        self.J, self.drift, self.place = [], [], []
        for foot in FEET:
            frame = self.model.getFrameId(foot)
            self.J.append(pin.computeFrameJacobian(self.model, data, self.q, frame, world)[:3])
            self.drift.append(pin.getFrameClassicalAcceleration(self.model, data, frame, world).linear)
            self.place.append(data.oMf[frame])
        self.weight = 1.0 / np.sqrt(np.diag(self.M))
        self.rest = REST * (1.0 + np.abs(self.v).max())

    def bearing_load(self, a: np.ndarray, loads: np.ndarray, friction: list[np.ndarray]) -> float:
        """Radial force in the hinge of leg1, by inverse dynamics."""
        data = self.model.createData()
        outside = [pin.Force.Zero() for _ in range(self.model.njoints)]
        pin.forwardKinematics(self.model, data, self.q)
        for k, leg in enumerate(LEGS):
            joint = self.model.getJointId(leg)
            force = pin.Force(np.array([*friction[3 + k], loads[k]]), np.zeros(3))
            at_foot = pin.SE3(np.eye(3), self.place[k].translation)
            outside[joint] = data.oMi[joint].actInv(at_foot.act(force))
        pin.rnea(self.model, data, self.q, self.v, a, outside)
        load = data.f[self.model.getJointId("leg1")].linear
        return float(np.hypot(load[0], load[2]))

    def residuals(
        self, a: np.ndarray, loads: np.ndarray, friction: list[np.ndarray], bearing: float
    ) -> tuple[float, float, float, float]:
        """Motion, Signorini, Coulomb and dissipation. `friction`: of the hinges, then of the feet."""
        viscous = np.zeros(self.model.nv)
        hinges = [self.model.joints[self.model.getJointId(leg)].idx_v for leg in LEGS]
        viscous[hinges[2]] = -0.02 * self.v[hinges[2]]
        terms = [self.M @ a, self.nle, -viscous]
        for k in range(3):
            for row, force in zip(self.J[k], [*friction[3 + k], loads[k]], strict=True):
                terms.append(-row * force)
            hinge = np.zeros(self.model.nv)
            hinge[hinges[k]] = -friction[k][0]
            terms.append(hinge)
        scale = (self.weight * np.abs(terms).sum(axis=0)).max()
        rows, acting = [], [*friction[:3], *(friction[3 + k] for k in np.flatnonzero(self.closed))]
        for k, (limit, ratio) in enumerate(
            [(STRONG, 1.0), (BEARING * RADIUS * bearing, 1.0), (LIMIT, STATIC)]
        ):
            rows.append((np.eye(self.model.nv)[hinges[k]][None], np.zeros(1), limit, ratio))
        for k in np.flatnonzero(self.closed):
            rows.append((self.J[k][:2], self.drift[k][:2], MU * loads[k], STATIC if k == 2 else 1.0))
        for A, _, limit, _ in rows:
            scale = max(scale, limit * np.abs(self.weight * A).max())
        motion = (self.weight * np.abs(np.sum(terms, axis=0))).max() / scale
        signorini = coulomb = dissipation = 0.0
        for k in range(3):
            gap = self.J[k][2] @ a + self.drift[k][2]
            length = np.abs(self.weight * self.J[k][2]).max()
            signorini = max(signorini, abs(min(loads[k] * length, gap / length)) / scale)
        for (A, drift, limit, ratio), f in zip(rows, acting, strict=True):
            length = np.abs(self.weight * A).max()
            u, onset = A @ self.v, A @ a + drift
            speed = np.linalg.norm(u)
            if speed > self.rest:
                missing = np.linalg.norm(f + limit * u / speed) * length / scale
                beyond = np.linalg.norm(f) - limit
            else:
                missing = abs(f @ onset + limit * np.linalg.norm(onset)) / scale**2
                begins = np.linalg.norm(onset) / (length * scale)
                if begins <= ONSET:
                    missing = min(missing, abs(np.linalg.norm(f) - limit) * length / scale)
                beyond = np.linalg.norm(f) - limit * (1.0 if begins > SMALL else ratio)
            coulomb = max(coulomb, beyond * length / scale)
            dissipation = max(dissipation, missing)
        return motion, signorini, coulomb, dissipation


def standing_state(rng: np.random.Generator, model: pin.Model, kind: str) -> tuple[np.ndarray, np.ndarray]:
    """A configuration with all feet on the ground, and a velocity along it: at rest, sliding or folding."""
    angle = rng.uniform(-0.4, 0.4)
    q = pin.neutral(model)
    q[7:] = angle
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    q[2] = -data.oMf[model.getFrameId(FEET[0])].translation[2]
    v = np.zeros(model.nv)
    if kind != "rest":
        v[[0, 1, 5]] = rng.uniform(-1.0, 1.0, 3)
    if kind == "fold":
        v[6:] = rng.uniform(-1.0, 1.0)
        pin.computeJointJacobians(model, data, q)
        foot = pin.computeFrameJacobian(model, data, q, model.getFrameId(FEET[0]), pin.LOCAL_WORLD_ALIGNED)
        v[2] = -foot[2, 6:] @ v[6:]
    return q, v


@pytest.mark.parametrize("kind", ["rest", "slide", "fold"])
@pytest.mark.parametrize("seed", range(4))
def test_residuals_agree_with_pinocchio(kind: str, seed: int) -> None:
    """Residuals of the motion are rounding, and those of wrong forces equal the independent ones."""
    rng = np.random.default_rng(seed)
    stands = scene()
    q, v = standing_state(rng, stands.model, kind)
    runner = stands._compiled.program.runner()
    found = runner.solve(q, v, 0.0)
    closed = np.array(found.closed, dtype=bool)
    oracle = Oracle(stands.model, q, v, closed)
    loads, friction = np.array(found.lam[-3:]), [np.array(f) for f in found.friction]
    bearing = oracle.bearing_load(found.a, loads, friction)
    own = [size for size, _ in runner.law_residuals(q, v)]
    assert max(own) < 1e-13
    assert max(oracle.residuals(found.a, loads, friction, bearing)) < 1e-12
    for part in ("a", "loads", "friction"):
        for size in (1e-6, 0.1):
            a, wrong_loads = found.a.copy(), loads.copy()
            wrong_friction = [f.copy() for f in friction]
            if part == "a":
                a += size * rng.standard_normal(a.size)
            elif part == "loads":
                wrong_loads += size * 10.0 * rng.standard_normal(3) * closed
            else:
                acts = [1.0, 1.0, 1.0, *closed]
                wrong_friction = [
                    f + size * act * rng.standard_normal(f.size)
                    for f, act in zip(friction, acts, strict=True)
                ]
            seen = runner.law_residuals(q, v, a=a, loads=wrong_loads, friction=wrong_friction)
            expected = oracle.residuals(a, wrong_loads, wrong_friction, bearing)
            assert [s for s, _ in seen] == pytest.approx(expected, rel=1e-8, abs=ROUNDING)
            assert max(expected) > 1e-3 * size
