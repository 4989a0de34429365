"""rest: feasibility of rest of a configuration under dry friction and contacts, with its margin."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial

import numpy as np

from pin_nonideal.compilation.compiled_scene import CompiledScene
from pin_nonideal.compilation.contact_groups import contact_names
from pin_nonideal.html_tables import NAMES_MAX, numbers, table
from pin_nonideal.scene.scene import Scene, compiled_scene, require_scene
from pin_nonideal.states.parsing import named_velocity
from pin_nonideal.trajectory.contact_points import slip_axes
from pin_nonideal.types import Array, Model, State, Table
from pin_nonideal.validation import number

from .cone_program import FACTOR_TOL
from .holding import HoldingTorque, holding_torques
from .limit_cones import LimitCones
from .residual import AtRest

MAX_NAMED = 4  # maximum number of names in a reason


@dataclass(frozen=True, eq=False)
class Rest:
    """Feasibility of rest of a configuration, with its margin and forces.

    Attributes:
        rests: whether forces within all limits balance the configuration.
        margin: 1 minus the smallest common factor of all friction limits for which forces balance. The margin
            is 1 if no friction is needed, 0 if friction just suffices, negative if larger limits are needed,
            and -inf if no friction suffices.
        friction: force of each friction element by name, along its slip directions, for the smallest factor
            [N or N m]; empty if no friction suffices. The friction of a pair of shapes is the sum of the
            forces at its points, along the slip directions of the first loaded point.
        lam: multipliers of all rows with this friction; contacts press, (m,).
        reason: reason why the scene does not rest, with the names of joints, friction elements or contacts
            that cannot hold; empty if it rests.
    """

    rests: bool
    margin: float
    friction: dict[str, Array]
    lam: Array
    reason: str = ""
    _holding: Callable[[], dict[str, HoldingTorque]] = field(default=dict, repr=False)

    @cached_property
    def holding(self) -> dict[str, HoldingTorque]:
        """Torques that friction holds and torques of slow motion, by joint name, computed on first access.

        The table has the joints of one degree of freedom on which a law of dry friction acts. The other
        joints keep their torques. The torque of a joint is the whole torque of its drive, including the
        torque of the scene's actuation.
        """
        return self._holding()

    def _repr_html_(self) -> str:
        shown = list(self.friction.items())[:NAMES_MAX]
        rows: list[tuple[str, object]] = [("rests", self.rests), ("margin", f"{self.margin:.6g}")]
        rows += [("reason", self.reason)] if self.reason else []
        rows += [(f"friction of {name}", numbers(np.asarray(force))) for name, force in shown]
        if len(self.friction) > len(shown):
            rows.append(("friction", f"of {len(self.friction) - len(shown)} more elements"))
        return table("Rest", [*rows, ("lam", numbers(self.lam))] if self.lam.size else rows)

    def __getstate__(self) -> Table:
        return {**vars(self), "holding": self.holding, "_holding": dict}


def rest(scene: Scene, q: State | None = None, tau: State | None = None, *, t: float = 0.0) -> Rest:
    """Check if friction and contact forces can hold a scene at rest, and compute the margin.

    The unknowns are multipliers lam, friction forces f and the smallest factor k of the static limits. The
    unknowns satisfy F + A^T lam + D^T f = 0 and |f_e| <= k limit_e for each friction element e. Contacts
    press: lam >= 0, and lam = 0 for open contacts. Limits of contacts depend on the unknown lam.
    Load-dependent limits of joints are computed from the reactions of the sticking scene, with least norm if
    they are not unique. Newton's method finds k; each step is one second-order cone program, solved by
    Clarabel.

    Args:
        scene: the scene.
        q: configuration, (nq,) or by joint name; None for the scene's closed initial configuration.
        tau: torques that replace the scene's actuation, (nv,) or by joint name.
        t: time at which actuation and constraints are evaluated [s].

    Returns:
        The Rest.

    Raises:
        InputError: an argument does not fit.
        FrictionConvergenceError: the solver found neither forces nor a proof that there are none.
    """
    require_scene("rest", scene)
    compiled, still = compiled_scene(scene), np.zeros(scene.model.nv)
    torque = None if tau is None else named_velocity(scene.model, tau, still, "rest: tau")
    time = number("rest: t", t)
    at = scene.project(q, still, time)[0]
    at_rest = AtRest(compiled, torque, time, at)
    drives = at_rest.forces(at) - at_rest.undriven(at)
    cones = LimitCones(at_rest, at)
    factor = cones.min_factor()
    holding = partial(holding_torques, compiled, at, drives, time, at_rest.open)
    if np.isinf(factor):
        reason = _unheld(at_rest, at, cones)
        rows = len(compiled.multipliers.groups.names)
        return Rest(False, -np.inf, {}, np.zeros(rows), reason, holding)
    forces = cones.forces(factor)
    friction = {
        name: _resultant(compiled, at, time, [forces[part] for part in cones.parts[own]], own)
        for name, own in compiled.elements.slices().items()
    }
    margin = 1.0 - factor
    rests = margin >= -10.0 * FACTOR_TOL
    reason = "" if rests else _elements_at_limit(compiled, cones, factor)
    lam = compiled.multipliers.groups.sum(forces[: cones.rows])
    return Rest(rests, margin, friction, lam, reason, holding)


def _resultant(compiled: CompiledScene, q: Array, t: float, forces: list[Array], own: slice) -> Array:
    """Return the sum of the friction forces of a contact, along the axes of its first loaded point."""
    loaded = [k for k, force in enumerate(forces) if force.any()]
    if len(loaded) < 2:
        return forces[loaded[0] if loaded else 0]
    axes = slip_axes(compiled, q, t, [own.start + k for k in loaded])
    force = np.einsum("ki,kij->j", [forces[k] for k in loaded], axes)
    return np.asarray(axes[0] @ force)


def _elements_at_limit(compiled: CompiledScene, cones: LimitCones, factor: float) -> str:
    """Return the elements at their limits where friction needs larger limits."""
    elements = compiled.element_names
    names = contact_names((elements[e] for e in cones.at_limits(factor)), compiled.contact_of)
    where = f"; at their limits: {_quote(names)}" if names else ""
    return f"dry friction needs {factor:.4g} times its limits{where}"


def _unheld(at_rest: AtRest, q: Array, cones: LimitCones) -> str:
    """Return the joint, the contacts or the elements that cannot hold for any friction limits."""
    compiled = at_rest.compiled
    if not cones.holds:
        force, way = at_rest.forces(q), cones.unheld
        shares = force * way
        dof = int(np.abs(shares).argmax())
        at_joint = float(force @ way) / float(way[dof])
        return (
            f'nothing holds the motion of joint "{_joint_of(compiled.model, dof)}": {at_joint:.4g} (N or N m)'
            " is left on it, and no constraint, contact or friction acts along this motion"
        )
    pulls, missing_friction = cones.missing()
    points = {rows.start: name for name, rows in compiled.slices.items()}
    parts = []
    if pulls:
        largest = max(pulls.values())
        parts.append(
            f"contacts would have to pull, with up to {largest:.4g} N: "
            + _quote(contact_names((points[k] for k in pulls), compiled.contact_of))
        )
    if missing_friction:
        elements = compiled.element_names
        names = _quote(contact_names((elements[e] for e in missing_friction), compiled.contact_of))
        largest = max(missing_friction.values())
        parts.append(f"friction without a load would have to hold up to {largest:.4g} (N or N m): {names}")
    return "; ".join(parts) or "no forces balance the scene"


def _joint_of(model: Model, dof: int) -> str:
    """Return the name of the joint to which a degree of freedom belongs."""
    joints = range(1, model.njoints)
    return next(str(model.names[j]) for j in joints if 0 <= dof - int(model.idx_vs[j]) < int(model.nvs[j]))


def _quote(names: list[str]) -> str:
    shown = ", ".join(f'"{name}"' for name in names[:MAX_NAMED])
    return shown + (", ..." if len(names) > MAX_NAMED else "")
