"""Each law against its closed form, another implementation of its equations, or Pinocchio's Jacobians."""

from __future__ import annotations

import itertools

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

import pin_nonideal as pn

from ...support.mechanisms import GRAVITY, TIGHT, assert_close, body, dof, empty, hinge, point_mass
from ...support.random_trees import state, tree
from ...support.small_robots import ARM, folder, joint, link, robot

# Rounding of forces and torques of size one after a few operations.
ROUNDING = 1e-14
# Error of motions at the tolerances of TIGHT, over about a hundred steps.
MOTION = 1e-10
VELOCITIES = (0.0, 1e-3, -1e-3, 0.1, -0.1, 1.0, -1.0, 40.0, -40.0)


def nonideal(scene, q, v):
    """Return C of a scene without constraints, equal to the nonideal force."""
    s = scene.solve(q, v)
    assert not s.F_ideal.any()
    return s.F_nonideal


def slider(laws, **rest):
    """Return a mass of 1 kg on a horizontal slide along x, without gravity."""
    model = empty(np.zeros(3))
    body(model, 0, pin.JointModelPX(), "mass", 1.0)
    return pn.Scene(model, laws=laws, **rest)


class TestSigmoidFriction:
    """The seven joints of the Franka Emika Panda.

    Source: cpp/panda_dyn_model_example/include/franka_model.h of marcocognetti/FrankaEmikaPandaDynModel,
    commit 24d85ce4e648e2e894c832bfeee9b16711eb1a1a; Gaz, Cognetti, Oliva, Robuffo Giordano, De Luca,
    IEEE RA-L 4 (2019) 4147-4154.
    """

    PHI1 = (0.54615, 0.87224, 0.64068, 1.2794, 0.83904, 0.30301, 0.56489)
    PHI2 = (5.1181, 9.0657, 10.136, 5.5903, 8.3469, 17.133, 10.336)
    PHI3 = (0.039533, 0.025882, -0.04607, 0.036194, 0.026226, -0.021047, 0.0035526)

    def scene(self):
        model, parent = empty(), 0
        for i in range(7):
            axis, place = np.eye(3)[i % 3], pin.SE3(np.eye(3), np.array([0.0, 0.1, 0.3]))
            parent = body(model, parent, hinge(*axis), f"j{i}", 1.0, place=place, inertia=0.1 * np.eye(3))
        numbers = zip(self.PHI1, self.PHI2, self.PHI3, strict=True)
        return pn.Scene(model, laws=[pn.SigmoidFriction(f"j{i}", *phi) for i, phi in enumerate(numbers)])

    @pytest.mark.parametrize("speed", VELOCITIES)
    def test_torques(self, speed):
        phi1, phi2, phi3 = map(np.array, (self.PHI1, self.PHI2, self.PHI3))
        for v in (np.full(7, speed), speed * np.linspace(-1.0, 1.0, 7)):
            opposing = phi1 / (1.0 + np.exp(-phi2 * (v + phi3))) - phi1 / (1.0 + np.exp(-phi2 * phi3))
            assert_close(nonideal(self.scene(), np.linspace(-1.0, 1.0, 7), v), -opposing, ROUNDING)

    def test_no_friction_at_rest(self):
        assert not nonideal(self.scene(), np.zeros(7), np.zeros(7)).any()

    def test_speeds_beyond_the_range_of_the_exponential(self):
        phi1, rest = np.array(self.PHI1), 1.0 + np.exp(-np.array(self.PHI2) * self.PHI3)
        assert_close(nonideal(self.scene(), np.zeros(7), np.full(7, 1e6)), phi1 / rest - phi1, ROUNDING)
        assert_close(nonideal(self.scene(), np.zeros(7), np.full(7, -1e6)), phi1 / rest, ROUNDING)

    def test_creeps_under_a_load(self):
        """Near rest the law is viscous, with the coefficient phi1 phi2/4 when phi3 = 0."""
        scene = slider([pn.SigmoidFriction("mass", 2.0, 50.0)], actuation=[1e-4])
        run = pn.simulate(scene, 5.0, **TIGHT)
        assert run.events == []
        assert run.v[-1, 0] == pytest.approx(1e-4 / 25.0, rel=1e-6)  # error of third order in load/phi1


