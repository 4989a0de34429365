"""Cases: the arguments of a scene and its runs as values, and their linear maps of coordinates."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin

import pin_nonideal as pn
from pin_nonideal.description.actuation import EffortLimits, HoldPosition, SampledControl, Table
from pin_nonideal.description.time_functions import Constant, Polynomial, Sinusoid, Spline

from .models import SI, Units, joint_letter


@dataclass(frozen=True, eq=False)
class Case:
    """Scene and its run; all its parts have names.

    Attributes:
        drawn: consistent states for instantaneous results; None for random states near the start.
        moved: states off the constraints; None for the start moved along constraint forces.
        outputs: number of samples of a run after its start.
        onset: time by which an event may be late that marks the onset of a smooth motion [s].
        parts: fractions of the duration at which a run is divided.
        finer: factor of the number of samples.
        method: method in place of the function's method, with `dt`.
        still: whether the case has states of rest.
        units: units of the values.
        skips: names of functions that are skipped.
    """

    name: str
    model: pin.Model
    constraints: tuple[Any, ...] = ()
    laws: tuple[Any, ...] = ()
    contacts: tuple[Any, ...] = ()
    forces: tuple[Any, ...] = ()
    actuation: Any = None
    q0: Any = None
    v0: Any = None
    impact: str = "newton"
    terms: str = "core"
    duration: float = 0.3
    t0: float = 0.0
    drawn: tuple[tuple[np.ndarray, np.ndarray], ...] | None = None
    moved: tuple[tuple[np.ndarray, np.ndarray], ...] | None = None
    outputs: int = 20
    finer: int = 1
    onset: float = 0.0
    parts: tuple[float, ...] = ()
    rtol: float = 1e-9
    atol: Any = 1e-11
    dt: float = 1e-3
    method: str | None = None
    still: bool = True
    units: Units = SI
    skips: frozenset[str] = frozenset()

    @cached_property
    def scene(self) -> pn.Scene:
        names = (
            "constraints",
            "laws",
            "contacts",
            "forces",
            "actuation",
            "q0",
            "v0",
            "impact",
            "terms",
            "name",
        )
        return pn.Scene(self.model, **{name: getattr(self, name) for name in names})

    @cached_property
    def states(self) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
        return _states(self) if self.drawn is None else self.drawn

    @cached_property
    def off(self) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
        return _off(self) if self.moved is None else self.moved

    @cached_property
    def descriptions(self) -> tuple[Any, ...]:
        return (*self.constraints, *self.laws, *self.contacts, *self.forces)

    def has(self, *kinds: type) -> bool:
        return any(isinstance(d, kinds) for d in (*self.descriptions, self.actuation))


def case_of(scene: pn.Scene, name: str | None = None, **more: Any) -> Case:
    """Return the case of a scene, with names for all parts and random states near its start.

    Args:
        scene: the scene.
        name: name of the case; None for the scene's name.
        **more: fields of the case.
    """
    used: dict[str, int] = {}

    def named(d: Any) -> Any:
        called = d.name or f"{type(d).__name__} {getattr(d, 'joint', getattr(d, 'frame', ''))}".strip()
        used[called] = used.get(called, 0) + 1
        called = called if used[called] == 1 else f"{called} {used[called]}"
        return replace(d, name=called)

    lists = {
        key: tuple(map(named, getattr(scene, key))) for key in ("constraints", "contacts", "laws", "forces")
    }
    return Case(
        name or scene.name,
        scene.model,
        **lists,
        actuation=scene.actuation,
        q0=np.array(scene.q0),
        v0=np.array(scene.v0),
        impact=scene.impact,
        **more,
    )


def _states(case: Case) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    """Return the start and a state after a random perturbation, or the start only if that fails."""
    scene, rng = case.scene, np.random.default_rng(7)
    q, v = scene.initial_state()
    found = [(q, v)]
    speed = 0.3 * (np.abs(v).max(initial=0.0) + 1.0)
    try:
        kicked = scene.project(q, v + speed * rng.standard_normal(scene.model.nv), case.t0)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            run = pn.simulate(scene, 20.0 * case.dt, *kicked, t0=case.t0, method="rk4", dt=case.dt)
        found.append(scene.project(run.q[-1], run.v[-1], case.t0))
    except pn.PinNonidealError:
        pass
    return tuple(found)


def _off(case: Case) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    """Return the start moved by up to a hundredth of a unit along constraint forces."""
    scene, (q, v) = case.scene, case.states[0]
    try:
        force = np.asarray(scene.solve(q, v, case.t0).F_ideal)
    except pn.PinNonidealError:
        return ()
    M = pin.crba(scene.model, scene.model.createData(), q)
    push = np.linalg.solve(np.triu(M) + np.triu(M, 1).T, force)
    size = float(np.abs(push).max(initial=0.0))
    return ((pin.integrate(scene.model, q, 1e-2 * push / size), v),) if size > 0.0 else ()


# --- Maps of coordinates --------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Maps:
    """Linear maps from the coordinates of a case to the coordinates of its image.

    Small displacements are d = P d' and d' = S d: q = Pq q', v = T P v', a = T^2 P a', and generalized forces
    F = S^T F'/E; q' = Sq q + more_q(t'), v' = S v/T + more_v(t').

    Attributes:
        units: units of the image.
        later: time of the image at time 0 of the case.
    """

    P: np.ndarray
    S: np.ndarray
    Pq: np.ndarray
    Sq: np.ndarray
    units: Units = SI
    later: float = 0.0
    more_q: Callable[[float], np.ndarray] | None = None
    more_v: Callable[[float], np.ndarray] | None = None

    @classmethod
    def same(cls, model: pin.Model, **more: Any) -> Maps:
        one, oneq = np.eye(model.nv), np.eye(model.nq)
        return cls(one, one, oneq, oneq, **more)

    @classmethod
    def chosen(cls, old: pin.Model, new: pin.Model, joints: dict[int, int], **more: Any) -> Maps:
        """Return maps to a model that has the same joints at other indices, and additional joints."""
        S, Sq = np.zeros((new.nv, old.nv)), np.zeros((new.nq, old.nq))
        for j, k in joints.items():
            if j:
                S[np.arange(new.nvs[k]) + new.idx_vs[k], np.arange(old.nvs[j]) + old.idx_vs[j]] = 1.0
                Sq[np.arange(new.nqs[k]) + new.idx_qs[k], np.arange(old.nqs[j]) + old.idx_qs[j]] = 1.0
        neutral = pin.neutral(new) * (Sq.sum(axis=1) == 0.0)
        return cls(S.T, S, Sq.T, Sq, **{"more_q": lambda t: neutral, **more})

    def time(self, t: float) -> float:
        return self.units.T * t + self.later

    def time_back(self, t: Any) -> Any:
        return (t - self.later) / self.units.T

    def state(self, q: np.ndarray, v: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the image of a state at time t of the case."""
        t = self.time(t)
        q, v = self.Sq @ q, self.S @ v / self.units.T
        return (
            q if self.more_q is None else q + self.more_q(t),
            v if self.more_v is None else v + self.more_v(t),
        )

    def q_back(self, q: np.ndarray) -> np.ndarray:
        return q @ self.Pq.T

    def v_back(self, v: np.ndarray) -> np.ndarray:
        return self.units.T * (v @ self.P.T)

    def force_back(self, F: np.ndarray) -> np.ndarray:
        return F @ self.S / self.units.energy

    def force(self, F: Any) -> np.ndarray:
        return self.units.energy * (np.asarray(F, dtype=float) @ self.P)


# --- Functions of time ----------------------------------------------------------------------------------


def carried_function(f: Any, maps: Maps, unit: float) -> Any:
    """Return a function of time t -> (value, rate, acceleration) in other units, with a delay."""
    T, later = maps.units.T, maps.later
    if isinstance(f, Constant):
        return Constant(unit * f.value)
    if isinstance(f, Sinusoid):
        w = f.omega / T
        return Sinusoid(unit * f.amplitude, w, f.phase - w * later, unit * f.offset)
    if isinstance(f, Polynomial):
        line = np.polynomial.Polynomial([-later / T, 1.0 / T])
        return Polynomial(tuple(unit * np.polynomial.Polynomial(f.coefficients)(line).coef))
    if isinstance(f, Spline):
        return Spline(T * np.asarray(f.times) + later, unit * np.asarray(f.values), f.ends)

    def g(t: float) -> tuple[float, float, float]:
        x, dx, ddx = f(maps.time_back(t))
        return unit * x, unit * dx / T, unit * ddx / T**2

    return g


# --- Functions of the user ------------------------------------------------------------------------------


class Reactions:
    """Reactions of an image in the coordinates of the case, for its laws."""

    def __init__(self, of: Any, carrier: Carrier) -> None:
        self._of, self._carrier = of, carrier

    def __getitem__(self, name: str) -> np.ndarray:
        return self._carrier.rows_back(name, lambda called: self._of[called])

    @property
    def lam(self) -> np.ndarray:
        parts = [self[name] for name in self._carrier.case.scene.constraint_slices]
        return np.concatenate(parts) if parts else np.zeros(0)

    def wrench(self, name: str) -> np.ndarray:
        units = self._carrier.maps.units
        return np.asarray(self._of.wrench(name)) / np.repeat([units.force, units.energy], 3)


@dataclass(frozen=True, eq=False)
class Carrier:
    """Mapping of the descriptions of a case to its image.

    Attributes:
        case: the case.
        maps: maps of the coordinates.
        rows: for each constraint and contact with more than a change of units, names in the image and
            matrices with lam = sum of matrix @ lam'[name].
        turn: orientation of the image's world axes.
    """

    case: Case
    maps: Maps
    rows: dict[str, list[tuple[str, np.ndarray]]] = field(default_factory=dict)
    turn: np.ndarray = field(default_factory=lambda: np.eye(3))

    def rows_back(self, name: str, lam: Callable[[str], np.ndarray]) -> np.ndarray:
        """Return lam of a constraint of the case."""
        if name in self.rows:
            return sum(lam(called) @ np.asarray(matrix).T for called, matrix in self.rows[name])
        return lam(name) * self.row_units(name) / self.maps.units.energy

    def row_units(self, name: str) -> np.ndarray:
        """Return the unit factor of each row's residual."""
        about = name.removesuffix(" lower").removesuffix(" upper")
        d = next(d for d in (*self.case.constraints, *self.case.contacts) if d.name in (name, about))
        return self.maps.units.of(row_letters(self.case.model, d))

    def q(self, q: Any) -> np.ndarray:
        return self.maps.q_back(np.asarray(q))

    def v(self, v: Any) -> np.ndarray:
        return self.maps.v_back(np.asarray(v))

    def t(self, t: float) -> float:
        return float(self.maps.time_back(t))

    def data(self, q: np.ndarray, v: np.ndarray) -> pin.Data:
        model = self.case.model
        data = model.createData()
        pin.forwardKinematics(model, data, q, v, np.zeros(model.nv))
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        return data

    def function(self, d: Any, key: str) -> Any:
        """Return a function of a description in the coordinates of the image."""
        f, T = getattr(d, key), self.maps.units.T
        if f is None:
            return None
        if key == "function" and isinstance(d, (pn.UserConstraint, pn.UserContact)):

            def rows(t: float, q: Any, v: Any, data: Any) -> Any:
                q, v = self.q(q), self.v(v)
                A, b = f(self.t(t), q, v, self.data(q, v))
                return np.asarray(A) @ self.maps.P, np.asarray(b) / T**2

            return rows
        if key in ("residual", "gap"):
            return lambda t, q: f(self.t(t), self.q(q))
        if key == "rate":
            return lambda t, q, v: np.asarray(f(self.t(t), self.q(q), self.v(v))) / T
        if key in ("directions", "direction"):
            return lambda t, q: np.asarray(f(self.t(t), self.q(q))) @ self.maps.P
        if key == "limit":
            return lambda t, q, v, r: (
                self.maps.units.energy * f(self.t(t), self.q(q), self.v(v), Reactions(r, self))
            )
        if isinstance(d, pn.UserLaw):
            return self._law(d)
        return lambda t, q, v: self.maps.force(f(self.t(t), self.q(q), self.v(v)))

    def _law(self, d: Any) -> Any:
        def force(t: float, q: Any, v: Any, r: Any, *z: Any) -> Any:
            r = None if r is None else Reactions(r, self)
            found = d.function(self.t(t), self.q(q), self.v(v), r, *z)
            if d.states:
                return self.maps.force(found[0]), np.asarray(found[1]) / self.maps.units.T
            return self.maps.force(found)

        return force

    def wrench(self, d: Any) -> Any:
        factors = np.repeat([self.maps.units.force, self.maps.units.energy], 3)

        def turned(value: Any) -> np.ndarray:
            return factors * (np.reshape(value, (2, 3)) @ self.turn.T).ravel()

        if callable(d.value):
            return lambda t: turned(d.value(self.t(t)))
        return tuple(turned(d.value))

    def description(self, d: Any) -> Any:
        """Return the description in the image."""
        from .dimensions import factor

        changes = {}
        for key in (f.name for f in fields(d)):
            value = getattr(d, key)
            if isinstance(d, pn.Wrench) and key == "value":
                changes[key] = self.wrench(d)
            elif isinstance(d, (pn.PrescribedMotion, pn.Distance)) and callable(value):
                unit = self.maps.units.L
                if isinstance(d, pn.PrescribedMotion):
                    unit = self.maps.units.of(joint_letter(self.case.model, d.joint))[0]
                changes[key] = carried_function(value, self.maps, unit)
            elif callable(value):
                changes[key] = self.function(d, key)
            elif isinstance(value, (int, float, tuple)) and not isinstance(value, bool):
                by = factor(d, key, self.case.model, self.case.constraints)(self.maps.units)
                changes[key] = value if by == 1.0 else _times(by, value)
        return replace(d, **changes)

    def actuation(self, model: pin.Model) -> Any:
        given, maps, nv = self.case.actuation, self.maps, self.case.model.nv
        if isinstance(given, EffortLimits):
            inner = replace(self.case, actuation=given.actuation)
            effort = given.effort if given.effort is None else np.broadcast_to(given.effort, nv)
            if effort is not None:
                effort = maps.force(effort) + (np.abs(maps.P).sum(axis=0) == 0.0)
            return replace(given, actuation=replace_case(self, inner).actuation(model), effort=effort)
        if isinstance(given, SampledControl):
            return replace(
                given,
                function=self.function(given, "function"),
                period=maps.units.T * given.period,
                delay=maps.units.T * given.delay,
                initial=None if given.initial is None else maps.force(np.asarray(given.initial)),
            )
        if isinstance(given, Table):
            return replace(
                given,
                times=maps.units.T * np.asarray(given.times) + maps.later,
                values=maps.force(given.values),
            )
        if isinstance(given, HoldPosition):
            kp, kd = (self._gain(g) for g in (given.kp, given.kd))
            q = self.case.q0 if given.q is None else given.q
            return replace(
                given,
                kp=np.einsum("ij,i,ij->j", maps.P, kp, maps.P) * maps.units.energy,
                kd=np.einsum("ij,i,ij->j", maps.P, kd, maps.P) * maps.units.energy * maps.units.T,
                q=maps.state(q, np.zeros(nv), 0.0)[0],
            )
        if callable(given):
            return lambda t, q, v: maps.force(given(self.t(t), self.q(q), self.v(v)))
        return given if given is None else maps.force(given)

    def _gain(self, gain: Any) -> np.ndarray:
        """Return gains for all degrees of freedom; a scalar applies to one-dof joints."""
        if np.ndim(gain):
            return np.asarray(gain, dtype=float)
        model = self.case.model
        single = np.repeat([nv == 1 for nv in list(model.nvs)[1:]], list(model.nvs)[1:])
        return float(gain) * single

    def image(self, model: pin.Model, **changes: Any) -> Case:
        """Return the image of the case."""
        case, maps = self.case, self.maps
        lists = {
            key: tuple(map(self.description, getattr(case, key)))
            for key in ("constraints", "laws", "contacts", "forces")
        }
        q0, v0 = maps.state(case.q0, case.v0, case.t0)
        atol = np.broadcast_to(case.atol, 2 * case.model.nv)
        size = np.abs(maps.S).max(axis=1, initial=0.0)
        small = np.where(size > 0.0, size, 1.0)
        near, fast = (
            np.where(size > 0.0, np.abs(maps.S) @ part, part.min(initial=1e-11))
            for part in (atol[: case.model.nv], atol[case.model.nv :])
        )
        given = dict(
            model=model,
            **lists,
            actuation=self.actuation(model),
            q0=q0,
            v0=v0,
            duration=maps.units.T * case.duration,
            t0=maps.time(case.t0),
            dt=maps.units.T * case.dt,
            units=maps.units,
            drawn=tuple(maps.state(q, v, case.t0) for q, v in case.states),
            moved=tuple(maps.state(q, v, case.t0) for q, v in case.off),
            atol=case.atol
            if np.ptp(atol) == 0.0 and (small == 1.0).all() and maps.units.T == 1.0
            else np.concatenate([near, fast / maps.units.T]),
        )
        return replace(case, **{**given, **changes})


def replace_case(carrier: Carrier, case: Case) -> Carrier:
    return replace(carrier, case=case)


def _times(factor: Any, value: Any) -> Any:
    if isinstance(value, tuple):
        found = np.asarray(factor) * np.asarray(value, dtype=float)
        return tuple(map(tuple, found.tolist())) if found.ndim == 2 else tuple(found.tolist())
    return type(value)(factor * value) if isinstance(value, float) else factor * value


def row_letters(model: pin.Model, d: Any) -> str:
    """Return the dimension of each row of a constraint or contact; rows of users are dimensionless."""
    if isinstance(d, (pn.UserConstraint, pn.UserContact)):
        return "1" * getattr(d, "size", 1)
    if isinstance(d, pn.JointCoupling):
        return joint_letter(model, d.joint1)
    if isinstance(d, (pn.PrescribedMotion, pn.JointLimit)):
        return joint_letter(model, d.joint)
    if isinstance(d, pn.PointAnchor):
        return "L" * len(d.axes)
    return {pn.FrameAnchor: "LLL111", pn.HingeAnchor: "LLL11", pn.Rolling: "LLL"}.get(type(d), "L")
