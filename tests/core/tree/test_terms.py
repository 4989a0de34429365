"""M, bias forces and free acceleration of both providers, against Pinocchio's algorithms."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.errors import InputError

from ...support.mechanisms import body, empty
from ...support.random_trees import AXIS, JOINTS, add, placement, state, tree
from ...support.refusals import refuses

# Rounding of sums in another order, on trees of a few dozen joints.
ROUNDING = 1e-12
# Rounding of M times its condition, which is below 1e4 in these models.
SOLVED = 1e-9


@pytest.fixture(params=["core", "pinocchio"])
def terms(request):
    """Return the provider of M and the bias forces."""
    return request.param


def assert_terms_match(model, terms, rng, count=3, speed=2.0):
    data = model.createData()
    runner = pn.Scene(model, terms=terms)._compiled.program.runner()
    for _ in range(count):
        q, v = state(model, rng, speed)
        M, bias = runner.terms(q, v)
        expected = pin.crba(model, data, q, pin.Convention.WORLD)
        expected = np.triu(expected) + np.triu(expected, 1).T
        np.testing.assert_allclose(M.reshape(model.nv, -1), expected, atol=ROUNDING * np.abs(expected).max())
        expected = pin.nonLinearEffects(model, data, q, v)
        np.testing.assert_allclose(bias, expected, atol=ROUNDING * np.abs(expected).max())


def assert_free_acceleration_matches(model, terms, rng, count=3, tolerance=SOLVED):
    data, scene = model.createData(), pn.Scene(model, terms=terms)
    for _ in range(count):
        q, v = state(model, rng)
        tau = rng.standard_normal(model.nv)
        expected = pin.aba(model, data, q, v, tau)
        a = scene.acceleration(q, v, tau)
        np.testing.assert_allclose(a, expected, atol=tolerance * np.abs(expected).max())
        np.testing.assert_allclose(scene.solve(q, v, tau=tau).a, a, atol=tolerance * np.abs(a).max())


@pytest.mark.parametrize("kind", JOINTS)
def test_each_kind_of_joint_at_the_root_and_inside_a_tree(kind, terms):
    rng = np.random.default_rng(1)
    around = ([], []), ([], ["revolute unaligned"]), (["revolute y"], ["spherical"]), (["free flyer"], [kind])
    for before, after in around:
        model = tree([*before, kind, *after], rng)
        assert_terms_match(model, terms, rng)
        assert_free_acceleration_matches(model, terms, rng)


@pytest.mark.parametrize("seed", range(4))
def test_all_kinds_of_joints_in_one_tree_with_armature(seed, terms):
    rng = np.random.default_rng(seed)
    kinds = list(JOINTS)
    rng.shuffle(kinds)
    model = tree(kinds, rng, armature=True)
    assert len(set(model.parents)) > 5
    assert_terms_match(model, terms, rng)
    assert_free_acceleration_matches(model, terms, rng)


ANGLES = [0.0, -0.0, 5e-324, 1e-8, -0.3, 0.7853981633974483, 0.7853981633974484, 1.0, 1.5707963267948966]
ANGLES += [-3.0, 6.3, *np.linspace(-50.0, 50.0, 1001), 1e4 * np.pi, -7.5e5, 7.999999e5, 8.1e5, -1e9, 1e22]


@pytest.mark.parametrize("together", [1, 4, 6])
def test_cosines_and_sines_of_all_angles(together, terms):
    """Gravity's moment on a body at distance 1, for any number of joints."""
    model = empty()
    for k in range(together):
        body(model, 0, pin.JointModelRY(), f"j{k}", 1.0, lever=(1.0, 0.0, 0.0), inertia=np.eye(3))
    for gravity, exact in (((0.0, 0.0, 1.0), np.cos), ((1.0, 0.0, 0.0), np.sin)):
        model.gravity.linear = np.array(gravity)
        runner = pn.Scene(model, terms=terms)._compiled.program.runner()
        for k in range(len(ANGLES) - together + 1):
            q = np.array(ANGLES[k : k + together])
            moments = runner.terms(q, np.zeros(together))[1]
            np.testing.assert_allclose(moments, exact(q), rtol=0.0, atol=2e-16)


