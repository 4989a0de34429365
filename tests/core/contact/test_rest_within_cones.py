"""Bodies rest exactly if forces within Coulomb's cones hold them, however many contacts share a load."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from scipy.linalg import block_diag

import pin_nonideal as pn
from oracles.admissible_rest import directions, may_rest, wrenches
from tests.support import wedged
from tests.support.seeds import seeds

STILL = 1e-6  # [m/s^2, rad/s^2]: motion that is slower than this is rounding
DURATION = 0.05  # [s]
SAME = 1e-7  # part of the accelerations by which equal motions may differ
ROUNDING = 1e-8  # part of the weight: least squares of nearly dependent rows


families = pytest.mark.parametrize("family", wedged.FAMILIES, ids=lambda family: family.__name__)


@families
@pytest.mark.parametrize("seed", seeds(range(1000)))
def test_solve(family, seed):
    case = family(seed)
    admissible = may_rest(case.touches, case.centers, case.loads)
    a = case.scene.solve(*case.scene.initial_state()).a
    assert admissible is None or admissible == (np.abs(a).max() <= STILL)


def motions_from_random_starts(case, count):
    """Return accelerations of the bodies in world axes, one array for each different motion."""
    vectors = [(touch, axis) for touch in case.touches for axis in (touch.normal, *directions(touch.normal))]
    columns = wrenches(case.touches, case.centers, vectors)
    inertias = list(case.scene.model.inertias)[1:]
    yields = block_diag(*[part for x in inertias for part in (np.eye(3) / x.mass, np.linalg.inv(x.inertia))])
    mu = [touch.mu for touch in case.touches]
    rng, found = np.random.default_rng(0), []
    for _ in range(count):
        w0 = columns.T @ yields @ case.loads
        start = rng.normal(size=len(w0)) * np.abs(w0).max() * rng.choice([0.1, 1.0, 10.0])
        solution = pn.cone_complementarity(columns.T @ yields @ columns, w0, mu, start=start)
        a = yields @ (columns @ solution.f + case.loads)
        if not any(np.abs(a - other).max() <= SAME * np.abs(a).max() for other in found):
            found.append(a)
    return found


def test_two_of_several_motions_are_told():
    case = wedged.pile_with_several_motions()
    q, v = case.scene.initial_state()
    expected = motions_from_random_starts(case, 30)
    assert len(expected) == 3
    with pytest.raises(pn.FrictionParadoxError, match="several solutions") as caught:
        case.scene.solve(q, v)
    assert len(caught.value.solutions) == 2
    one, other = (min(range(3), key=lambda k: np.abs(expected[k] - a).max()) for a in caught.value.solutions)
    assert one != other
    for k, a in zip((one, other), caught.value.solutions, strict=True):
        assert np.abs(expected[k] - a).max() <= SAME * np.abs(a).max()
    run = pn.simulate(case.scene, 1e-3, several="continue", progress=False)
    assert [event.kind for event in run.events if event.time == 0.0] == ["several"]
    assert np.abs(run.v[-1] / run.t[-1] - caught.value.solutions[1]).max() < 0.1


def test_friction_that_is_short_by_little_holds_nothing():
    case = wedged.box_in_corner(964)  # short by 1.6 %
    assert may_rest(case.touches, case.centers, case.loads) is False
    assert np.abs(case.scene.solve(*case.scene.initial_state()).a).max() > 1.0


@families
@pytest.mark.parametrize("seed", seeds(range(200), count=10))
def test_friction_of_a_joint_beside_changes_nothing(family, seed):
    case = wedged.beside_a_rough_rotor(family(seed))
    admissible = may_rest(case.touches, case.centers, case.loads)
    solution = case.scene.solve(*case.scene.initial_state())
    assert admissible is None or admissible == (np.abs(solution.a).max() <= STILL)
    assert solution.a[-1] == 0.0


@pytest.mark.parametrize("family", wedged.FAMILIES[:4], ids=lambda family: family.__name__)
@pytest.mark.parametrize("seed", seeds(range(300), count=10))
def test_axes_units_order_and_copies_change_nothing(family, seed):
    inertia, gravity, touches = wedged.on_points(family(seed))
    rng = np.random.default_rng(seed)
    turn = pin.Quaternion(rng.normal(size=4)).normalized().matrix()
    a = wedged.transformed(inertia, gravity, touches)
    for change in (
        {"turn": turn},
        {"length": 1e3},
        {"length": 1e-3},
        {"mass": 1e3},
        {"mass": 1e-3},
        {"order": rng.permutation(len(touches))},
        {"copies": 2},
    ):
        again = wedged.transformed(inertia, gravity, touches, **change)
        assert np.abs(again - a).max() <= SAME * (1.0 + np.abs(a).max()), change


@families
@pytest.mark.parametrize("method", ["dop853", "dopri5", "rk4", "semi_implicit_euler", "moreau"])
@pytest.mark.parametrize("seed", seeds(range(200), count=2))
def test_runs_from_rest(family, method, seed):
    case = family(seed)
    admissible = may_rest(case.touches, case.centers, case.loads)
    options = {} if method.startswith("dop") else {"dt": 1e-3}
    run = pn.simulate(case.scene, DURATION, method=method, max_wall=20.0, progress=False, **options)
    assert admissible is None or admissible == (np.abs(run.v[-1]).max() <= STILL * DURATION)


@families
@pytest.mark.parametrize("method", ["dop853", "moreau"])
@pytest.mark.parametrize("seed", seeds(range(200), always=[37], count=5))  # 37: a table at its limit
def test_recorded_forces_at_rest_lie_within_the_cones_and_hold_the_bodies(family, method, seed):
    case = family(seed)
    options = {} if method.startswith("dop") else {"dt": 1e-3}
    run = pn.simulate(case.scene, 3e-3, method=method, record="forces", progress=False, **options)
    if np.abs(run.v).max() > 0.0:
        return
    held = -case.loads.reshape(-1, 6)
    size = np.abs(held).max()
    for forces in zip(*run.contact_forces.values(), strict=True):
        balance = np.zeros_like(held)
        for touch, force in zip(case.touches, forces, strict=True):
            normal = force @ touch.normal
            friction = np.linalg.norm(force - normal * touch.normal)
            assert normal >= -ROUNDING * size
            assert friction <= touch.mu * normal + ROUNDING * size
            for body, sign in ((touch.first, 1.0), (touch.second, -1.0)):
                if body >= 0:
                    arm = touch.point - case.centers[body]
                    balance[body] += sign * np.append(force, np.cross(arm, force))
        assert np.abs(balance - held).max() <= ROUNDING * size