class TestLuGre:
    """Against SciPy's integration of the same equations: m x'' = F(t) - k x - (s0 z + s1 z' + s2 x').

    The numbers are those of Canudas de Wit, Olsson, Astrom, Lischinsky, IEEE TAC 40 (1995), Table I, with
    m = 1 kg; the spring end of the stick-slip motion moves at 0.1 m/s, k = 2 N/m.
    """

    NUMBERS = pn.LuGre(
        "mass", 1e5, np.sqrt(1e5), coulomb=1.0, viscous=0.4, stiction=1.5, stribeck_velocity=1e-3
    )
    # Part of the largest value of each column.  Both integrate to about 1e-10, except that the absolute
    # tolerance of a law's state is the default of 1e-10, with bristles bent by 1e-5.
    CLOSE = 1e-6

    @staticmethod
    def rates(law, force, stiffness):
        def equations(t, y):
            x, v, z = y
            level = law.coulomb + (law.stiction - law.coulomb) * np.exp(-((v / law.stribeck_velocity) ** 2))
            dz = v - law.stiffness * abs(v) * z / level
            friction = law.stiffness * z + law.damping * dz + law.viscous * v
            return [v, force(t) - stiffness * x - friction, dz]

        return equations

    def compare(self, times, forces, stiffness, samples):
        springs = [pn.JointSpring("mass", stiffness)] if stiffness else []
        push = pn.Table(times, np.reshape(forces, (-1, 1)))
        scene = slider([self.NUMBERS], forces=springs, actuation=push)
        run = pn.simulate(scene, times[-1], output_dt=times[-1] / samples, rtol=1e-11, atol=1e-13)
        assert run.events == []
        equations = self.rates(self.NUMBERS, lambda t: np.interp(t, times, forces), stiffness)
        y, rows = np.zeros(3), [np.zeros((1, 3))]
        for begin, end in itertools.pairwise(times):  # the force has a kink at each time
            inside = run.t[(run.t > begin) & (run.t <= end)]
            solution = solve_ivp(
                equations, (begin, end), y, method="Radau", rtol=1e-9, atol=1e-13, t_eval=inside
            )
            y = solution.y[:, -1]
            rows.append(solution.y.T)
        expected, found = np.vstack(rows), np.hstack([run.q, run.v, run.z])
        np.testing.assert_array_less(
            np.abs(found - expected).max(axis=0), self.CLOSE * np.abs(expected).max(axis=0)
        )
        return run

    def test_presliding(self):
        """A force that swings below the level of stiction bends the bristles, with hysteresis."""
        run = self.compare((0.0, 1.0, 3.0, 5.0), (0.0, 1.425, -1.425, 1.425), 0.0, 100)
        assert np.abs(run.q).max() < 1e-4  # meters: it does not slide
        up, down = (np.abs(run.t - t).argmin() for t in (0.5, 1.65))  # at 0.7125 N both times
        assert run.q[down, 0] > 1.5 * run.q[up, 0] > 0.0

    def test_stick_slip(self):
        run = self.compare((0.0, 13.0), (0.0, 2.6), 2.0, 130)
        assert run.v.max() > 0.3
        stuck = (run.t > 11.0) & (run.t < 12.5)
        assert run.v[stuck, 0].max() < 1e-3 < run.v[run.t < 11.0, 0].max()

    def test_as_a_law_of_the_users(self):
        """Fixed steps of the same numbers, with C and dz from Python; soft bristles allow long steps."""
        law = pn.LuGre("mass", 1e3, 30.0, coulomb=1.0, viscous=0.4, stiction=1.5, stribeck_velocity=1e-2)

        def bristles(t, q, v, reactions, z):
            assert reactions is None
            level = law.coulomb + (law.stiction - law.coulomb) * np.exp(-((v / law.stribeck_velocity) ** 2))
            dz = v - law.stiffness * np.abs(v) * z / level
            return -(law.stiffness * z + law.damping * dz + law.viscous * v), dz

        runs = []
        for form in (law, pn.UserLaw(bristles, reaction=None, states=1, name="mine")):
            rest = {"forces": [pn.JointSpring("mass", 2.0)], "q0": [2.0]}
            runs.append(pn.simulate(slider([form], **rest), 5.0, method="rk4", dt=1e-3, output_dt=0.1))
        first, second = runs
        assert first.z.shape == second.z.shape == (len(first.t), 1)
        assert np.abs(first.v).max() > 0.5
        # Difference of equal arithmetic in equal steps: rounding, which friction does not amplify.
        assert_close(second.q, first.q, 1e-12)
        assert_close(second.v, first.v, 1e-12)
        assert_close(second.z, first.z, 1e-14)

    def test_tolerance_of_the_bristles(self):
        """States of laws take the one absolute tolerance, or the smallest of many."""
        law = pn.LuGre("mass", 1e3, 30.0, coulomb=1.0, stribeck_velocity=1e-2)
        runs = [
            pn.simulate(slider([law]), 0.5, v=[0.3], rtol=1e-6, atol=atol)
            for atol in (1e-5, [1e-5, 1e-5], [1e-3, 1e-5], [1e-5, 1e-9])
        ]
        np.testing.assert_array_equal(runs[1].z, runs[0].z)
        assert runs[2].stats.steps <= runs[1].stats.steps < runs[3].stats.steps


