"""Unsupported features of a compiled MJCF model: notes, and errors for active features."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from pin_nonideal.errors import LoadingError
from pin_nonideal.loading.urdf.xml import quote_names

from .actuators import can_produce_force, is_supported
from .equality import TENDON, equality_name
from .fields import is_listed
from .motion import Tendon
from .mujoco_types import Mujoco
from .shapes import colliding_pairs
from .tendons import tendon_name
from .transmissions import BODY
from .transmissions import TENDON as BY_TENDON
from .tree import GROUND, Tree, actuator_share

IGNORABLE_FEATURES = ("actuator", "flex", "fluid", "muscle", "plasticity", "plugin", "tendon")
MUSCLE = 2  # MuJoCo's mjtGain and mjtBias


class UnsupportedFeatures:
    """Collected unsupported features of a compiled model: notes, and errors for active features.

    Args:
        where: prefix of error messages.
        allow: active features that may be ignored, from `IGNORABLE_FEATURES`.
        notes: receives the notes.
    """

    def __init__(self, where: str, allow: Collection[str], notes: list[str]) -> None:
        self._where, self._allow, self.notes = where, allow, notes
        self._active: list[tuple[str, str]] = []

    def add_active(self, key: str, what: str) -> None:
        """Report an unsupported feature that affects the motion."""
        if key in self._allow:
            self.notes.append(f"left out, as allowed: {what}")
        else:
            self._active.append((key, what))

    def add_note(self, text: str) -> None:
        """Report a feature that does not affect the motion at present, or that differs in kind."""
        self.notes.append(text)

    def raise_if_active(self) -> None:
        """Raise an error if an active feature is unsupported.

        Raises:
            LoadingError: an active feature is unsupported; the message lists all of them.
        """
        if self._active:
            keys = tuple(dict.fromkeys(key for key, _ in self._active))
            what = "; ".join(dict.fromkeys(text for _, text in self._active))
            raise LoadingError(
                f"{self._where}: cannot be converted: {what}; remove it from the file, or leave it out with "
                f"load(..., allow={keys!r})"
            )


def report_unsupported(
    mujoco: Mujoco, tree: Tree, tendons: list[Tendon | None], unsupported: UnsupportedFeatures
) -> None:
    """Report all unsupported features of a compiled model.

    Args:
        mujoco: Python package.
        tree: compiled model and its tree.
        tendons: tendons from `read_tendons`.
        unsupported: receives the features.
    """
    _check_actuators(tree, tendons, unsupported)
    _check_tendons(tree, tendons, unsupported)
    _check_bodies(tree, unsupported)
    _check_equalities(tree, tendons, unsupported)
    _check_contacts(mujoco, tree, unsupported)
    _check_limits(tree, tendons, unsupported)
    _check_options(mujoco, tree, unsupported)


def _check_actuators(tree: Tree, tendons: list[Tendon | None], unsupported: UnsupportedFeatures) -> None:
    m = tree.compiled
    names = [
        m.names[adr : m.names.index(b"\0", adr)].decode() or f"actuator_{a}"
        for a, adr in enumerate(m.name_actuatoradr)
    ]
    working = [a for a in range(m.nactuator) if can_produce_force(m, a)]
    sticking = [names[a] for a in working if m.actuator_trntype[a] == BODY]
    if sticking:
        unsupported.add_note(
            f"adhesion actuators {quote_names(sticking)} act on contacts, which are not transferred"
        )
    muscles = [names[a] for a in working if MUSCLE in (m.actuator_gaintype[a], m.actuator_biastype[a])]
    if muscles:
        unsupported.add_active("muscle", f"muscles {quote_names(muscles)}")
    others = [
        names[a]
        for a in working
        if names[a] not in muscles and m.actuator_trntype[a] != BODY and not is_supported(m, a)
    ]
    if others:
        unsupported.add_active(
            "actuator", f"actuators with a controller, a delay or a special law {quote_names(others)}"
        )
    wrapped = [
        names[a]
        for a in working
        if m.actuator_trntype[a] == BY_TENDON
        and tendons[m.actuator_trnid[a, 0]] is None
        and names[a] not in muscles
    ]
    if wrapped:
        unsupported.add_active("tendon", f"actuators on tendons that wrap {quote_names(wrapped)}")
    early = [names[a] for a in working if m.actuator_actearly[a] and m.actuator_dyntype[a]]
    if early:
        unsupported.add_note(
            f"actearly of {quote_names(early)} shifts activations by MuJoCo's time step, and is left out"
        )


def _check_tendons(tree: Tree, tendons: list[Tendon | None], unsupported: UnsupportedFeatures) -> None:
    m = tree.compiled
    names = [tendon_name(tree, i) for i in range(m.ntendon)]
    moving = (
        (m.tendon_stiffness != 0.0)
        | m.tendon_stiffnesspoly.any(axis=1)
        | (m.tendon_damping != 0.0)
        | m.tendon_dampingpoly.any(axis=1)
        | (m.tendon_frictionloss > 0.0)
    )
    wrapping = [i for i, tendon in enumerate(tendons) if tendon is None]
    active = [names[i] for i in wrapping if moving[i]]
    idle = [names[i] for i in wrapping if not moving[i]]
    if active:
        unsupported.add_active(
            "tendon", f"springs, damping or friction of tendons that wrap {quote_names(active)}"
        )
    if idle:
        unsupported.add_note(f"tendons that wrap around geoms are left out: {quote_names(idle)}")
    inertia = m.tendon_armature + actuator_share(m, m.actuator_armature[:, None], joints=False)[:, 0]
    heavy = [names[i] for i in np.flatnonzero(inertia)]
    if heavy:
        unsupported.add_active(
            "tendon",
            f"armature of tendons {quote_names(heavy)}, which the mass matrix of a tree cannot contain",
        )
    plastic = [names[i] for i in range(m.ntendon) if m.tendon_plasticadr[i] >= 0]
    plastic += [tree.joint_name(j) for j in range(m.njnt) if m.jnt_plasticadr[j] >= 0]
    if plastic:
        unsupported.add_active("plasticity", f"springs that yield {quote_names(plastic)}")


def _check_bodies(tree: Tree, unsupported: UnsupportedFeatures) -> None:
    m = tree.compiled
    if m.nmocap:
        names = [tree.body_names[b] for b in np.flatnonzero(m.body_mocapid >= 0)]
        unsupported.add_note(f"mocap bodies {quote_names(names)} are held where they start")
    elliptic = np.unique(m.geom_bodyid[m.geom_fluid[:, 0] > 0.0])
    if elliptic.size:
        still = "because their bodies do not move"
        if not (m.opt.density or m.opt.viscosity):
            still = "because density and viscosity are zero"
        what = f"fluid forces on ellipsoids of bodies {quote_names([tree.body_names[b] for b in elliptic])}"
        moving = any(tree.bodies[b][0] for b in elliptic)
        if moving and (m.opt.density or m.opt.viscosity):
            unsupported.add_active("fluid", what)
        else:
            unsupported.add_note(f"{what} do not act, {still}")
    if m.nflex:
        soft = ~m.flex_rigid.astype(bool) & (m.flex_edgeequality == 0)
        stiff = (m.flex_edgestiffness != 0) | (m.flex_edgedamping != 0) | (m.flex_damping != 0)
        if (soft & stiff).any() or m.nflexstiffness or m.nflexbending or m.nefm0dof:
            unsupported.add_active("flex", f"elasticity of {m.nflex} flexes")
        else:
            unsupported.add_note("flexes have no effect: their contacts are not transferred")
    if (m.body_plugin >= 0).any() or (m.actuator_plugin >= 0).any():
        unsupported.add_active("plugin", "forces of plugins")
    elif m.nplugin:
        unsupported.add_note("plugins of shapes and sensors are not read")


def _check_equalities(tree: Tree, tendons: list[Tendon | None], unsupported: UnsupportedFeatures) -> None:
    m, soft = tree.compiled, []
    for i in range(m.neq):
        name, kind = equality_name(tree, i), int(m.eq_type[i])
        if not m.eq_active0[i]:
            unsupported.add_note(f'equality "{name}" is inactive in the MJCF file and left out')
        elif kind > TENDON:
            unsupported.add_active("flex", f'equality "{name}" of a flex')
        elif kind == TENDON and any(tendons[k] is None for k in (m.eq_obj1id[i], m.eq_obj2id[i]) if k >= 0):
            unsupported.add_active("tendon", f'equality "{name}" of tendons that wrap')
        elif not np.allclose(m.eq_solref[i], (0.02, 1.0)) or not np.allclose(
            m.eq_solimp[i], (0.9, 0.95, 0.001, 0.5, 2.0)
        ):
            soft.append(name)
    if soft:
        unsupported.add_note(
            f"solref and solimp of {', '.join(soft)} are not used: constraints are exact here, not soft"
        )


def _check_contacts(mujoco: Mujoco, tree: Tree, unsupported: UnsupportedFeatures) -> None:
    m, off = tree.compiled, mujoco.mjtDisableBit
    if m.opt.disableflags & (off.mjDSBL_CONTACT | off.mjDSBL_CONSTRAINT):
        return
    pairs = len(colliding_pairs(mujoco, m, range(m.ngeom)))
    if pairs:
        extras = [
            word
            for word, flag in (("adhesion", m.flg_adhesion), ("surface velocity", m.flg_surfacevel))
            if flag
        ]
        more = f", nor is their {' and '.join(extras)}" if extras else ""
        unsupported.add_note(
            f"contacts between geoms ({pairs} pairs) are not transferred{more}: bodies pass through each "
            "other; add the needed contacts as GeometryContact or PointContact; scene.contact_friction holds "
            "the coefficients of the file"
        )


def _check_limits(tree: Tree, tendons: list[Tendon | None], unsupported: UnsupportedFeatures) -> None:
    limited = np.flatnonzero(tree.compiled.tendon_limited).tolist()
    wrapping = [tendon_name(tree, i) for i in limited if tendons[i] is None]
    if wrapping:
        unsupported.add_note(
            f"ranges of tendons that wrap around geoms are left out: {quote_names(wrapping)}"
        )


def _check_options(mujoco: Mujoco, tree: Tree, unsupported: UnsupportedFeatures) -> None:
    m = tree.compiled
    if m.opt.enableflags & mujoco.mjtEnableBit.mjENBL_SLEEP:
        unsupported.add_note("bodies do not sleep here, and the sleep flag of the file is not used")
    renamed = [j for j in range(m.njnt) if m.joint(j).name == GROUND]
    if renamed:
        unsupported.add_note(
            f'joint "{GROUND}" has the name "{tree.joint_name(renamed[0])}" here, since its name is reserved'
        )
    if m.nsensor:
        unsupported.add_note(f"sensors ({m.nsensor}) are not read")
    floating = [
        tree.joint_name(j)
        for j in range(m.njnt)
        if m.jnt_type[j] == 0 and tree.model.armature[m.jnt_dofadr[j]]
    ]
    if floating:
        unsupported.add_note(
            f"armature of free joints {quote_names(floating)}: MuJoCo gives it no Coriolis force along the "
            "world's axes; a given force reproduces this here"
        )
    unknown = [
        f for f in dir(m) if not f.startswith("_") and not callable(getattr(m, f)) and not is_listed(f)
    ]
    if unknown:
        unsupported.add_note(
            f"this version of MuJoCo ({mujoco.__version__}) has unknown fields, which may affect the "
            "motion: " + ", ".join(unknown)
        )
