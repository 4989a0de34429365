"""Optimized Python loop around Pinocchio: SciPy with pin.aba or pin.constraintDynamics.

Data, constraint models and buffers are created once.  LSODA runs through `odeint`, which has a compiled loop.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.integrate import ODEintWarning, odeint, solve_ivp

from .base import Outcome, Setting, tolerances

Array = NDArray[np.float64]

# Proximal term of constraintDynamics for redundant rows, such as one of the three rows of a planar loop.  The
# manual of Pinocchio recommends 1e-12.  The relative error of the acceleration is then 1e-13.
REDUNDANT_MU = 1e-12
MAX_EVALUATIONS = 200_000


def anchors(problem: Any) -> list[Any]:
    """Return the problem's anchors as Pinocchio's rigid constraint models."""
    model = problem.model
    data = model.createData()
    pin.framesForwardKinematics(model, data, problem.q0)
    found = []
    for anchor in problem.anchors:
        kind = (
            pin.ContactType.CONTACT_6D
            if type(anchor).__name__ == "FrameAnchor"
            else pin.ContactType.CONTACT_3D
        )
        one = model.getFrameId(anchor.frame1)
        ends = [model.frames[one].parentJoint, model.frames[one].placement]
        if anchor.frame2 is None:
            ends += [0, data.oMf[one]]
        else:
            two = model.frames[model.getFrameId(anchor.frame2)]
            ends += [two.parentJoint, two.placement]
        found.append(pin.RigidConstraintModel(kind, model, *ends, pin.ReferenceFrame.LOCAL))
    return found


def containers(models: list[Any]) -> tuple[Any, Any]:
    """Return constraint models and data in Pinocchio's vectors: lists would be copied at every call."""
    kept, data = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    for model in models:
        kept.append(model)
        data.append(model.createData())
    return kept, data


def is_redundant(problem: Any) -> bool:
    """Check if an anchor has fewer than three axes: Pinocchio constrains all three, with a redundant row."""
    return any(len(getattr(anchor, "axes", "xyz")) < 3 for anchor in problem.anchors)


def proximal(problem: Any) -> Any:
    return pin.ProximalSettings(1e-14, REDUNDANT_MU if is_redundant(problem) else 0.0, 1)


class PinocchioSciPy:
    """LSODA and DOP853 over Pinocchio's forward dynamics."""

    name = "pin+scipy"
    title = "Pinocchio + SciPy (Python loop)"

    def missing(self) -> str | None:
        """Return the reason why the tool cannot run, or None."""
        return None

    def settings(self, problem: Any) -> list[Setting]:
        """Return the settings to try."""
        del problem
        tried = [Setting("LSODA", f"rtol {r:.0e}", values={"rtol": r}) for r in tolerances(3, 13)]
        return tried + [Setting("DOP853", f"rtol {r:.0e}", values={"rtol": r}) for r in tolerances(3, 13)]

    def prepare(self, problem: Any, setting: Setting, samples: int = 1) -> Callable[[], Outcome]:
        """Return a function that runs the problem once from its start."""
        rate = equation(problem)
        y0 = np.concatenate([problem.q0, problem.v0])
        rtol, nq = setting.values["rtol"], problem.model.nq
        times = np.linspace(0.0, problem.duration, samples + 1)
        count = 0

        def lsoda() -> Outcome:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ODEintWarning)
                y, info = odeint(
                    rate,
                    y0,
                    times,
                    tfirst=True,
                    rtol=rtol,
                    atol=rtol,
                    full_output=True,
                    mxstep=MAX_EVALUATIONS,
                )
            steps = int(info["nst"][-1])
            if info["message"] != "Integration successful." or not np.isfinite(y).all():
                return Outcome(None, steps, failure=str(info["message"]))
            return Outcome(y[1:, :nq], steps, v=y[-1, nq:])

        def copied(t: float, y: Array) -> Array:
            """Return a copy of the rate, which SciPy stores; raise TimeoutError after MAX_EVALUATIONS."""
            nonlocal count
            count += 1
            if count > MAX_EVALUATIONS:
                raise TimeoutError(f"more than {MAX_EVALUATIONS} evaluations")
            return rate(t, y).copy()

        def dop853() -> Outcome:
            nonlocal count
            count = 0
            try:
                out = solve_ivp(
                    copied,
                    (0.0, problem.duration),
                    y0,
                    method="DOP853",
                    rtol=max(rtol, 3e-14),
                    atol=rtol,
                    t_eval=times if samples > 1 else None,
                )
            except TimeoutError as error:
                return Outcome(None, 0, failure=str(error))
            if not out.success or not np.isfinite(out.y[:, -1]).all():
                return Outcome(None, len(out.t) - 1, failure=str(out.message))
            return Outcome(out.y[:nq, -samples:].T, len(out.t) - 1, v=out.y[nq:, -1])

        return lsoda if setting.family == "LSODA" else dop853


