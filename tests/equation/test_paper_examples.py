"""The paper's three examples: its printed values against `solve` and against its equations."""

from __future__ import annotations

import numpy as np
import pytest

from oracles.eq40_by_paper import eq40_by_paper, letters
from pin_nonideal.equation import solve

from ..support.paper_examples import example

# Closed expressions of a dozen operations in numbers of size one, against a condition below 1e3: 1e-12 is 1e4
# roundings.
PRINTED = 1e-12
# Central differences: the step squared times third derivatives up to 1e4 (omega = 40 rad/s) is 1e-9, and
# rounding over the step is no more.
STEP, DIFFERENCED = 1e-6, 1e-8


def assert_close(value, reference, tolerance=PRINTED):
    np.testing.assert_allclose(value, reference, rtol=tolerance, atol=tolerance)


def assert_rows_are_the_derivative(system, t, q, v):
    """A a = b is d(rate)/dt = 0: A by unit velocities, b by a difference along the motion with a = 0."""
    A, b = system.rows(t, q, v)
    columns = [
        (system.rate(t, q, v + STEP * e) - system.rate(t, q, v - STEP * e)) / (2 * STEP)
        for e in np.eye(len(v))
    ]
    assert_close(A, np.column_stack(columns), DIFFERENCED)
    ahead, behind = system.rate(t + STEP, q + STEP * v, v), system.rate(t - STEP, q - STEP * v, v)
    assert_close(-b, (ahead - behind) / (2 * STEP), DIFFERENCED)


def assert_rate_is_the_derivative(system, t, q, v):
    ahead, behind = system.residual(t + STEP, q + STEP * v), system.residual(t - STEP, q - STEP * v)
    assert_close(system.rate(t, q, v), (ahead - behind) / (2 * STEP), DIFFERENCED)


def assert_forces(M, F, A, b, C, ideal, nonideal):
    """Assert the printed constraint force against `solve` and against the paper's equations."""
    solution = solve(M, F, A, b, C)
    literal = eq40_by_paper(M, F, A, b, C)
    for forces in (solution, literal):
        assert_close(forces.F_ideal, ideal)
        assert_close(forces.F_nonideal, nonideal)
        assert_close(M @ forces.a, F + ideal + nonideal)  # Eq. (40)


class TestParticle:
    @pytest.fixture(
        params=[(0.3, 0.4, 1.0), (-1.2, 0.7, 0.5), (0.8, 0.1, 1.75)], ids="alpha,a0,beta={}".format
    )
    def particle(self, request):
        alpha, a0, beta = request.param
        return example("paper_a_particle").Particle(alpha=alpha, a0=a0, beta=beta)

    @pytest.fixture(params=range(4))
    def state(self, request):
        rng = np.random.default_rng(request.param)
        return rng.uniform(0.0, 3.0), rng.normal(size=3), rng.normal(size=3)

    def test_rows(self, particle, state):
        t, q, v = state
        (x, _, z), (xd, _, zd) = q, v
        A, b = particle.rows(t, q, v)
        assert_close(A, [[-(z**2), 1.0, 0.0]])  # Eq. (52)
        assert_close(b, [2 * z * zd * xd + particle.alpha * (np.cos(x - t) * xd - np.cos(x - t))])  # Eq. (53)
        assert_rows_are_the_derivative(particle, t, q, v)

    @pytest.mark.parametrize("k", [(0.0, 1.0), (-2.0, 5.0), (100.0, -0.01)])
    def test_any_null_space_gives_the_printed_inverse(self, particle, state, k):
        t, q, v = state
        A, _ = particle.rows(t, q, v)
        V = particle.paper_null_space(q, *k)
        assert_close(A @ V, np.zeros((1, 2)))  # Eq. (55), B = A for unit mass
        paper = letters(particle.M, A, V)
        assert_close(paper.J @ paper.B.T, particle.paper_inverse(q)[:, None], 1e-10)  # k = 100: J squares it
        assert_close(letters(particle.M, A).J @ A.T, particle.paper_inverse(q)[:, None])  # Eq. (56)

    def test_force(self, particle, state):
        t, q, v = state
        A, b = particle.rows(t, q, v)
        C = particle.drag(t, q, v)
        ideal, nonideal = particle.paper_force(t, q, v)
        assert_forces(particle.M, particle.given(t, q, v), A, b, C, ideal, nonideal)  # Eq. (59)
        # Eq. (57): the work on every virtual displacement is that of a force a0 (u^T u)^beta against u.
        speed = np.linalg.norm(v)
        W = particle.paper_null_space(q, 0.0, 1.0)
        assert_close(
            W.T @ (ideal + nonideal), -particle.a0 * speed ** (2 * particle.beta) * (W.T @ v) / speed
        )

    def test_no_drag_at_rest(self, particle):
        assert_close(particle.drag(0.0, np.ones(3), np.zeros(3)), np.zeros(3))