class TestDrag:
    """f = -coefficient |u|^(exponent - 1) u at a frame's origin, C = J^T f."""

    @pytest.mark.parametrize("exponent", [0.5, 1.0, 2.0, 3.7])
    @pytest.mark.parametrize("seed", range(4))
    def test_generalized_force(self, exponent, seed):
        rng = np.random.default_rng(seed)
        model = tree(("free flyer", "revolute unaligned", "endless x", "prismatic y", "spherical"), rng)
        q, v = state(model, rng)
        data, index = model.createData(), model.getFrameId("j4 tip")
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        J = pin.getFrameJacobian(model, data, index, pin.LOCAL_WORLD_ALIGNED)[:3]
        u = J @ v
        expected = -0.7 * np.linalg.norm(u) ** (exponent - 1.0) * J.T @ u
        found = nonideal(pn.Scene(model, laws=[pn.Drag("j4 tip", 0.7, exponent)]), q, v)
        assert_close(found, expected, 1e-13 * (1.0 + np.abs(expected).max()))

    @pytest.mark.parametrize("exponent", [0.5, 1.0, 2.0])
    def test_none_at_rest(self, exponent):
        scene = pn.Scene(point_mass(), laws=[pn.Drag("mass", 0.7, exponent)])
        assert not nonideal(scene, np.zeros(3), np.zeros(3)).any()

    def test_fall_against_quadratic_drag(self):
        """v = -V tanh(g t/V) and z = -(V^2/g) log cosh(g t/V), with V = sqrt(m g/c)."""
        end, c = 1.5, 0.8
        run = pn.simulate(pn.Scene(point_mass(), laws=[pn.Drag("mass", c, 2.0)]), end, **TIGHT)
        V = np.sqrt(GRAVITY / c)
        assert_close(run.v[-1], [0.0, 0.0, -V * np.tanh(GRAVITY * end / V)], MOTION)
        assert_close(run.q[-1], [0.0, 0.0, -(V**2) / GRAVITY * np.log(np.cosh(GRAVITY * end / V))], MOTION)

    def test_throw_against_linear_drag(self):
        """v = v0 exp(-c t) + g/c (exp(-c t) - 1) along each axis, for m = 1."""
        end, c, v0 = 1.5, 0.8, np.array([3.0, -1.0, 5.0])
        run = pn.simulate(pn.Scene(point_mass(), laws=[pn.Drag("mass", c)]), end, v=v0, **TIGHT)
        fall = np.array([0.0, 0.0, GRAVITY / c])
        assert_close(run.v[-1], (v0 + fall) * np.exp(-c * end) - fall, MOTION)


class TestViscous:
    """C = -viscous v, on every joint that friction may act on."""

    @pytest.mark.parametrize("kind", ["revolute", "prismatic", "helical", "spherical", "continuous"])
    def test_force(self, kind):
        joints = {
            "revolute": hinge(0.6, 0.0, 0.8),
            "prismatic": pin.JointModelPrismaticUnaligned(0.6, 0.0, 0.8),
            "helical": pin.JointModelHZ(0.2),
            "spherical": pin.JointModelSpherical(),
            "continuous": pin.JointModelRUBX(),
        }
        model = empty()
        body(model, 0, joints[kind], "pin", 1.0, lever=(0.1, 0.2, 0.3), inertia=0.1 * np.eye(3))
        v = np.array([3.0, -1.0, 0.5])[: model.nv]
        scene = pn.Scene(model, laws=[pn.JointFriction("pin", viscous=0.7)])
        assert scene.element_names == []  # no friction elements
        assert_close(nonideal(scene, pin.neutral(model), v), -0.7 * v, ROUNDING)

    def test_decay(self):
        """v = v0 exp(-c t/m)."""
        run = pn.simulate(slider([pn.JointFriction("mass", viscous=0.7)]), 3.0, v=[2.0], **TIGHT)
        assert_close(run.v[-1, 0], 2.0 * np.exp(-2.1), MOTION)
        assert_close(run.q[-1, 0], 2.0 / 0.7 * (1.0 - np.exp(-2.1)), MOTION)

    def test_hinge_anchor(self):
        """A free body that turns about an anchored axis through its center: I w' = -c w."""
        model = empty(np.zeros(3))
        body(model, 0, pin.JointModelFreeFlyer(), "wheel", 1.0, inertia=np.diag([0.2, 0.3, 0.4]))
        pivot = pn.HingeAnchor("wheel", axis="y", name="pivot")
        scene = pn.Scene(model, constraints=[pivot], laws=[pn.JointFriction("pivot", viscous=0.7)])
        run = pn.simulate(scene, 1.0, v=[0.0, 0.0, 0.0, 0.0, 2.0, 0.0], **TIGHT)
        assert_close(run.v[-1], [0.0, 0.0, 0.0, 0.0, 2.0 * np.exp(-0.7 / 0.3), 0.0], MOTION)


