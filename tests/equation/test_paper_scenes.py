"""The paper's three examples as scenes: motions and recorded forces against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

import pin_nonideal as pn

from ..support.paper_examples import example

# At these tolerances of the step control a run of a few dozen steps stays within 1e-10 of the closed forms;
# on the loop of the bead, whose speed falls to a third, errors grow about tenfold.
TIGHT = {"rtol": 1e-12, "atol": 1e-13}
CLOSED, LOOP = 1e-10, 1e-9
# Documented residual of positions and rates, also at samples between steps.
HELD = 1e-10
# Error of printed formulas at recorded states: forces of size ten times the constraint residual there.
PRINTED = 10.0 * HELD


def assert_close(value, reference, tolerance):
    np.testing.assert_allclose(value, reference, rtol=0.0, atol=tolerance)


def assert_multipliers_balance(system, run, C):
    """A^T lam = F_ideal + F_nonideal - C, the meaning of lam, at every sample."""
    for t, q, v, lam, F_c, c in zip(
        run.t, run.q, run.v, run.lam, run.F_ideal + run.F_nonideal, C, strict=True
    ):
        assert_close(system.rows(t, q, v)[0].T @ lam, F_c - c, PRINTED)


class TestParticle:
    script = property(lambda self: example("paper_a_particle"))

    @pytest.mark.parametrize("climb", [0.9, 0.0, -1.4])
    def test_coasting(self, climb):
        """Without drive the speed and z are elementary, and x and y are quadratures over the path length."""
        particle = self.script.Particle(alpha=0.0, push=0.0)
        q0 = np.array([0.2, -0.1, -0.8])
        v0 = particle.start(q0, (1.5, climb))
        run = pn.simulate(particle.scene(), 3.0, q=q0, v=v0, output_dt=0.25, **TIGHT)
        speed, height = particle.coasting(run.t, q0, v0)
        assert_close(np.linalg.norm(run.v, axis=1), speed, CLOSED)
        assert_close(run.q[:, 2], height, CLOSED)
        share = v0[2] / np.linalg.norm(v0)
        path = np.log1p(particle.a0 * np.linalg.norm(v0) * 3.0) / particle.a0

        def x_rate(s):
            return np.sqrt((1.0 - share**2) / (1.0 + (q0[2] + share * s) ** 4))

        x = q0[0] + quad(x_rate, 0.0, path, epsabs=1e-13)[0]
        y = q0[1] + quad(lambda s: (q0[2] + share * s) ** 2 * x_rate(s), 0.0, path, epsabs=1e-13)[0]
        assert_close(run.q[-1, :2], (x, y), CLOSED)

    def test_driven_motion_and_forces(self):
        """With drive and given forces: the printed constraint force, Eq. (59), integrated by SciPy."""
        particle = self.script.Particle()
        q0 = np.array([0.3, -0.2, 0.5])
        v0 = particle.start(q0, (0.8, -0.3))
        run = pn.simulate(particle.scene(), 2.0, q=q0, v=v0, output_dt=0.1, record=("forces",), **TIGHT)

        def motion(t, y):
            q, v = y[:3], y[3:]
            return np.concatenate([v, particle.given(t, q, v) + sum(particle.paper_force(t, q, v))])

        reference = solve_ivp(
            motion,
            (0.0, 2.0),
            np.concatenate([q0, v0]),
            method="DOP853",
            t_eval=run.t,
            rtol=1e-13,
            atol=1e-14,
        )
        assert_close(np.hstack([run.q, run.v]), reference.y.T, LOOP)
        assert run.violation_rate.max() < HELD
        printed = [particle.paper_force(*state) for state in zip(run.t, run.q, run.v, strict=True)]
        assert_close(run.F_ideal, [p[0] for p in printed], PRINTED)
        assert_close(run.F_nonideal, [p[1] for p in printed], PRINTED)
        C = [particle.drag(*state) for state in zip(run.t, run.q, run.v, strict=True)]
        assert_multipliers_balance(particle, run, C)


class TestRing:
    script = property(lambda self: example("paper_b_ring"))

    @pytest.mark.parametrize("reaction", [None, "ideal", "total"])
    def test_slow_bead(self, reaction):
        ring = self.script.Ring()
        q0, v0 = ring.at(0.0, 4.0)
        run = pn.simulate(ring.scene(reaction), 0.2, q=q0, v=v0, output_dt=0.02, record=("forces",), **TIGHT)
        angle = np.arctan2(run.q[:, 0], -run.q[:, 1])
        speed = np.linalg.norm(run.v, axis=1)
        assert_close(angle[-1], self.script.ANGLE_AT_0P2, CLOSED)
        assert_close(speed[-1] / ring.radius, self.script.RATE_AT_0P2, CLOSED)
        assert_close(speed**2, ring.speed_squared(angle, 4.0), LOOP)
        assert run.violation.max() < HELD
        assert run.violation_rate.max() < HELD
        h = [ring.mu * abs(ring.normal(q, v)) for q, v in zip(run.q, run.v, strict=True)]
        printed = [ring.paper_force(q, v, size) for q, v, size in zip(run.q, run.v, h, strict=True)]
        assert_close(run.F_ideal, [p[0] for p in printed], PRINTED)
        assert_close(run.F_nonideal, [p[1] for p in printed], PRINTED)
        C = [ring.rubbing(size, v) for v, size in zip(run.v, h, strict=True)]
        assert_multipliers_balance(ring, run, C)

    @pytest.mark.parametrize("reaction", [None, "ideal", "total"])
    def test_whole_loop(self, reaction):
        ring = self.script.Ring()
        q0, v0 = ring.at(0.0, 12.0)
        run = pn.simulate(ring.scene(reaction), self.script.LOOP_TIME, q=q0, v=v0, output_dt=0.05, **TIGHT)
        angle = np.unwrap(np.arctan2(run.q[:, 0], -run.q[:, 1]))
        speed = np.linalg.norm(run.v, axis=1)
        assert_close(angle[-1], 2.0 * np.pi, LOOP)
        assert_close(speed[-1], self.script.SPEED_AFTER_LOOP, LOOP)
        assert_close(speed**2, ring.speed_squared(angle, 12.0), 1e2 * LOOP)  # v^2 = 144 at the start
        assert run.violation.max() < HELD

    def test_friction_takes_what_the_speed_loses(self):
        """The motion does not depend on the mass, and friction is proportional to it."""
        light, heavy = self.script.Ring(mass=0.1), self.script.Ring(mass=50.0)
        q0, v0 = light.at(0.5, 6.0)
        one, two = (
            pn.simulate(ring.scene(), 0.3, q=q0, v=v0, output_dt=0.1, record=("forces",), **TIGHT)
            for ring in (light, heavy)
        )
        assert_close(one.q, two.q, CLOSED)
        assert_close(500.0 * one.F_nonideal, two.F_nonideal, 1e3 * CLOSED)  # forces of some hundred newtons


class TestIncline:
    script = property(lambda self: example("paper_c_incline"))

    def test_vibrating_plane(self):
        block = self.script.Incline()
        q0, v0 = block.at(0.0, 0.1)
        run = pn.simulate(block.scene(), 1.0, q=q0, v=v0, output_dt=0.05, record=("forces",), **TIGHT)
        distance, speed = block.sliding(run.t, 0.1)
        assert_close(block.along(run.q), distance, CLOSED)
        assert_close(block.along(run.v), speed, CLOSED)
        assert_close(block.along(run.q[-1]), self.script.DISTANCE_AT_1, CLOSED)
        assert_close(block.along(run.v[-1]), self.script.SPEED_AT_1, CLOSED)
        assert run.violation.max() < HELD
        assert run.violation_rate.max() < HELD
        assert_close(run.F_ideal, [block.paper_ideal(t) for t in run.t], PRINTED)
        nonideal = [block.paper_nonideal(t, v) for t, v in zip(run.t, run.v, strict=True)]
        assert_close(run.F_nonideal, nonideal, PRINTED)
        assert_multipliers_balance(block, run, nonideal)  # C lies along the plane: it is F_nonideal itself

    def test_thrown_up_to_the_turn(self):
        block = self.script.Incline(mu=0.2, beta=0.0)
        q0, v0 = block.at(0.0, -3.0)
        run = pn.simulate(block.scene(), self.script.TURN_TIME, q=q0, v=v0, **TIGHT)
        assert_close(-block.along(run.q[-1]), self.script.TURN_DISTANCE, CLOSED)
        assert_close(run.v[-1], np.zeros(2), CLOSED)

    def test_sliding_back_from_the_turn(self):
        block = self.script.Incline(mu=0.2, beta=0.0)
        q0, v0 = block.at(-self.script.TURN_DISTANCE, 0.0)
        duration = self.script.RETURN_TIME - self.script.TURN_TIME
        run = pn.simulate(block.scene(), duration, q=q0, v=v0, **TIGHT)
        assert_close(block.along(run.q[-1]), 0.0, CLOSED)
        assert_close(block.along(run.v[-1]), self.script.RETURN_SPEED, CLOSED)

    def test_friction_that_turns_round_within_a_run(self):
        """A user law may jump where the velocity changes sign: step control finds the place."""
        block = self.script.Incline(mu=0.2, beta=0.0)
        q0, v0 = block.at(0.0, -3.0)
        run = pn.simulate(block.scene(), self.script.RETURN_TIME, q=q0, v=v0, **TIGHT)
        assert_close(block.along(run.q[-1]), 0.0, LOOP)
        assert_close(block.along(run.v[-1]), self.script.RETURN_SPEED, LOOP)


@pytest.mark.parametrize("name", ["paper_a_particle", "paper_b_ring", "paper_c_incline"])
def test_scripts_print_paper_beside_computed(name, capsys):
    """Every printed difference is small: 1e-9 for the runs, whose step control is looser in the scripts."""
    example(name).main()
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].endswith("difference")
    differences = [float(line.split()[-1]) for line in lines[1:]]
    assert len(differences) >= 10
    assert max(differences) < 1e-9