class TestRing:
    @pytest.fixture(
        params=[(1.0, 1.0, 0.25), (2.5, 0.8, 0.6), (0.3, 4.0, 0.05)], ids="mass,radius,mu={}".format
    )
    def ring(self, request):
        mass, radius, mu = request.param
        return example("paper_b_ring").Ring(mass=mass, radius=radius, mu=mu)

    @pytest.fixture(params=[(0.3, 2.0), (2.0, -1.5), (4.0, 0.2), (-1.0, 9.0)])
    def state(self, request, ring):
        return ring.at(*request.param)

    def test_rows(self, ring, state):
        q, v = state
        A, b = ring.rows(0.0, q, v)
        assert_close(A, [q])  # Eq. (63)
        assert_close(b, [-(v[0] ** 2) - v[1] ** 2])  # Eq. (64)
        assert_close(ring.given / ring.mass, [0.0, -9.81])  # Eq. (61)
        assert_rows_are_the_derivative(ring, 0.0, q, v)
        assert_rate_is_the_derivative(ring, 0.0, q, v)
        assert_close(ring.residual(0.0, q), [0.0])

    def test_letters(self, ring, state):
        q, v = state
        A, _ = ring.rows(0.0, q, v)
        V = ring.paper_null_space(q)
        paper = letters(ring.mass_matrix, A, V)
        assert_close(paper.B, [q / np.sqrt(ring.mass)])  # Eq. (65)
        assert_close(paper.B @ V, [[0.0]])  # Eq. (66)
        assert_close(paper.J @ paper.B.T, ring.paper_inverse(q)[:, None])  # Eq. (67)

    @pytest.mark.parametrize("h", [0.0, 0.7, 20.0])
    def test_force(self, ring, state, h):
        q, v = state
        A, b = ring.rows(0.0, q, v)
        C = ring.rubbing(h, v)
        ideal, nonideal = ring.paper_force(q, v, h)
        assert_forces(ring.mass_matrix, ring.given, A, b, C, ideal, nonideal)  # Eq. (69)
        V = ring.paper_null_space(q)
        assert_close(V.T @ (ideal + nonideal), -h * (V.T @ v) / np.linalg.norm(v))  # Eq. (68)
        assert_close(nonideal, C)  # C lies along the ring already
        assert_close(np.linalg.norm(ideal), abs(ring.normal(q, v)))

    def test_closed_form_satisfies_its_equation(self, ring):
        """d(v^2)/d(angle) = -2 (g R sin + mu |N| R / m), N > 0, checked by a difference."""
        for angle in (0.2, 1.0, 2.5):
            ahead, behind = ring.speed_squared(angle + STEP, 20.0), ring.speed_squared(angle - STEP, 20.0)
            q, v = ring.at(angle, np.sqrt(ring.speed_squared(angle, 20.0)))
            assert ring.normal(q, v) > 0.0
            pull = (
                ring.g * ring.radius * np.sin(angle) + ring.mu * ring.normal(q, v) * ring.radius / ring.mass
            )
            assert_close((ahead - behind) / (2 * STEP), -2.0 * pull, DIFFERENCED)