def test_joints_numbered_across_branches():
    """Pinocchio's crba needs joints numbered branch by branch; the sum of J^T Y J over bodies does not."""
    rng = np.random.default_rng(6)
    kinds = ["free flyer", "revolute x", "spherical", "prismatic y", "planar"]
    model = tree(kinds, rng, parents=[0, 1, 1, 2, 3])
    data, runner = model.createData(), pn.Scene(model)._compiled.program.runner()
    q, v = state(model, rng)
    pin.computeJointJacobians(model, data, q)
    bodies = range(1, model.njoints)
    J = [pin.getJointJacobian(model, data, i, pin.ReferenceFrame.LOCAL) for i in bodies]
    expected = sum(j.T @ model.inertias[i].matrix() @ j for i, j in zip(bodies, J, strict=True))
    M = runner.terms(q, v)[0].reshape(model.nv, -1)
    np.testing.assert_allclose(M, expected, atol=ROUNDING * np.abs(expected).max())
    message = (
        'terms="pinocchio" needs joints numbered branch by branch, as Pinocchio\'s crba does; joint "j3" '
        'hangs on "j1", which joint "j2" does not move with; number them so, or take terms="core"'
    )
    with refuses(message, InputError):
        pn.Scene(model, terms="pinocchio")


def test_a_chain_of_all_kinds(terms):
    rng = np.random.default_rng(7)
    model = tree(list(JOINTS), rng, parents=range(len(JOINTS)))
    assert_terms_match(model, terms, rng)


@pytest.mark.parametrize(
    "direction", [(0, 0, -9.81), (3.0, 0, 0), (0, -1.6, 0), (0, 0, 0), tuple(24.8 * AXIS)]
)
def test_gravity_in_any_direction(direction, terms):
    rng = np.random.default_rng(2)
    model = tree(["revolute x", "spherical", "prismatic y", "universal"], rng, gravity=False)
    model.gravity = pin.Motion(np.array(direction, dtype=float), np.zeros(3))
    assert_terms_match(model, terms, rng)
    assert_free_acceleration_matches(model, terms, rng)


@pytest.mark.parametrize("name", ["panda", "solo12", "talos"])
def test_example_robots(name, terms):
    rng = np.random.default_rng(3)
    robots_loader = pytest.importorskip("example_robot_data.robots_loader")
    model = robots_loader.load(name).model
    assert_terms_match(model, terms, rng)
    assert_free_acceleration_matches(model, terms, rng)


def test_a_robot_far_from_the_origin_keeps_its_digits(terms):
    """M, bias and acceleration of a floating base do not change with a shift of 10 km."""
    rng = np.random.default_rng(4)
    kinds = ["free flyer", "revolute x", "spherical", "prismatic unaligned", "universal", "revolute z"]
    model = tree(kinds, rng, parents=[0, 1, 2, 1, 4, 5])
    scene = pn.Scene(model, terms=terms)
    runner = scene._compiled.program.runner()
    q, v = state(model, rng)
    q[:3] = 0.0
    far = q.copy()
    far[:3] = [1e4, -2e4, 3e3]
    for here, there in zip(runner.terms(q, v), runner.terms(far, v), strict=True):
        np.testing.assert_allclose(there, here, rtol=0, atol=1e-14 * np.abs(here).max())
    a = scene.acceleration(q, v)
    np.testing.assert_allclose(scene.acceleration(far, v), a, rtol=0, atol=1e-12 * np.abs(a).max())


