"""Actuators of a compiled MJCF model as the actuation of a scene."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from pin_nonideal.errors import InputError, UnknownNameError, nearest, short_repr
from pin_nonideal.types import Array
from pin_nonideal.validation import array, number

from .motion import FixedTendon
from .mujoco_types import MjModel
from .transmissions import BODY, TENDON, GearedLength, OnBall, OnSite, Transmission
from .tree import Tree

NO_DYNAMICS, INTEGRATOR, FILTER, FILTER_EXACT = range(4)  # MuJoCo's mjtDyn
FIXED, AFFINE = 0, 1  # MuJoCo's mjtGain; in mjtBias the same values mean none and affine
MIN_TIME_CONSTANT = 1e-15  # minimum time constant of a filter [s], MuJoCo's mjMINVAL

Control = Array | Sequence[float] | Mapping[str, float] | Callable[..., object] | None


class Actuators:
    """Torques of the actuators of an MJCF file, a function (t, q, v) -> tau.

    The force of an actuator is gain(length, rate) times its control, plus a bias that is affine in length and
    rate. Controls and forces are clamped to their ranges, as is the sum of the forces on a joint or a tendon.
    An actuator with an activation filters or integrates its control, starting with a given activation at t =
    0.

    Args:
        tree: compiled model and its tree.
        supported: index and transmission of each supported actuator.
        compensation: generalized force of gravity compensation that acts through the drives of joints, (t, q,
            v) -> (nv,), or None.
        clamp: whether controls are clamped to their ranges.

    Attributes:
        names: names of the controls.
        ctrl: controls, (nu,), or a function (t, q, v) -> (nu,).
        act: activations at t = 0, (na,).
    """

    def __init__(
        self,
        tree: Tree,
        supported: list[tuple[int, Transmission]],
        compensation: Callable[[float, Array, Array], Array] | None,
        clamp: bool,
    ) -> None:
        m = self._m = tree.compiled
        self._indices = np.array([i for i, _ in supported], dtype=int)
        self._transmissions = [transmission for _, transmission in supported]
        self._compensation, self._clamp = compensation, clamp
        self.names = _control_names(m)
        self.ctrl: Array | Callable[..., object] = np.zeros(m.nu)
        self.act = np.zeros(m.na)
        self._arms = np.zeros((len(supported), tree.model.nv))
        self._lengths = np.zeros((len(supported), tree.model.nq))
        self._curved = []
        for k, transmission in enumerate(self._transmissions):
            if isinstance(transmission, GearedLength) and isinstance(transmission.tendon, FixedTendon):
                self._arms[k] = transmission.gear * transmission.tendon.row
                self._lengths[k] = transmission.gear * transmission.tendon.coefficients
            else:
                self._curved.append(k)
        self._periods = [_period(m, i, t) for i, t in supported]
        joints = [j for j in range(m.njnt) if m.jnt_actfrclimited[j] and m.jnt_type[j] > 1]
        self._limited = np.array([m.jnt_dofadr[j] for j in joints], dtype=int)
        self._limits = np.array([m.jnt_actfrcrange[j] for j in joints]).reshape(-1, 2)

    def __call__(self, t: float, q: Array, v: Array) -> Array:
        """Return the torques of all actuators, (nv,) [N m or N].

        Args:
            t: time [s].
            q: configuration, (nq,).
            v: velocity, (nv,).
        """
        arms, lengths = self._arms, self._lengths @ q
        if self._curved:
            arms = arms.copy()
            for k in self._curved:
                lengths[k], arms[k] = self._transmissions[k].rows(q)
        tau = arms.T @ self.forces(t, q, v, lengths, arms @ v)
        if self._compensation is not None:
            tau += self._compensation(t, q, v)
        if self._limited.size:
            tau[self._limited] = np.clip(tau[self._limited], self._limits[:, 0], self._limits[:, 1])
        return np.asarray(tau)

    def forces(self, t: float, q: Array, v: Array, lengths: Array, rates: Array) -> Array:
        """Return the forces of the supported actuators from the lengths and rates of their transmissions.

        Args:
            t: time [s].
            q: configuration, (nq,).
            v: velocity, (nv,).
            lengths: lengths of the transmissions.
            rates: rates of the transmissions.
        """
        m, i = self._m, self._indices
        inputs = self._inputs(t, q, v)
        for k, period in enumerate(self._periods):
            if period:  # the nearest equivalent of the set angle
                inputs[k] -= period * round((inputs[k] - lengths[k]) / period)
        gain, bias = m.actuator_gainprm[i], m.actuator_biasprm[i]
        varying = m.actuator_gaintype[i] == AFFINE
        factor = gain[:, 0] + varying * (gain[:, 1] * lengths + gain[:, 2] * rates)
        passive = bias[:, 0] + bias[:, 1] * lengths + bias[:, 2] * rates
        force = factor * inputs + (m.actuator_biastype[i] == AFFINE) * passive
        self._limit_tendons(force)
        low, high = m.actuator_forcerange[i].T
        return np.asarray(np.where(m.actuator_forcelimited[i], np.clip(force, low, high), force))

    def _inputs(self, t: float, q: Array, v: Array) -> Array:
        """Return the input of each actuator: its control, or the resulting activation."""
        m = self._m
        ctrl = self.ctrl
        if callable(ctrl):
            value = ctrl(t, q, v)
            try:
                ctrl = np.array(value, dtype=float).reshape(m.nu)
            except (TypeError, ValueError):
                ctrl = np.full(m.nu, np.nan)
            if not np.isfinite(ctrl).all():
                raise InputError(f"ctrl must return {m.nu} finite numbers; got {short_repr(value)}")
        if self._clamp:
            low, high = m.actuator_ctrlrange.T
            ctrl = np.where(m.actuator_ctrllimited, np.clip(ctrl, low, high), ctrl)
        inputs = ctrl[m.actuator_ctrladr[self._indices]]
        for k, i in enumerate(self._indices):
            kind, start = m.actuator_dyntype[i], m.actuator_actadr[i]
            if kind == INTEGRATOR:
                inputs[k] = self.act[start] + inputs[k] * t
            elif kind in (FILTER, FILTER_EXACT):
                decay = math.exp(-t / max(MIN_TIME_CONSTANT, m.actuator_dynprm[i, 0]))
                inputs[k] += (self.act[start] - inputs[k]) * decay
            if kind != NO_DYNAMICS and m.actuator_actlimited[i]:
                inputs[k] = np.clip(inputs[k], *m.actuator_actrange[i])
        return np.asarray(inputs)

    def _limit_tendons(self, force: Array) -> None:
        """Scale the forces on a tendon if their sum exceeds its range."""
        m, i = self._m, self._indices
        on_tendon = m.actuator_trntype[i] == TENDON
        for tendon in np.flatnonzero(m.tendon_actfrclimited):
            on_this = on_tendon & (m.actuator_trnid[i, 0] == tendon)
            total = float(force[on_this].sum())
            if total:
                force[on_this] *= float(np.clip(total, *m.tendon_actfrcrange[tendon])) / total

    def set_control(self, ctrl: Control, act: Array | None = None) -> None:
        """Set the controls, and the activations at t = 0.

        Args:
            ctrl: numbers (nu,), a table by actuator name, a function (t, q, v) -> (nu,), or None for zeros.
            act: activations, (na,); None for zeros.

        Raises:
            InputError: a size is wrong, or a function is given for an actuator with an activation.
            UnknownNameError: no actuator has that name.
        """
        nu = len(self.names)
        self.act = np.zeros(self._m.na) if act is None else np.array(act)
        if callable(ctrl):
            filtering = [k for k in self._indices if self._m.actuator_dyntype[k] != NO_DYNAMICS]
            if filtering:
                who = ", ".join(f'"{self.names[self._m.actuator_ctrladr[k]]}"' for k in filtering[:4])
                raise InputError(
                    f"ctrl must be constant for actuators with an activation: {who}; pass numbers"
                )
            self.ctrl = ctrl
        elif isinstance(ctrl, Mapping):
            values = np.zeros(nu)
            for name, value in ctrl.items():
                if name not in self.names:
                    raise UnknownNameError(f'ctrl: no actuator "{name}"{nearest(str(name), self.names)}')
                values[self.names.index(name)] = number(f'ctrl of "{name}"', value)
            self.ctrl = values
        else:
            self.ctrl = np.zeros(nu) if ctrl is None else array("ctrl", ctrl, (nu,))


def _control_names(m: MjModel) -> list[str]:
    """Return the name of each control: its actuator's name, numbered if the actuator has several controls."""
    names = [""] * m.nu
    for a in range(m.nactuator):
        adr = m.name_actuatoradr[a]
        name = m.names[adr : m.names.index(b"\0", adr)].decode() or f"actuator_{a}"
        for k in range(m.actuator_ctrlnum[a]):
            names[m.actuator_ctrladr[a] + k] = name if k == 0 else f"{name}/{k}"
    return names


