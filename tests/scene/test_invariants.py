"""Laws of mechanics that every robot of the package obeys, at its start and at random consistent states."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from oracles.differences import consistent, rows_at
from pin_nonideal.states.rows import holonomic_rows

from ..support.mechanisms import again
from ..support.random_trees import state, tree
from ..support.row_cases import ROBOTS, kept

# Sums of a few dozen products of forces and displacements.
ROUNDING = 1e-11
# Error of conserved quantities: several hundred steps at this tolerance.
RUN = {"rtol": 1e-10, "atol": 1e-11}
KEPT = 1e-8


@pytest.fixture(
    scope="module", params=[(name, terms) for terms in ("core", "pinocchio") for name in ROBOTS], ids="-".join
)
def robot(request):
    name, terms = request.param
    scene = kept(pn.load(name, terms=terms))
    rng = np.random.default_rng(1)
    states = [scene.project(*scene.initial_state())] + [
        consistent(scene, rng, 0.0, speed) for speed in (0.3, 3.0)
    ]
    return scene, states


def virtual_displacements(A):
    """A basis of the directions w with A w = 0."""
    size = np.linalg.norm(A, axis=1, keepdims=True)
    _, s, Vt = np.linalg.svd(A / np.where(size > 1e-10, size, np.inf))
    return Vt[np.count_nonzero(s > 1e-9) :]


def test_ideal_forces_do_no_work_on_virtual_displacements(robot):
    scene, states = robot
    runner = scene._compiled.program.runner()
    for q, v in states:
        A = rows_at(scene, runner, q, v, 0.0)[0]
        s = scene.solve(q, v)
        w = virtual_displacements(A)
        assert len(w) == scene.model.nv - s.rank
        size = np.abs(A.T) @ np.abs(runner.solve(q, v, 0.0).lam_ideal)
        assert np.abs(w @ s.F_ideal).max(initial=0.0) <= ROUNDING * size.max(initial=0.0)
        # Eq. (9): on them the whole constraint force does the work that C prescribes.
        C = runner.solve(q, v, 0.0).C
        total = s.F_ideal + s.F_nonideal
        in_play = size.max(initial=0.0) + np.abs(C).max()
        assert np.abs(w @ (total - C)).max(initial=0.0) <= ROUNDING * in_play


def test_friction_never_feeds_energy(robot):
    """Power of C is not positive; that of F_nonideal is the same, where the constraints stand still."""
    scene, states = robot
    runner = scene._compiled.program.runner()
    moving = any(isinstance(c, pn.PrescribedMotion) for c in scene.constraints)
    for q, v in states:
        raw = runner.solve(q, v, 0.0)
        size = np.abs(v) @ np.abs(raw.C) + np.abs(v) @ np.abs(raw.F_nonideal)
        assert v @ raw.C <= ROUNDING * size
        if not moving:
            assert v @ raw.F_nonideal == pytest.approx(v @ raw.C, abs=ROUNDING * size)
        if not scene.laws:
            assert np.abs(raw.F_nonideal).max() == 0.0


def test_ideal_forces_of_constraints_that_stand_still_have_no_power(robot):
    scene, states = robot
    if any(isinstance(c, pn.PrescribedMotion) for c in scene.constraints):
        pytest.skip("a drive does work")
    for q, v in states:
        raw = scene._compiled.program.runner().solve(q, v, 0.0)
        assert abs(v @ raw.F_ideal) <= ROUNDING * (np.abs(v) @ np.abs(raw.F_ideal) + 1.0)


def test_the_ledger_of_every_robot_closes(robot):
    scene, _ = robot
    duration = 0.03 if scene.name == "andrews_squeezer" else 0.5
    run = pn.simulate(scene, duration, record="energy", **RUN)
    ledger = run.energy
    columns = [k for k in ledger if k not in ("kinetic", "potential", "total", "balance")]
    size = np.abs(ledger["kinetic"]).max() + sum(np.ptp(ledger[k]) for k in ("potential", *columns))
    assert np.abs(ledger["balance"]).max() <= KEPT * size
    assert np.ptp(ledger["projection"]) <= 1e-7 * size
    for law in scene.law_names:
        assert np.diff(ledger[law]).max() <= ROUNDING * size, law
    assert run.violation.max() <= 1e-12
    assert run.violation_rate.max() <= 1e-11 * (1.0 + np.abs(run.v).max())


def same_forces(one, two, in_play):
    for key in ("a", "F_ideal", "F_nonideal"):
        x, y = getattr(one, key), getattr(two, key)
        np.testing.assert_allclose(y, x, rtol=0, atol=1e-9 * (in_play + np.abs(x).max()))
    assert one.rank == two.rank


def test_order_and_copies_of_constraints_do_not_matter(robot):
    scene, states = robot
    if not scene.constraints:
        pytest.skip("it has no constraint")
    anchors = [c for c in scene.constraints if isinstance(c, pn.PointAnchor)]
    copies = [type(c)(c.frame1, c.frame2, axes=c.axes, name=f"{c.name} again") for c in anchors]
    for other in (scene.constraints[::-1], [*copies, *scene.constraints]):
        turned = again(scene, constraints=other)
        for q, v in states:
            expected = scene.solve(q, v)
            same_forces(expected, turned.solve(q, v), np.abs(expected.a).max())


@pytest.mark.parametrize("scale", [1e-5, 1e4])
def test_the_scale_of_rows_does_not_matter(robot, scale):
    scene, states = robot
    if not scene.constraints or any(c.mu for c in scene.laws if isinstance(c, pn.JointFriction)):
        pytest.skip("no constraint, or laws that ask for the reaction of an anchor")
    runner = scene._compiled.program.runner()
    m = len(rows_at(scene, runner, *states[0], 0.0)[1])

    def pick(part, t, q, v):
        return scale * rows_at(scene, runner, q, v, t)[part]

    def residual(t, q):
        return pick(2, t, q, np.zeros(scene.model.nv))

    copy = pn.UserConstraint(
        lambda t, q, v, data: (pick(0, t, q, v), pick(1, t, q, v)),
        m,
        residual=residual if holonomic_rows(scene._compiled.program).all() else None,
        rate=lambda t, q, v: pick(3, t, q, v),
    )
    scaled = again(scene, constraints=[copy])
    for q, v in states:
        expected, found = scene.solve(q, v), scaled.solve(q, v)
        same_forces(expected, found, np.abs(expected.a).max())
        np.testing.assert_allclose(
            scale * found.lam, expected.lam, rtol=0, atol=1e-7 * np.abs(expected.lam).max(initial=0.0) + 1e-14
        )


# --- Free systems -----------------------------------------------------------------------------------------


def momentum(model, q, v):
    """Linear and angular momentum about the world's origin."""
    data = model.createData()
    pin.computeCentroidalMomentum(model, data, q, v)
    h = data.hg.vector
    return np.concatenate([h[:3], h[3:] + np.cross(pin.centerOfMass(model, data, q), h[:3])])