class TestIncline:
    @pytest.fixture(
        params=[(1.0, 0.52, 0.3), (3.0, 0.1, 0.9), (0.2, 1.4, 0.05)], ids="mass,alpha,mu={}".format
    )
    def block(self, request):
        mass, alpha, mu = request.param
        return example("paper_c_incline").Incline(mass=mass, alpha=alpha, mu=mu)

    @pytest.fixture(params=[(0.0, 0.5), (0.03, -1.2), (0.11, 2.0), (1.7, -0.01)])
    def state(self, request, block):
        t, xd = request.param
        v = np.array([xd, xd * np.tan(block.alpha) - block.beta * block.omega * np.cos(block.omega * t)])
        return t, np.array([0.4, -0.7]), v

    def test_rows(self, block, state):
        t, q, v = state
        A, b = block.rows(t, q, v)
        assert_close(block.given / block.mass, [0.0, 9.81])  # Eq. (71)
        assert_close(A, [[-np.tan(block.alpha), 1.0]])  # Eq. (72)
        assert_close(b, [block.beta * block.omega**2 * np.sin(block.omega * t)])  # Eq. (72)
        assert_close(block.rate(t, q, v), [0.0])
        assert_rows_are_the_derivative(block, t, q, v)
        assert_rate_is_the_derivative(block, t, q, v)

    @pytest.mark.parametrize("delta", [1.0, -0.2, 7.0])
    def test_letters(self, block, state, delta):
        A, _ = block.rows(*state)
        V = block.paper_null_space(delta)
        paper = letters(block.mass_matrix, A, V)
        assert_close(paper.B @ V, [[0.0]])  # Eq. (73)
        assert_close(paper.J @ paper.B.T, block.paper_inverse()[:, None], 1e-10)  # Eq. (75); J squares delta

    def test_force(self, block, state):
        t, q, v = state
        A, b = block.rows(t, q, v)
        ideal, nonideal = block.paper_ideal(t), block.paper_nonideal(t, v)
        size = np.linalg.norm(solve(block.mass_matrix, block.given, A, b).F_ideal)
        assert_close(size, block.paper_size(t))  # Eq. (79)
        C = block.friction(size, v)
        assert_forces(block.mass_matrix, block.given, A, b, C, ideal, nonideal)  # Eqs. (76), (80), (81)
        assert_close(nonideal, C)  # C lies along the plane already
        assert_close(np.linalg.norm(nonideal), block.mu * size)  # Coulomb

    def test_steep_plane_at_rest_slides_as_printed(self):
        block = example("paper_c_incline").Incline(beta=0.0, alpha=0.7, mu=0.4)
        A, b = block.rows(0.0, None, np.ones(2))
        C = block.friction(block.paper_size(0.0), np.ones(2))
        a = solve(block.mass_matrix, block.given, A, b, C).a
        assert_close(a[0], block.g * np.cos(0.7) ** 2 * (np.tan(0.7) - 0.4))

    def test_numbers_of_the_closed_form(self):
        """The constants in the script are those of its formula."""
        script = example("paper_c_incline")
        assert_close(script.Incline().sliding(1.0, 0.1), (script.DISTANCE_AT_1, script.SPEED_AT_1))
        up, down = (9.81 * (np.sin(np.pi / 6) + s * 0.2 * np.cos(np.pi / 6)) for s in (1.0, -1.0))
        turn, distance = 3.0 / up, 9.0 / (2.0 * up)
        assert_close((script.TURN_TIME, script.TURN_DISTANCE), (turn, distance))
        back = np.sqrt(2.0 * distance / down)
        assert_close((script.RETURN_TIME, script.RETURN_SPEED), (turn + back, down * back))
