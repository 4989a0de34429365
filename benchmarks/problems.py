"""Table of problems, defined once for all tools, with references that are independent of the tools."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import pin_nonideal as pn
from oracles.rods import rods

from . import reference_store, references
from .references import Reference

Array = NDArray[np.float64]

SAMPLES = 10
LEVELS = (1e-3, 1e-6, 1e-8, 1e-10)  # errors for which the time is reported


@dataclass(frozen=True, eq=False)
class Problem:
    """Motion to compute.

    Attributes:
        name: name on the command line and in the results.
        title: title in tables.
        model: pinocchio.Model, the source of every tool's model.
        q0: initial configuration, consistent with the anchors.
        v0: initial velocity, consistent with the anchors.
        duration: duration [s].
        reference: function that computes the configurations at `times`.
        anchors: PointAnchor and FrameAnchor descriptions.
        springs: SpringDamper descriptions.
        torque: constant joint torques, (nv,).
        hold: proportional and derivative gains (nv,), (nv,), around q0.
        coulomb: constant dry friction of each degree of freedom, (nv,).
        viscous: viscous friction of each degree of freedom, (nv,).
        notes: remark in tables.
        levels: errors for which the time is reported.
    """

    name: str
    title: str
    model: Any
    q0: Array
    v0: Array
    duration: float
    reference: Callable[[Problem], Reference] = references.dense_motion
    anchors: tuple[Any, ...] = ()
    springs: tuple[Any, ...] = ()
    torque: Array | None = None
    hold: tuple[Array, Array] | None = None
    coulomb: Array | None = None
    viscous: Array | None = None
    notes: str = ""
    levels: tuple[float, ...] = LEVELS

    @cached_property
    def solution(self) -> Reference:
        """Return the stored reference, or compute it."""
        return reference_store.read(self) or self.reference(self)

    @property
    def times(self) -> Array:
        """Return the SAMPLES times of error measurement [s], against zero crossings of the error."""
        return np.linspace(0.0, self.duration, SAMPLES + 1)[1:]

    def error(self, q: Array) -> float:
        """Return the largest error of a coordinate [rad or m]; infinite if q is not finite.

        Args:
            q: configurations at the last of `times`, (k, nq).
        """
        if not np.isfinite(q).all():
            return float("inf")
        pairs = zip(self.solution.q[-len(q) :], q, strict=True)
        return max(float(np.abs(pin.difference(self.model, exact, found)).max()) for exact, found in pairs)

    def scene(self, terms: str = "core") -> pn.Scene:
        """Return the problem as a scene of the package.

        Args:
            terms: implementation of M and the bias forces, "core" or "pinocchio".
        """
        laws = []
        for i in range(1, self.model.njoints):
            dof = self.model.joints[i].idx_v
            coulomb = 0.0 if self.coulomb is None else float(self.coulomb[dof])
            viscous = 0.0 if self.viscous is None else float(self.viscous[dof])
            if coulomb or viscous:
                laws.append(pn.JointFriction(self.model.names[i], coulomb=coulomb, viscous=viscous))
        actuation: Any = self.torque
        if self.hold is not None:
            actuation = pn.HoldPosition(*self.hold, q=self.q0)
        return pn.Scene(
            self.model,
            constraints=self.anchors,
            laws=laws,
            forces=self.springs,
            actuation=actuation,
            q0=self.q0,
            v0=self.v0,
            name=self.name,
            terms=terms,
        )


def bare(scene: pn.Scene) -> dict[str, Any]:
    """Return model, anchors and consistent initial state of a scene, as attributes of a Problem."""
    q0, v0 = scene.initial_state()
    return {"model": scene.model, "anchors": scene.constraints, "q0": q0, "v0": v0}


def hanging(lengths: list[float], masses: list[float]) -> Any:
    """Return a chain of rods along -z at zero angles."""
    return rods(lengths, masses, along=(0.0, 0.0, -1.0), name="hinge")


def double_pendulum() -> Problem:
    return Problem(
        name="double_pendulum",
        title="double pendulum, 2 s",
        model=hanging([0.5, 0.4], [1.0, 0.7]),
        q0=np.array([1.2, 0.8]),
        v0=np.zeros(2),
        duration=2.0,
    )


def panda() -> Problem:
    scene = pn.load("panda_friction")
    q0, _ = scene.initial_state()
    return Problem(
        name="panda",
        title="Panda arm falling, 1 s",
        model=scene.model,
        q0=q0,
        v0=np.zeros(scene.model.nv),
        duration=1.0,
        notes="fingers locked, no friction",
    )


def four_bar() -> Problem:
    return Problem(
        name="four_bar",
        title="four-bar, 2 s",
        **bare(pn.load("four_bar")),
        duration=2.0,
        reference=references.four_bar_quadrature,
        notes="crank-rocker without friction, about four turns",
    )


def n_four_bar() -> Problem:
    return Problem(
        name="n_four_bar",
        title="10 four-bars, 1 s",
        **bare(pn.load("n_four_bar", N=10)),
        duration=1.0,
        reference=references.n_four_bar_quadrature,
        notes="IFToMM A02, through one singular position",
    )


def andrews() -> Problem:
    scene = pn.load("andrews_squeezer")
    torque = np.zeros(scene.model.nv)
    torque[scene.model.joints[scene.model.getJointId("beta")].idx_v] = 0.033
    return Problem(
        name="andrews",
        title="Andrews' squeezer, 0.03 s",
        **bare(scene),
        springs=scene.forces,
        torque=torque,
        duration=0.03,
        reference=references.andrews,
        levels=(1e-3, 1e-6, 1e-8),
    )


def solo12_gains(model: Any) -> tuple[Any, Any]:
    """Return position and velocity gains of the standing Solo12 [N m/rad, N m s/rad]."""
    kp, kd = np.full(model.nv, 8.0), np.full(model.nv, 0.1)
    kp[:6] = kd[:6] = 0.0
    return kp, kd


def solo12() -> Problem:
    scene = pn.load("solo12_standing")
    return Problem(
        name="solo12",
        title="Solo12 on four anchored feet, 1 s",
        **bare(scene),
        hold=solo12_gains(scene.model),
        duration=1.0,
    )


def coulomb_pendulum() -> Problem:
    return Problem(
        name="coulomb_pendulum",
        title="pendulum with Coulomb friction, 2 s",
        model=hanging([1.0], [1.0]),
        q0=np.array([1.2]),
        v0=np.zeros(1),
        duration=2.0,
        coulomb=np.array([0.5]),
        reference=references.coulomb_swings,
        levels=(1e-3, 1e-4, 1e-6, 1e-9),
    )


def coulomb_rest() -> Problem:
    return replace(
        coulomb_pendulum(),
        name="coulomb_rest",
        title="pendulum with Coulomb friction, rest angle at 10 s",
        duration=10.0,
    )


def panda_friction() -> Problem:
    scene = pn.load("panda_friction")
    return Problem(
        name="panda_friction",
        title="Panda with joint friction, 1 s",
        **bare(scene),
        duration=1.0,
        coulomb=np.array([law.coulomb for law in scene.laws]),
        viscous=np.array([law.viscous for law in scene.laws]),
        reference=references.dense_friction,
        levels=(1e-3, 1e-4, 1e-6, 1e-8),
    )


MAKERS: dict[str, Callable[[], Problem]] = {
    maker.__name__: maker
    for maker in (
        four_bar,
        double_pendulum,
        panda,
        coulomb_pendulum,
        coulomb_rest,
        andrews,
        n_four_bar,
        solo12,
        panda_friction,
    )
}


@cache
def problem(name: str) -> Problem:
    """Return a problem of the table; cached for the process."""
    return MAKERS[name]()