def assert_constant(history):
    np.testing.assert_allclose(history - history[0], 0.0, atol=KEPT * np.abs(history).max())


@pytest.mark.parametrize("seed", range(3))
def test_momentum_is_conserved_in_free_flight(seed):
    """Springs, dampers, friction and closed loops inside a floating robot change nothing outside."""
    rng = np.random.default_rng(seed)
    kinds = ["free flyer", "revolute x", "spherical", "revolute z", "prismatic y", "universal"]
    model = tree(kinds, rng, parents=[0, 1, 2, 1, 4, 5], gravity=False)
    q, v = state(model, rng)
    scene = pn.Scene(
        model,
        q0=q,
        constraints=[pn.Distance("j2 tip", "j5 tip", length=None)],
        laws=[pn.JointFriction("j1", mu=0.3, radius=0.05, viscous=0.1), pn.JointFriction("j4", coulomb=0.2)],
        forces=[pn.SpringDamper("j1 tip", "j4 tip", stiffness=50.0, damping=1.0, rest_length=0.3)],
        actuation=lambda t, q, v: np.concatenate([np.zeros(6), 0.5 * np.sin(9.0 * t) * np.ones(v.size - 6)]),
    )
    q, v = scene.project(q, v)
    run = pn.simulate(scene, 1.0, q, v, output_dt=0.05, record="energy", **RUN)
    history = np.array([momentum(model, a, b) for a, b in zip(run.q, run.v, strict=True)])
    assert_constant(history)
    assert run.energy["kinetic"].max() - run.energy["kinetic"].min() > 0.1


@pytest.mark.parametrize("kind", ["spherical", "free flyer"])
def test_a_free_body_keeps_its_angular_momentum_in_space(kind):
    rng = np.random.default_rng(4)
    model = tree([kind], rng, gravity=False)
    q, v = state(model, rng, speed=3.0)
    run = pn.simulate(pn.Scene(model), 5.0, q, v, **RUN)
    data = model.createData()

    def spin(q, v):
        """Angular momentum about the fixed joint, or about the origin when the body is free."""
        pin.forwardKinematics(model, data, q, v)
        h = data.oMi[1].act(model.inertias[1] * data.v[1])
        center = data.oMi[1].translation if kind == "spherical" else np.zeros(3)
        return h.angular - np.cross(center, h.linear)

    assert_constant(np.array([spin(a, b) for a, b in zip(run.q, run.v, strict=True)]))