class TestStaticAndKinetic:
    """Sliding: -coulomb s(v) sgn v with s = 1 + (ratio - 1) exp(-(v/vs)^2); sticking up to ratio coulomb."""

    COULOMB, RATIO, SCALE, VISCOUS = 1.3, 1.6, 0.05, 0.2

    def law(self, **stribeck):
        return pn.JointFriction("mass", coulomb=self.COULOMB, static_ratio=self.RATIO, **stribeck)

    @pytest.mark.parametrize("speed", [1e-6, 0.01, 0.05, 0.12, 3.0])
    @pytest.mark.parametrize("sign", [1.0, -1.0])
    def test_stribeck_curve(self, speed, sign):
        scene = slider([self.law(stribeck_velocity=self.SCALE, viscous=self.VISCOUS)])
        level = self.COULOMB * (1.0 + (self.RATIO - 1.0) * np.exp(-((speed / self.SCALE) ** 2)))
        friction = nonideal(scene, [0.0], [sign * speed])
        assert_close(friction, [-sign * (level + self.VISCOUS * speed)], ROUNDING)

    @pytest.mark.parametrize("speed", [1e-6, 0.05, 3.0])
    def test_without_a_stribeck_velocity_the_fall_is_at_once(self, speed):
        assert_close(nonideal(slider([self.law()]), [0.0], [speed]), [-self.COULOMB], ROUNDING)

    @pytest.mark.parametrize("part", [-0.999, -0.7, 0.0, 0.7, 0.999])
    @pytest.mark.parametrize("stribeck", [{}, {"stribeck_velocity": SCALE}])
    def test_sticks_up_to_the_static_limit(self, part, stribeck):
        load = part * self.RATIO * self.COULOMB  # 0.7 is above the kinetic limit
        s = slider([self.law(**stribeck)]).solve([0.0], [0.0], tau=[load])
        assert s.modes.tolist() == [0]
        assert s.a[0] == 0.0
        assert_close(s.F_ideal + s.F_nonideal, [-load], ROUNDING)

    @pytest.mark.parametrize("sign", [1.0, -1.0])
    @pytest.mark.parametrize(("stribeck", "first"), [({}, 1.0), ({"stribeck_velocity": SCALE}, RATIO)])
    def test_lets_go_at_the_static_limit(self, sign, stribeck, first):
        """The friction that is left at once is coulomb, or static at first with a Stribeck velocity."""
        load = sign * 1.001 * self.RATIO * self.COULOMB
        s = slider([self.law(**stribeck)]).solve([0.0], [0.0], tau=[load])
        assert s.modes.tolist() == [sign]
        assert_close(s.a, [load - sign * first * self.COULOMB], ROUNDING)


def test_dynamics_tags_of_a_urdf_act(tmp_path):
    """J w' = -(f + d w): w = (w0 + f/d) exp(-d t/J) - f/d until t = (J/d) log(1 + d w0/f), and rest."""
    J, d, f, speed = 0.1, 0.3, 0.2, 4.0
    wheel = joint("spin", "base", "wheel", axis="0 0 1", inside=f'<dynamics damping="{d}" friction="{f}"/>')
    scene = pn.load(folder(tmp_path, urdf=robot(*ARM, link("wheel", inertia=J), wheel)))
    scene = pn.Scene(scene.model, laws=scene.laws)
    i, v = dof(scene, "spin"), np.zeros(scene.model.nv)
    v[i] = speed
    stop = J / d * np.log(1.0 + d * speed / f)
    half = pn.simulate(scene, 0.5 * stop, v=v, **TIGHT)
    assert_close(half.v[-1, i], (speed + f / d) * np.exp(-0.5 * d * stop / J) - f / d, MOTION)
    run = pn.simulate(scene, 2.0 * stop, v=v, **TIGHT)
    (event,) = run.events
    assert event.kind == "stick"
    assert_close(event.time, stop, MOTION)
    assert not run.v[run.t > event.time, i].any()