@pytest.mark.parametrize("slides", [["prismatic x", "prismatic y", "prismatic z"], ["translation"]])
def test_a_robot_that_slid_far_keeps_its_digits(slides, terms):
    """The reference point of a base on sliding joints follows the first revolute joint."""
    rng = np.random.default_rng(9)
    kinds = [*slides, "revolute z", "spherical", "prismatic x", "universal"]
    n = len(slides)
    model = tree(kinds, rng, parents=[*range(n), n, n + 1, n + 2, n + 1])
    scene = pn.Scene(model, terms=terms)
    assert_terms_match(model, terms, rng)
    q, v = state(model, rng)
    q[:3] = 0.0
    far = q.copy()
    far[:3] = [1e4, -2e4, 3e3]
    runner = scene._compiled.program.runner()
    for here, there in zip(runner.terms(q, v), runner.terms(far, v), strict=True):
        np.testing.assert_allclose(there, here, rtol=0, atol=1e-14 * np.abs(here).max())
    a = scene.acceleration(q, v)
    np.testing.assert_allclose(scene.acceleration(far, v), a, rtol=0, atol=1e-12 * np.abs(a).max())


def test_quaternions_that_are_not_quite_unit_do_not_change_the_motion(terms):
    rng = np.random.default_rng(5)
    model = tree(["free flyer", "spherical", "endless x"], rng)
    runner = pn.Scene(model, terms=terms)._compiled.program.runner()
    q, v = state(model, rng)
    off = q.copy()
    off[3:7] *= 1.0 + 3e-7
    off[7:11] *= 1.0 - 5e-7
    for exact, scaled in zip(runner.terms(q, v), runner.terms(off, v), strict=True):
        np.testing.assert_allclose(scaled, exact, atol=ROUNDING * np.abs(exact).max())


def test_a_composite_of_more_than_six_freedoms(terms):
    """With seven directions of one body M is singular without armature."""
    rng = np.random.default_rng(10)
    joint = pin.JointModelComposite(pin.JointModelFreeFlyer())
    joint.addJoint(pin.JointModelRX(), placement(rng))
    model = tree(["revolute y"], rng)
    add(model, "many", joint, 1, rng)
    add(model, "last", "spherical", 2, rng)
    model.armature = rng.uniform(0.1, 0.2, model.nv)
    assert_terms_match(model, terms, rng)
    assert_free_acceleration_matches(model, terms, rng)


def test_joints_without_a_motion_are_refused(terms):
    inner = pin.JointModelComposite(pin.JointModelRX())
    inner.addJoint(pin.JointModelComposite(), pin.SE3.Identity())
    for empty_one in (pin.JointModelComposite(), inner):
        model = pin.Model()
        model.addJoint(0, empty_one, pin.SE3.Identity(), "none")
        message = 'joint "none" is a composite without joints; add joints to it, or append its body to the'
        with refuses(message, InputError):
            pn.Scene(model, terms=terms)
    model = tree(["revolute x"], np.random.default_rng(0))
    model.addJoint(1, pin.JointModelMimic(model.joints[1], 2.0, 0.1), pin.SE3.Identity(), "copy")
    message = 'joint "copy" is a mimic joint of Pinocchio; build the model with mimic=False and add a Joint'
    with refuses(message, InputError):
        pn.Scene(model, terms=terms)


def test_gravity_that_turns_is_refused():
    model = tree(["revolute x"], np.random.default_rng(0))
    model.gravity = pin.Motion(np.array([0.0, 0.0, -9.81, 0.0, 0.5, 0.0]))
    message = (
        "Scene: the gravity of the model must have no angular part, which has no potential energy; "
        "got [0.  0.5 0. ] rad/s^2: set it to zero, and turn the ground by a joint instead"
    )
    with refuses(message, InputError):
        pn.Scene(model)


def test_a_third_provider_is_refused():
    message = "Scene: terms must be one of 'core', 'pinocchio'; got 'pinochio'; nearest: \"pinocchio\""
    with refuses(message, InputError):
        pn.load("four_bar", terms="pinochio")
