"""Eq. (40) in the core with redundant rows, laws and sticking elements, against the paper on arrays."""

from __future__ import annotations

import numpy as np
import pytest

import pin_nonideal as pn
from oracles.differences import consistent, rows_at
from oracles.solutions import KKT, assert_solves_its_rows

from ...support.random_trees import attach, place_of, three_trees
from ...support.row_cases import TREES, parallel_cranks
from ...support.small_robots import DATA


def anchored(rng, *, others=(), laws=(), **keywords):
    """Return three trees with a point anchor between two of them."""
    model, q = three_trees(rng)
    attach(model, "meet", model.getJointId("b2"), q, place_of(model, q, "a3 tip"))
    loop = pn.PointAnchor("a3 tip", "meet", name="loop")
    return pn.Scene(model, constraints=[loop, *others], laws=laws, q0=q, **keywords)


def combination(scene, weights):
    """Return a user constraint whose rows are combinations of the scene's rows."""
    runner, weights = scene._compiled.program.runner(), np.asarray(weights)

    def pick(part):
        return lambda t, q, v, *_: weights @ rows_at(scene, runner, q, v, t)[part]

    return pn.UserConstraint(
        lambda t, q, v, data: (pick(0)(t, q, v), pick(1)(t, q, v)),
        len(weights),
        residual=lambda t, q: pick(2)(t, q, np.zeros(scene.model.nv)),
        rate=pick(3),
        name="combination",
    )


@pytest.mark.parametrize("name", ["robot_delta", pytest.param("digit_like", marks=pytest.mark.slow)])
def test_closures_of_robots_from_the_community(name):
    """Overconstrained '6d' closures, and masses whose matrix has a condition beyond 1e7."""
    rng = np.random.default_rng(1)
    scene = pn.load(DATA / name)
    q, v = scene.initial_state()
    v = scene.project(q, 0.1 * rng.standard_normal(scene.model.nv))[1]
    raw = assert_solves_its_rows(scene, q, v, 0.0)
    assert raw.rank == len(raw.lam) - len(scene.dropped)


def test_three_parallel_cranks():
    """A bar on three equal cranks has redundant rows on the constraints only."""
    scene = parallel_cranks()
    raw = assert_solves_its_rows(scene, *scene.initial_state(), 0.0)
    assert (raw.rank, len(raw.lam), scene.dropped) == (3, 4, [])


def test_rows_that_combine_others():
    rng = np.random.default_rng(2)
    plain = anchored(rng)
    weights = rng.standard_normal((2, 3))
    doubled = anchored(np.random.default_rng(2), others=[combination(plain, weights)])
    assert not doubled.dropped
    q, v = consistent(plain, rng, 0.0)
    raw = assert_solves_its_rows(doubled, q, v, 0.0)
    assert raw.rank == 3
    expected = assert_solves_its_rows(plain, q, v, 0.0)
    np.testing.assert_allclose(raw.a, expected.a, rtol=0, atol=KKT * np.abs(expected.a).max())
    # The load has minimum norm: lam = [I W^T]^+ lam_plain.
    share = np.linalg.pinv(np.hstack([np.eye(3), weights.T])) @ expected.lam
    np.testing.assert_allclose(raw.lam, share, rtol=0, atol=1e-9 * np.abs(share).max())


LAWS = {
    "viscous": [pn.JointFriction("a1", viscous=0.4)],
    "constant": [pn.JointFriction("a1", coulomb=0.3), pn.JointFriction("c3", coulomb=0.2)],
    "load, total": [pn.JointFriction("a1", mu=0.2, radius=0.03), pn.JointFriction("b2", mu=0.1, radius=0.02)],
    "load, ideal": [pn.JointFriction("a1", mu=0.2, radius=0.03, reaction="ideal")],
    "drag": [pn.Drag("b2 tip", 0.7, 2.0)],
    "user": [pn.UserLaw(lambda t, q, v, r: -0.1 * v * np.abs(r["loop"]).sum())],
    "several": [
        pn.JointFriction("a1", mu=0.2, radius=0.03, viscous=0.1),
        pn.JointFriction("c3", mu=0.1, coulomb=0.1, reaction="ideal"),
        pn.Drag("a3 tip", 0.3),
        pn.UserLaw(lambda t, q, v, r: -0.2 * v, reaction=None),
    ],
}


@pytest.mark.parametrize("kind", LAWS)
def test_laws(kind):
    rng = np.random.default_rng(3)
    scene = anchored(rng, laws=LAWS[kind])
    q, v = consistent(scene, rng, 0.0)
    raw = assert_solves_its_rows(scene, q, v, 0.0)
    assert np.abs(raw.F_nonideal).max() > 0.0
    assert v @ raw.C < 0.0


@pytest.mark.parametrize("kind", ["constant", "load, total", "load, ideal", "several"])
def test_prescribed_modes_and_sticking(kind):
    rng = np.random.default_rng(4)
    scene = anchored(rng, laws=LAWS[kind])
    stuck = [law.joint for law in LAWS[kind] if isinstance(law, pn.JointFriction)]
    q, v = consistent(scene, rng, 0.0)
    dofs = [scene.model.joints[scene.model.getJointId(j)].idx_v for j in stuck]
    v[dofs] = 0.0
    hold = combination_of_dofs(scene.model.nv, dofs)
    both = anchored(np.random.default_rng(4), others=[hold])
    q, v = both.project(q, v)
    raw = assert_solves_its_rows(scene, q, v, 0.0, modes=[0] * len(stuck))
    np.testing.assert_array_equal(raw.a[dofs], 0.0)
    # Sticking directions as ideal constraints give the same motion, with friction forces as multipliers.
    smooth = [law for law in LAWS[kind] if not isinstance(law, pn.JointFriction)]
    grease = [law for law in LAWS[kind] if getattr(law, "viscous", 0.0)]
    smooth += [pn.JointFriction(law.joint, viscous=law.viscous) for law in grease]
    oracle = pn.Scene(scene.model, constraints=both.constraints, q0=both.q0, laws=smooth)
    expected = oracle.solve(q, v)
    np.testing.assert_allclose(raw.a, expected.a, rtol=0, atol=KKT * np.abs(expected.a).max())
    force = [float(f[0]) for f in raw.friction]
    held = expected.lam[oracle.constraint_slices["hold"]]
    np.testing.assert_allclose(force, held, rtol=0, atol=1e-8 * np.abs(held).max())


def combination_of_dofs(nv, dofs):
    A = np.eye(nv)[dofs]
    return pn.UserConstraint(
        lambda t, q, v, data: (A, np.zeros(len(dofs))), len(dofs), rate=lambda t, q, v: A @ v, name="hold"
    )


def test_contact_friction_slides_against_the_slip():
    rng = np.random.default_rng(5)
    for kind in ("point on a moving plane", "ball on a moving plane", "ball on the ground"):
        bare = TREES[kind](np.random.default_rng(6))
        (contact,) = bare.contacts
        rough = pn.Scene(
            bare.model,
            contacts=[
                type(contact)(
                    contact.frame, mu=0.5, plane=contact.plane, radius=contact.radius, unilateral=False
                )
            ],
            q0=bare.q0,
        )
        q, v = consistent(rough, rng, 0.0)
        raw = assert_solves_its_rows(rough, q, v, 0.0)
        slides = np.linalg.norm(raw.friction[0])
        assert slides == pytest.approx(0.5 * abs(raw.lam[0]), rel=1e-9)
        assert v @ raw.C < 0.0