def _period(m: MjModel, actuator: int, transmission: Transmission) -> float:
    """Return the period of a servo's set angle for a ball joint or between sites, 0 for other actuators."""
    servo = (
        m.actuator_biastype[actuator] == AFFINE
        and m.actuator_gaintype[actuator] == FIXED
        and m.actuator_gainprm[actuator, 0] == -m.actuator_biasprm[actuator, 1]
        and m.actuator_dyntype[actuator] in (NO_DYNAMICS, INTEGRATOR)
    )
    if servo and isinstance(transmission, OnBall):
        return 2.0 * math.pi * float(np.linalg.norm(transmission.gear))
    if servo and isinstance(transmission, OnSite) and transmission.reference is not None:
        gear = transmission.gear
        return 0.0 if gear[:3].any() else 2.0 * math.pi * float(np.linalg.norm(gear[3:]))
    return 0.0


def can_produce_force(m: MjModel, actuator: int) -> bool:
    """Check if an actuator can produce a force.

    Args:
        m: mujoco.MjModel.
        actuator: index of the actuator.
    """
    group = int(m.actuator_group[actuator])
    if 0 <= group <= 30 and m.opt.disableactuator & (1 << group):
        return False
    plain = m.actuator_gaintype[actuator] <= AFFINE and m.actuator_biastype[actuator] <= AFFINE
    gains, biases = m.actuator_gainprm[actuator, :3], m.actuator_biasprm[actuator, :3]
    return not plain or bool(gains.any() or biases.any())


def is_supported(m: MjModel, actuator: int) -> bool:
    """Check if the force of an actuator depends on its control, length and rate only.

    Args:
        m: mujoco.MjModel.
        actuator: index of the actuator.
    """
    return bool(
        m.actuator_gaintype[actuator] <= AFFINE
        and m.actuator_biastype[actuator] <= AFFINE
        and m.actuator_dyntype[actuator] <= FILTER_EXACT
        and m.actuator_plugin[actuator] < 0
        and not m.actuator_delay[actuator]
        and m.actuator_ctrlnum[actuator] == 1
        and m.actuator_trntype[actuator] < BODY
    )