def equation(problem: Any) -> Callable[[float, Array], Array]:
    """Return a function that computes dy/dt of y = (q, v) in an array that every call overwrites."""
    model = problem.model
    data, nq, nv = model.createData(), model.nq, model.nv
    models, datas = containers(anchors(problem))
    settings = proximal(problem)
    if models:
        pin.initConstraintDynamics(model, data, models, datas)
    floating = model.joints[1].shortname() == "JointModelFreeFlyer"
    still = np.zeros(nv) if problem.torque is None else problem.torque
    torque, dy = forces(problem, data), np.empty(nq + nv)

    def rate(t: float, y: Array) -> Array:
        q, v = y[:nq], y[nq:]
        if floating:
            q = q.copy()
            q[3:7] /= np.sqrt(q[3:7] @ q[3:7])
        tau = still if torque is None else torque(q, v)
        if models:
            a = pin.constraintDynamics(model, data, q, v, tau, models, datas, settings)
        else:
            a = pin.aba(model, data, q, v, tau)
        if floating:
            dy[:7], dy[7:nq] = base_rate(q, v), v[6:]
        else:
            dy[:nq] = v
        dy[nq:] = a
        return dy

    return rate


def base_rate(q: Array, v: Array) -> list[float]:
    """Return rates of position and quaternion of a floating base; floats are faster than small arrays."""
    _, _, _, x, y, z, w = q[:7].tolist()
    a, b, c, p, r, s = v[:6].tolist()
    tx, ty, tz = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return [
        a + w * tx + y * tz - z * ty, b + w * ty + z * tx - x * tz, c + w * tz + x * ty - y * tx,
        0.5 * (w * p + y * s - z * r), 0.5 * (w * r + z * p - x * s), 0.5 * (w * s + x * r - y * p),
        -0.5 * (x * p + y * r + z * s),
    ]  # fmt: skip


def forces(problem: Any, data: Any) -> Callable[[Array, Array], Array] | None:
    """Return a function of the state-dependent joint torques, or None."""
    model, parts = problem.model, []
    still = np.zeros(model.nv) if problem.torque is None else problem.torque
    if problem.hold is not None:
        kp, kd = problem.hold
        offset = model.nq - model.nv
        goal = problem.q0[offset:].copy()
        parts.append(lambda q, v: kp * (goal - q[offset:]) - kd * v)
    if problem.coulomb is not None:
        viscous = np.zeros(model.nv) if problem.viscous is None else problem.viscous
        parts.append(lambda q, v: -problem.coulomb * np.sign(v) - viscous * v)
    for spring in problem.springs:
        parts.append(spring_torque(model, data, spring))
    if not parts:
        return None
    return lambda q, v: still + sum(part(q, v) for part in parts)


def spring_torque(model: Any, data: Any, spring: Any) -> Callable[[Array, Array], Array]:
    """Return a function of the joint torque of an undamped spring, by the Jacobians of its ends."""
    one, two = model.getFrameId(spring.frame1), model.getFrameId(spring.frame2)
    world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED

    def torque(q: Array, v: Array) -> Array:
        del v
        pin.computeJointJacobians(model, data, q)
        J = (
            pin.getFrameJacobian(model, data, one, world)[:3]
            - pin.getFrameJacobian(model, data, two, world)[:3]
        )
        gap = data.oMf[one].translation - data.oMf[two].translation
        length = np.sqrt(gap @ gap)
        return J.T @ (-spring.stiffness * (length - spring.rest_length) / length * gap)

    return torque
