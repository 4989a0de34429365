"""TrackTrajectory: a drive that follows a reference given by samples."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from pin_nonideal.compilation.actuation import command_mask, gains_of
from pin_nonideal.description.actuation import (
    Gain,
    checked_gain,
    checked_samples,
    sample_times,
)
from pin_nonideal.description.scene_drive import BoundDrive, SceneDrive
from pin_nonideal.description.scene_spec import SceneSpec
from pin_nonideal.errors import InputError
from pin_nonideal.states.joint_layout import joint_places
from pin_nonideal.states.parsing import find_joint, named_configuration_samples, named_joint_samples
from pin_nonideal.states.reference_motion import TIME_ROUNDING, ReferenceMotion, break_times
from pin_nonideal.types import Array, Model, Table
from pin_nonideal.validation import by_name, choice, label, optional_text, positive, sequence, text

from .closed_reference import ClosedReference, without_drives

Mask = NDArray[np.bool_]
Samples = Sequence[Sequence[float]] | NDArray[np.float64] | Mapping[str, ArrayLike]
FEEDFORWARDS = ("none", "gravity", "rnea", "constrained")


@dataclass(frozen=True, eq=False)
class TrackTrajectory(SceneDrive):
    """Proportional-derivative control along a reference: tau = kp (q_r - q) + kd (v_r - v) + feedforward.

    The difference q_r - q is computed in the tangent space (pinocchio.difference). v_r - v is the difference
    of the components of both velocities. The reference passes through the samples: q_r is a cubic in
    tangent coordinates between two samples, v_r and a_r are its derivatives. Before the first and after the
    last sample, the reference rests at the end of the samples: v_r = a_r = 0. Steps end at the first and the
    last sample. Steps end at all samples if v is given, or if the configurations of a joint are not vectors.

    The drive commands the joints of `joints`. If `joints` is None, the drive commands the joints that q
    names. If q is an array, the drive commands the joints that kp or kd name. A number acts on joints with
    one degree of freedom, and an array on joints with a gain. Other joints have no torque.

    The feedforward is one of

    - "none": no torque.
    - "gravity": torques that hold the reference q_r against gravity.
    - "rnea": torques of the reference without constraints, M(q_r) a_r + b(q_r, v_r). Joints that q does not
      name enter "gravity" and "rnea" with their present position and velocity, and without acceleration.
    - "constrained": torques by which the driven joints move the mechanism along the reference, by
      `inverse_dynamics` with the constraints, laws and forces of the scene, without its contacts. The
      reference is put onto the constraints: it keeps as many coordinates as the constraints leave free,
      driven ones first. The other coordinates follow, also those of joints that q does not name. Given
      coordinates beyond this number must agree with the constraints: q up to 1e-3 rad, or 1e-3 of the
      scene's length, and v up to a tenth of the largest given velocity. Otherwise `simulate` raises an
      InputError before its first step. The constraints must hold positions. Forces that the driven joints
      cannot supply are left out in the sense of least squares.

    Args:
        times: increasing times [s], shape (nt,) with nt >= 1.
        q: reference configurations, shape (nt, nq) in Pinocchio's order, or by joint name, shape (nt,) or
            (nt, n) for the n values of a joint: a dict, a pandas DataFrame or a structured array. An angle
            [rad] may replace the (cos, sin) of a joint. Joints that a table leaves out are not driven.
        v: reference velocities, shape (nt, nv), or by joint name for the same joints as q. None for the rates
            of a cubic spline through the samples.
        kp: stiffness [N m/rad or N/m], not negative: a number for joints with one degree of freedom, an array
            of shape (nv,), or by joint name, zero for missing joints.
        kd: damping [N m s/rad or N s/m], not negative, as kp.
        feedforward: "none", "gravity", "rnea" or "constrained".
        period: sample period [s]. The torque is held between samples, and steps end at every sample, as with
            `SampledControl`. None for a continuous torque.
        joints: names of the driven joints, see above.
        name: used in messages and results.
    """

    times: Sequence[float] | NDArray[np.float64]
    q: Samples
    v: Samples | None = None
    _: KW_ONLY
    kp: Gain
    kd: Gain
    feedforward: str = "none"
    period: float | None = None
    joints: Sequence[str] | None = None
    name: str | None = None

    def __post_init__(self) -> None:
        optional_text("TrackTrajectory: name", self.name)
        who = label(self)
        times = sample_times(who, self.times)
        checked: Table = {"times": times, "q": checked_samples(f"{who}: q", self.q, times.size)}
        if self.v is not None:
            checked["v"] = checked_samples(f"{who}: v", self.v, times.size)
            _require_same_joints(who, checked["q"], checked["v"])
        checked |= {key: checked_gain(f"{who}: {key}", getattr(self, key)) for key in ("kp", "kd")}
        choice(f"{who}: feedforward", self.feedforward, FEEDFORWARDS)
        if self.period is not None:
            checked["period"] = positive(f"{who}: period", self.period)
        if self.joints is not None:
            names = sequence(f"{who}: joints", self.joints)
            checked["joints"] = tuple(text(f"{who}: joints", name) for name in names)
        for key, value in checked.items():
            object.__setattr__(self, key, value)

    def bound(self, model: Model, q0: Array, spec: SceneSpec) -> BoundDrive:
        """Return the torques of the drive in a scene.

        Args:
            model: pinocchio.Model of the scene.
            q0: initial configuration of the scene, (nq,).
            spec: descriptions of the scene.

        Raises:
            InputError, UnknownNameError: the drive does not fit the model.
        """
        who = label(self)
        times = np.asarray(self.times)
        q = named_configuration_samples(model, self.q, q0, times.size, f"{who}: q")
        v = None if self.v is None else named_joint_samples(model, self.v, times.size, f"{who}: v")
        stated = _named(model, self.q, f"{who}: q")
        gains = [gains_of(model, getattr(self, key), f"{who}: {key}") for key in ("kp", "kd")]
        driven = self._driven(model, stated, gains, who)
        kp, kd = (np.where(driven, gain, 0.0) for gain in gains)
        breaks = break_times(model, times, v is not None)
        rounding = 0.0 if self.period is None else TIME_ROUNDING  # continuous torques jump at breaks
        if self.feedforward != "constrained":
            motion = ReferenceMotion(model, times, q, v, rounding)
            tracking = _Tracking(model, motion, stated, driven, kp, kd, self.feedforward)
            return BoundDrive(tracking, driven, breaks)
        compiled = without_drives(model, q0, spec, who)

        def reference() -> ClosedReference:
            return ClosedReference(compiled, times, q, v, stated, driven, who, rounding)

        constrained = _ConstrainedTracking(model, reference, kp, kd)
        return BoundDrive(constrained, driven, breaks, constrained.prepare)

    def _driven(self, model: Model, stated: Mask, gains: Sequence[Array], who: str) -> Mask:
        """Return the mask of the degrees of freedom that are driven, (nv,).

        Raises:
            InputError: no joint is driven, or a driven joint has no reference.
        """
        if self.joints is not None:
            driven = _named(model, dict.fromkeys(self.joints), f"{who}: joints")
        elif by_name(self.q) is not None:
            driven = stated.copy()
        else:
            driven = np.zeros(model.nv, dtype=bool)
            for gain, values in zip((self.kp, self.kd), gains, strict=True):
                is_array = isinstance(gain, np.ndarray)
                driven |= _with_gain(model, values) if is_array else command_mask(model, gain)
        if not driven.any():
            raise InputError(
                f"{who}: at least one joint must be driven; got none with a gain; name the driven joints in "
                "joints"
            )
        _require_among(model, driven, stated, f"{who}: joints", "the joints of q")
        for key in ("kp", "kd"):
            if by_name(getattr(self, key)) is not None:
                named = _named(model, getattr(self, key), f"{who}: {key}")
                _require_among(model, named, driven, f"{who}: {key}", "the driven joints")
        return driven


def _require_same_joints(who: str, q: object, v: Any) -> None:
    """Check that v has the form of q, and names the same joints.

    Raises:
        InputError: see above.
    """
    if isinstance(q, dict) != isinstance(v, dict):
        form = "by joint name" if isinstance(q, dict) else "an array"
        raise InputError(f"{who}: v must have the form of q, {form}")
    if isinstance(q, dict) and (different := sorted(map(str, q.keys() ^ v.keys()))):
        raise InputError(
            f'{who}: v must name the same joints as q; "{different[0]}" is in one of them only; give it in '
            "both, or leave v out"
        )


def _require_among(model: Model, named: Mask, allowed: Mask, what: str, where: str) -> None:
    """Check that all named joints are among others.

    Raises:
        InputError: see above.
    """
    for place in joint_places(model):
        if named[place.v_first] and not allowed[place.v_first]:
            raise InputError(
                f'{what} must name joints among {where}; got "{place.name}"; add it there, or leave it out'
            )


def _named(model: Model, samples: object, who: str) -> Mask:
    """Return the mask of the degrees of freedom of named joints, (nv,); an array names all joints."""
    table = by_name(samples)
    mask = np.full(model.nv, table is None)
    for name in table or ():
        j = find_joint(model, name, who)
        mask[model.idx_vs[j] : model.idx_vs[j] + model.nvs[j]] = True
    return mask


def _with_gain(model: Model, gain: Array) -> Mask:
    """Return the mask of the degrees of freedom of joints with a nonzero gain, (nv,)."""
    mask = np.zeros(model.nv, dtype=bool)
    for place in joint_places(model):
        dofs = slice(place.v_first, place.v_first + place.nv)
        mask[dofs] = (gain[dofs] != 0.0).any()
    return mask


class _Tracking:
    """Torques along a reference, with a feedforward from the tree without its constraints.

    Args:
        model: pinocchio.Model.
        reference: function of time that returns q, v and a.
        stated: mask of the coordinates of the reference, (nv,).
        driven: mask of the driven degrees of freedom, (nv,).
        kp: stiffness, (nv,).
        kd: damping, (nv,).
        feedforward: "none", "gravity" or "rnea".
    """

    def __init__(
        self,
        model: Model,
        reference: ReferenceMotion,
        stated: Mask,
        driven: Mask,
        kp: Array,
        kd: Array,
        feedforward: str,
    ) -> None:
        self._model, self._reference, self._driven = model, reference, driven
        self._kp, self._kd, self._feedforward = kp, kd, feedforward
        self._present = [
            (slice(p.q_first, p.q_first + p.nq), slice(p.v_first, p.v_first + p.nv))
            for p in joint_places(model)
            if not stated[p.v_first : p.v_first + p.nv].any()
        ]

    def __call__(self, t: float, q: Array, v: Array) -> Array:
        """Return the torques, (nv,)."""
        model = self._model
        q_r, v_r, a_r = self._reference(t)
        tau = self._kp * pin.difference(model, q, q_r) + self._kd * (v_r - v)
        if self._feedforward == "none":
            return np.asarray(tau)
        if self._present:
            q_r, v_r = np.array(q_r), np.array(v_r)
            for of_q, of_v in self._present:
                q_r[of_q], v_r[of_v] = q[of_q], v[of_v]
        data = model.createData()  # runs of a rollout call this function from several threads
        if self._feedforward == "gravity":
            forces = pin.computeGeneralizedGravity(model, data, q_r)
        else:
            forces = pin.rnea(model, data, q_r, v_r, a_r)
        return np.where(self._driven, tau + forces, 0.0)


class _ConstrainedTracking:
    """Torques along a reference on the constraints, with the feedforward of inverse dynamics.

    Args:
        model: pinocchio.Model.
        make: function that returns the reference. The function is called before a run or at the first torque,
            since functions of users are called in runs only.
        kp: stiffness, (nv,).
        kd: damping, (nv,).
    """

    def __init__(self, model: Model, make: Callable[[], ClosedReference], kp: Array, kd: Array) -> None:
        self._model, self._make, self._kp, self._kd = model, make, kp, kd
        self._reference: ClosedReference | None = None
        self._last: tuple[float, Array, Array, Array] | None = None

    def prepare(self) -> ClosedReference:
        """Return the reference on the constraints, computed once.

        Raises:
            InputError: the reference does not fit the constraints.
        """
        if self._reference is None:
            self._reference = self._make()
        return self._reference

    def __call__(self, t: float, q: Array, v: Array) -> Array:
        """Return the torques, (nv,)."""
        last = self._last
        if last is None or last[0] != t:
            reference = self.prepare()
            q_r, v_r, a_r = reference(t)
            self._last = last = t, q_r, v_r, reference.torques(q_r, v_r, a_r, t)
        _, q_r, v_r, forces = last
        return np.asarray(self._kp * pin.difference(self._model, q, q_r) + self._kd * (v_r - v) + forces)
