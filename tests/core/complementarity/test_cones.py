"""The solver of contacts with Coulomb friction: conditions of random problems, enumeration, closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import nnls

import pin_nonideal as pn
from oracles.cone_problems import planar_solutions, random_problem
from pin_nonideal._core import ConeSolver

# Relative violation of the laws.
KEPT = 1e-10
# Relative difference of velocities below which two solutions are one.
SAME = 1e-8
GRAVITY = 9.81
TINY = 1e-150  # guard for bodies in common free fall, where all terms are zero


def solve(problem, **more):
    return pn.cone_complementarity(problem.W, problem.w0, problem.mu, dims=problem.dim, **more)


def misses(problem, f):
    """Return the largest relative violation of the laws by f, in velocities, forces and powers."""
    W, w0, mu, dim = problem.W, problem.w0, problem.mu, problem.dim
    w, speed = W @ f + w0, np.maximum(np.abs(W) @ np.abs(f), np.abs(w0).max()) + TINY
    force = np.abs(f).max() + TINY
    worst = 0.0
    for c, m in enumerate(mu):
        i = slice(c * dim, (c + 1) * dim)
        (fn, *ft), (wn, *wt), s = f[i], w[i], speed[i].max()
        length, slip = np.linalg.norm(ft), np.linalg.norm(wt)
        worst = max(worst, -wn / s, -fn / force, abs(fn * wn) / (force * s), (length - m * fn) / force)
        worst = max(worst, abs(np.dot(ft, wt) + m * fn * slip) / (force * s))
    return worst


def check_certificate(problem, found):
    """Check each step of the proof."""
    W, w0, mu, dim, y = problem.W, problem.w0, problem.mu, problem.dim, found.certificate
    unit = np.sqrt(np.repeat(np.diag(W).reshape(-1, dim).max(axis=1), dim))
    W, w0 = W / unit / unit[:, None], w0 / unit / np.abs(w0 / unit).max()
    y = y * unit / np.linalg.norm(y * unit)
    assert y @ w0 < 0.0
    parts, u = y.reshape(-1, dim), -(W.T @ y).reshape(-1, dim)
    if found.status == "infeasible":
        assert (parts[:, 0] >= 0.0).all()
        assert (parts[:, 1:] == 0.0).all()
        assert (u[:, 0] >= mu * np.linalg.norm(u[:, 1:], axis=1) - SAME).all()
    else:
        assert (mu * parts[:, 0] >= np.linalg.norm(parts[:, 1:], axis=1) - SAME).all()
        np.testing.assert_allclose(u, 0.0, atol=SAME)


@pytest.mark.parametrize("count", [1500, pytest.param(100_000, marks=pytest.mark.stress)])
def test_random_problems_are_solved(count):
    """Rank-deficient W, mu to 2, mass ratios to 1e6: the laws hold to rounding."""
    rng = np.random.default_rng(0)
    worst, unsolved = 0.0, []
    for k in range(count):
        problem = random_problem(rng, planar=k % 3 == 0)
        found = solve(problem)
        if found.status != "solved":
            unsolved.append((k, found.status))
            continue
        worst = max(worst, misses(problem, found.f))
        assert (found.f.reshape(-1, problem.dim)[:, 0] >= 0.0).all()
    print(f"{count} problems: largest miss {worst:.1e}, not solved {unsolved}")
    assert worst < KEPT
    assert all(status == "failed" for _, status in unsolved)  # a certificate would be false
    assert len(unsolved) <= count / 20_000


@pytest.mark.parametrize("count", [400, pytest.param(20_000, marks=pytest.mark.stress)])
def test_driven_problems_are_solved_or_refused(count):
    """For surfaces driven against each other, the laws hold or a proof shows that no solution exists."""
    rng = np.random.default_rng(1)
    count_of = dict.fromkeys(("solved", "infeasible", "jammed", "failed"), 0)
    for k in range(count):
        problem = random_problem(rng, planar=k % 3 == 0, driven=True)
        found = solve(problem)
        count_of[found.status] += 1
        if found.status == "solved":
            assert misses(problem, found.f) < KEPT
        elif found.status != "failed":
            check_certificate(problem, found)
    print(count_of)
    assert count_of["failed"] <= 1 + count / 500
    assert count_of["infeasible"] > 0
    assert count_of["jammed"] > 0


@pytest.mark.parametrize(
    "count", [15, pytest.param(150, marks=pytest.mark.slow), pytest.param(5000, marks=pytest.mark.stress)]
)
@pytest.mark.parametrize("driven", [False, True])
def test_planar_problems_against_enumeration(count, driven):
    """The solution is one of the enumerated solutions; problems without solution are rejected."""
    rng = np.random.default_rng(2 + driven)
    several = 0
    for _ in range(count):
        problem = random_problem(rng, planar=True, max_contacts=4, driven=driven)
        found = solve(problem)
        known = planar_solutions(problem, found.f)
        if not known:
            assert found.status in {"infeasible", "jammed"}
            continue
        if found.status != "solved":
            assert found.status == "failed" or driven
            several += 1
            continue
        scale = np.maximum(np.abs(problem.W) @ np.abs(found.f), np.abs(problem.w0).max()) + TINY
        away = [np.abs((problem.W @ (f - found.f)) / scale).max() for f in known]
        assert min(away) < SAME, found.modes
    assert several <= count / 50


def table(load_x, load_y, a=0.4, b=0.3, weight=98.1):
    """Four legs at (+-a, +-b) under a load: rows of normals on the plate, and the load."""
    corners = np.array([[a, b], [-a, b], [-a, -b], [a, -b]])
    H = np.column_stack([np.ones(4), corners[:, 1], -corners[:, 0]])  # heave, rotations about x and y
    return H, np.array([-weight, -weight * load_y, weight * load_x])


@pytest.mark.parametrize("place", [(0.0, 0.0), (0.1, 0.05), (0.2, 0.15), (0.25, 0.2), (0.39, 0.29)])
def test_a_table_shares_its_load_by_least_norm(place):
    """Loads are the minimum-norm nonnegative solution: nonnegative least squares with weighted equations."""
    H, load = table(*place)
    found = pn.cone_complementarity(H @ H.T, H @ load, 0.0, dims=1)
    heavy = 1e7
    expected = nnls(np.vstack([heavy * H.T, np.eye(4)]), np.concatenate([-heavy * load, np.zeros(4)]))[0]
    assert found.status == "solved"
    assert (found.f >= 0.0).all()
    np.testing.assert_allclose(H.T @ found.f, -load, atol=1e-11)
    np.testing.assert_allclose(found.f, expected, atol=1e-6 * 98.1)
    x, y = place
    if x / 0.4 + y / 0.3 <= 1.0:
        corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [0.4, 0.3]
        np.testing.assert_allclose(
            found.f, 24.525 * (1 + corners @ [x / 0.16, y / 0.09]), rtol=1e-12, atol=1e-11
        )


def test_least_norm_under_friction():
    """Each corner of a box pushed below its limit carries a quarter of weight and push."""
    corners = np.array([[s, t, -0.5] for s in (1, -1) for t in (1, -1)]) * 0.2
    axes = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    H = np.vstack([np.hstack([axes, np.cross(c, axes)]) for c in corners])
    M = np.array([2.0, 2.0, 2.0, 0.03, 0.03, 0.03])
    push = np.array([0.0, 0.0, -2.0 * GRAVITY, 0.0, 0.0, 0.0])
    found = pn.cone_complementarity((H / M) @ H.T, H @ (push / M), 0.5)
    assert set(found.modes) == {"stick"}
    np.testing.assert_allclose(found.f.reshape(4, 3), [[0.5 * GRAVITY, 0.0, 0.0]] * 4, atol=1e-12)
    np.testing.assert_allclose(found.w, 0.0, atol=1e-13)


@pytest.mark.parametrize(("slope", "mode"), [(0.5 - 1e-9, "stick"), (0.5 + 1e-9, "slip")])
def test_a_block_on_an_incline(slope, mode):
    """A block on an incline slips just beyond tan(angle) = mu, with the acceleration of the closed form."""
    angle = np.arctan(slope)
    w0 = GRAVITY * np.array([-np.cos(angle), np.sin(angle), 0.0])
    found = pn.cone_complementarity(np.eye(3) / 3.0, w0, 0.5)
    held = min(slope, 0.5) * np.cos(angle)
    np.testing.assert_allclose(found.f, 3.0 * GRAVITY * np.array([np.cos(angle), -held, 0.0]), rtol=1e-13)
    assert abs(found.w[1] - GRAVITY * (np.sin(angle) - held)) < 1e-14
    assert (found.w[1] > 1e-9) == (mode == "slip")


def test_a_stack_of_unlike_masses():
    """1 : 1 : 1000 from below; forces to 1e-12."""
    mass = np.array([1.0, 1.0, 1000.0])
    H = np.array([[1.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [0.0, -1.0, 1.0]])
    found = pn.cone_complementarity((H / mass) @ H.T, H @ np.full(3, -GRAVITY), 0.0, dims=1)
    np.testing.assert_allclose(found.f, GRAVITY * np.array([1002.0, 1001.0, 1000.0]), rtol=1e-12)


def test_dry_friction_of_a_joint_beside_a_contact():
    """A slider with friction carries its limit, the contact the remaining load."""
    # A mass pressed down by 10 N on a slider with 4 N of friction along the same line.
    H = np.array([[1.0], [1.0]])
    found = pn.cone_complementarity(H @ H.T, H @ [-10.0], 0.3, dims=[1], limits=[4.0])
    assert found.status == "solved"
    assert abs(found.f.sum() - 10.0) < 1e-13
    assert abs(found.f[1]) <= 4.0
    np.testing.assert_allclose(found.f, [6.0, 4.0], rtol=1e-12)  # minimum norm within the limit
    slides = pn.cone_complementarity(np.eye(1), [-10.0], [], limits=[4.0])
    np.testing.assert_allclose((slides.f, slides.w), ([4.0], [-6.0]))
    assert slides.modes == ("slip",)


def test_a_warm_start_takes_no_more_steps():
    rng = np.random.default_rng(5)
    for _ in range(50):
        problem = random_problem(rng)
        dims = [problem.dim] * len(problem.mu)
        solver = ConeSolver()
        if solver.solve(problem.W, problem.w0, dims, list(problem.mu), len(dims)).name != "solved":
            continue
        cold, f = solver.steps, solver.f
        solver.again(1, True)
        warm = np.subtract(solver.steps, cold)
        assert warm[0] <= 4
        assert warm[1] == 0
        np.testing.assert_allclose(solver.f, f, rtol=0.0, atol=1e-9 * np.abs(f).max())


def test_no_motion_where_plates_crush():
    """Two approaching plates crush a body between them: no forces separate them."""
    H = np.array([[1.0], [-1.0]])
    found = pn.cone_complementarity(H @ H.T, [-1.0, -1.0], 0.0, dims=1)
    assert found.status == "infeasible"
    np.testing.assert_allclose(found.certificate / found.certificate[0], [1.0, 1.0], rtol=1e-9)


def test_painleve_without_a_solution():
    """A slipping contact of a rod has w_n = W f + w0 with W < 0, which no symmetric W has."""
    found = pn.cone_complementarity([[-1.0]], [-1.0], 0.0, dims=1)
    assert found.status == "infeasible"
    assert found.certificate[0] > 0.0


class TestRefusals:
    @pytest.mark.parametrize(
        ("change", "message"),
        [
            ({"mu": -0.1}, "mu must be a list of numbers of at least 0, got [-0.1]; correct the negative"),
            ({"mu": [0.1, 0.2]}, "dims must be 1, 2 or 3 for each contact and add up to the 3 rows"),
            ({"W": np.eye(2)}, "W must have shape (3, 3); got shape (2, 2)"),
            ({"w0": [np.nan, 0.0, 0.0]}, "w0 must be finite; entry [0] is nan"),
            (
                {"limits": [-1.0]},
                "limits must be a list of numbers of at least 0, got [-1.]; correct the negative numbers",
            ),
            ({"dims": {}}, "dims must be a number or an array of numbers; got {}"),
            ({"dims": 2.5}, "dims must be 1, 2 or 3 for each contact and add up to the 3 rows"),
            ({"dims": 2}, "dims must be 1, 2 or 3 for each contact and add up to the 3 rows"),
        ],
    )
    def test_bad_input(self, change, message):
        arguments = {"W": np.eye(3), "w0": -np.ones(3), "mu": 0.1} | change
        with pytest.raises(pn.InputError) as error:
            pn.cone_complementarity(**arguments)
        assert message in str(error.value)
