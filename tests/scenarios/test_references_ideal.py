"""Motions under ideal constraints against published references and closed forms."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ..support.mechanisms import (
    GRAVITY,
    TIGHT,
    TIGHTER,
    assert_close,
    body,
    dof,
    empty,
    frame,
    hinge,
    point_mass,
    sample,
)


class TestAndrewsSqueezer:
    """Schiehlen (1990); Hairer and Wanner, Solving ODEs II, p. 530; Test Set for IVP Solvers (Bari, CWI)."""

    # 30-digit quadrature of the energy integral: angle and rate at t = 0.03 s.
    EXACT = (
        ("beta", 15.8107711951537071, 1139.92030225910606),
        ("theta", -15.7563710584118395, -1424.37929517754007),
        ("gamma", 0.0408222401196458049, 11.0329119106185937),
        ("phi", -0.534730116342079594, 19.2933741050320408),
        ("delta", 0.524409965879954069, 0.573569914829502454),
        ("omega", 0.534730116342079594, -19.2933741050320408),
        ("epsilon", 1.04808074104193787, 0.323179149249130875),
    )
    # Published accelerations at the start, exact to their digits there (Ex_andrews.f of deTestSet), in
    # the same order, and multipliers of the loop through K3 in the published sign (M a + G^T lam = f).
    A0 = (14222.443919954114, -10666.832939965585, 0.0, 0.0, 0.0, 0.0, 0.0)
    LAM0 = (98.56687039624109, -6.122688344255662)

    @pytest.mark.parametrize(("tolerances", "q_abs"), [(TIGHT, 1e-11), ({"rtol": 1e-9, "atol": 1e-9}, 1e-9)])
    def test_end_state(self, tolerances, q_abs):
        scene = pn.load("andrews_squeezer")
        run = pn.simulate(scene, 0.03, **tolerances)
        for joint, angle, rate in self.EXACT:
            assert_close(run.q[-1, dof(scene, joint)], angle, q_abs)
            assert_close(run.v[-1, dof(scene, joint)], rate, 1e3 * q_abs)  # rates of a thousand rad/s
        assert run.violation.max() < 1e-12

    def test_start(self):
        scene = pn.load("andrews_squeezer")
        s = scene.solve(*scene.initial_state())
        for (joint, *_), a in zip(self.EXACT, self.A0, strict=True):
            # Twelve digits: the printed start closes the loops to 1e-16 m, which accelerations magnify.
            assert_close(s.a[dof(scene, joint)], a, 1e-12 * self.A0[0])
        loop = s.lam[scene.constraint_slices["loop K3"]]
        assert_close(np.linalg.norm(loop), np.linalg.norm(self.LAM0), 1e-9)


class TestNFourBar:
    """IFToMM A02: all cranks parallel turn as one pendulum, through a singular position each half turn.

    Bayo and Avello, Nonlinear Dynamics 5 (1994) 209-231; exact solution by Jacobi functions of
    I phi'^2/2 + P cos phi = E with I = (N+1) m L^2/3 + N m L^2 and P = ((N+1)/2 + N) m g L.
    """

    # N, t, phi, velocity of B0.
    EXACT = (
        (1, 1.0, 3.4053529879370579, (-6.6378094961217514, 1.7925539703889306)),
        (1, 4.0, 12.726003230252474, (1.125395047766197, -0.18119145112531924)),
        (1, 10.0, 31.9147412977380245, (1.7272640755471536, -0.94095217937151564)),
        (2, 1.0, 3.33787080310509773, (-6.6766780368811581, 1.3275783251604872)),
        (2, 4.0, 12.6842595935139719, (1.0690392650289686, -0.12661504916672028)),
        (2, 10.0, 31.7505971869861018, (1.4230514702069441, -0.49486884548704296)),
        (40, 1.0, 3.25720692490981343, (-6.6699875239417716, 0.77460009866234332)),
        (40, 4.0, 12.6357683369214925, (1.0238043879877688, -0.071163972510921743)),
        (40, 10.0, 31.5974337439857377, (1.1484412774694141, -0.21077006677942393)),
    )
    POSITION = 1e-7  # error of the reference

    def check(self, N, tolerance, position):
        scene = pn.load("n_four_bar", N=N)
        run = pn.simulate(scene, 10.0, output_dt=1.0, rtol=tolerance, atol=tolerance)
        cranks = [dof(scene, f"crank{i}") for i in range(N + 1)]
        for _, t, phi, velocity in (row for row in self.EXACT if row[0] == N):
            k = sample(run, t)
            assert_close(run.q[k, cranks], phi, position)
            angle, rate = run.q[k, cranks], run.v[k, cranks]
            # Rates follow angles through phi'' / phi', at most ten times.
            assert_close(rate * np.cos(angle), velocity[0], 10.0 * position)
            assert_close(-rate * np.sin(angle), velocity[1], 10.0 * position)
        assert run.violation.max() < 1e-11

    @pytest.mark.parametrize("N", [1, 2, 40])
    def test_reference(self, N):
        self.check(N, 1e-12, self.POSITION)

    @pytest.mark.parametrize("tolerance", [1e-8, 1e-9, 1e-10, 1e-11, 1e-13])
    @pytest.mark.parametrize("N", [1, 2, 40])
    def test_parallel_branch_is_kept_at_any_tolerance(self, N, tolerance):
        """Errors near a singular position are multiplied on the way out, ten times in these ten seconds."""
        self.check(N, tolerance, 1e4 * tolerance + self.POSITION)


class TestSimplePendulum:
    """IFToMM A01: x^2 + y^2 = L^2 under gravity, from rest at the horizontal; Jacobi closed form."""

    EXACT = (  # t, x, y, vx, vy
        (1.0, 0.986291751131875319, -0.165010853125541169, 0.296905515916315822, 1.77464364111265563),
        (5.0, -0.942305435043757335, -0.334754338414000581, 0.857904256885949073, -2.41492865437048862),
        (9.99, -0.316436469913032291, -0.948613704575776519, 4.09245199149402074, -1.36515112024030471),
        (10.0, -0.27508746257611686, -0.961419205099125064, 4.17559810095172884, -1.19474905456047527),
    )
    ABS = 1e-10

    @staticmethod
    def circle():
        return pn.UserConstraint(
            lambda t, q, v, data: (q[None, :], [-v @ v]),
            1,
            residual=lambda t, q: [0.5 * (q @ q - 1.0)],
            rate=lambda t, q, v: [q @ v],
        )

    def check(self, scene, columns, **options):
        run = pn.simulate(scene, 10.0, output_dt=0.01, **{**TIGHT, **options})
        for t, *state in self.EXACT:
            k = sample(run, t)
            assert_close([*run.q[k, columns], *run.v[k, columns]], state, self.ABS)
        assert run.violation.max() < 1e-12

    def test_distance_in_space(self):
        scene = pn.Scene(point_mass(), constraints=[pn.Distance("mass", "origin")], q0=[-1.0, 0.0, 0.0])
        self.check(scene, [0, 2])

    def test_distance_in_the_plane(self):
        rod = pn.Distance("origin", "mass", length=1.0)
        scene = pn.Scene(point_mass("XZ"), constraints=[rod], q0=[-1.0, 0.0])
        self.check(scene, [0, 1])

    @pytest.mark.parametrize("options", [TIGHT, {**TIGHTER, "method": "dopri5"}])
    def test_user_constraint(self, options):
        scene = pn.Scene(point_mass("XZ"), constraints=[self.circle()], q0=[-1.0, 0.0])
        self.check(scene, [0, 1], **options)

    def test_distance_on_a_planar_joint(self):
        model = empty((0.0, -GRAVITY, 0.0))
        body(model, 0, pin.JointModelPlanar(), "mass", 1.0, inertia=0.1 * np.eye(3))
        frame(model, "origin", 0)
        scene = pn.Scene(model, constraints=[pn.Distance("mass", "origin")], q0=[-1.0, 0.0, 1.0, 0.0])
        self.check(scene, [0, 1])

    def test_minimal_coordinates(self):
        model = empty()
        body(model, 0, hinge(0.0, -1.0, 0.0), "pivot", 1.0, lever=(0.0, 0.0, -1.0))
        run = pn.simulate(pn.Scene(model, q0=[-0.5 * np.pi]), 10.0, output_dt=0.01, **TIGHT)
        for t, x, y, vx, vy in self.EXACT:
            k = sample(run, t)
            angle, rate = run.q[k, 0], run.v[k, 0]
            position, velocity = (np.sin(angle), -np.cos(angle)), (rate * np.cos(angle), rate * np.sin(angle))
            assert_close([*position, *velocity], (x, y, vx, vy), self.ABS)


class TestLightCartPole:
    """Cart of 1 mg under a pole of 1 kg: M is nearly singular at the bottom, crossed in a spike of 1 us.

    Noah-Parsons, light-cartpole-benchmark, proposed for the IFToMM library; closed form
    theta'^2 = 2 g (M + m)(cos th - cos th0)/(l (M + m sin^2 th)), x = m l (sin th0 - sin th)/(M + m).
    """

    CART, POLE = 1e-6, 1.0
    # 40-digit quadrature: time, x, theta; t = 5.87 s lies in the spike.
    EXACT = (
        (0.45, 0.88410447424969753492, 0.11615566354008314593),
        (5.0, 0.48673208655541193259, 0.53898764971035120304),
        (5.87, 1.0399732048568950956, -0.039984898568490593944),
        (10.0, 1.9997632824687276547, -1.5491294418948281698),
    )
    # Levels of the benchmark for e = sqrt(mean[(x - x_ref)^2 + (th - th_ref)^2]) over 1001 samples.
    ACCEPTED, GOOD = 1e-6, 1e-9

    def motion(self, times):
        """x and theta by inverting t = integral of d theta / theta', substituted to be smooth at the ends."""
        nodes, weights = np.polynomial.legendre.leggauss(80)
        nodes, weights = 0.5 * (nodes + 1.0), 0.5 * weights
        M, m, width, split = self.CART, self.POLE, np.sqrt(self.CART / self.POLE), 0.5

        def slowness(a):
            return np.sqrt((M + m * np.sin(a) ** 2) / (2.0 * GRAVITY * (M + m)))

        def from_bottom(a):  # angle = width sinh y
            top = np.arcsinh(a / width)
            x = width * np.sinh(top[:, None] * nodes)
            speed = slowness(x) / np.sqrt(np.cos(x)) * width * np.cosh(top[:, None] * nodes)
            return (speed * weights).sum(axis=1) * top

        def to_top(a):  # angle = pi/2 - w^2
            top = np.sqrt(np.maximum(0.5 * np.pi - a, 1e-300))
            w = top[:, None] * nodes
            speed = slowness(0.5 * np.pi - w * w) * 2.0 * w / np.sqrt(np.sin(w * w))
            return (speed * weights).sum(axis=1) * top

        edge = np.array([split])
        quarter = float(from_bottom(edge)[0] + to_top(edge)[0])
        turns, rest = np.divmod(times, quarter)
        falling = turns % 2 == 0
        since_bottom = np.where(falling, quarter - rest, rest)
        low, high = np.zeros_like(times), np.full_like(times, 0.5 * np.pi)
        for _ in range(60):  # halved to rounding
            middle = 0.5 * (low + high)
            t = np.where(middle < split, from_bottom(np.minimum(middle, split)), quarter - to_top(middle))
            low, high = np.where(t < since_bottom, middle, low), np.where(t < since_bottom, high, middle)
        theta = np.where(np.isin(turns % 4, (0, 3)), low, -low)
        return m * (1.0 - np.sin(theta)) / (M + m), theta

    def error(self, run, theta):
        x, angle = self.motion(run.t)
        assert len(run.t) == 1001
        return np.sqrt(np.mean((run.q[:, 0] - x) ** 2 + (theta - angle) ** 2))

    def test_reference(self):
        """The quadrature here meets the printed 40-digit rows."""
        t, x, theta = np.array(self.EXACT).T
        assert_close(self.motion(t), (x, theta), 1e-12)

    def test_minimal_coordinates(self):
        model = empty()
        cart = body(model, 0, pin.JointModelPX(), "cart", self.CART)
        body(model, cart, hinge(0.0, -1.0, 0.0), "pole", self.POLE, lever=(0.0, 0.0, -1.0))
        run = pn.simulate(pn.Scene(model, q0=[0.0, 0.5 * np.pi]), 10.0, output_dt=0.01, **TIGHT)
        # M + m - m cos^2 keeps ten digits in double precision, so the coordinates limit the error to 1e-8.
        assert self.error(run, run.q[:, 1]) < 0.1 * self.ACCEPTED

    def test_dependent_coordinates(self):
        """With the rod as a constraint M is diagonal, and nothing is lost."""
        model = empty()
        body(model, 0, pin.JointModelPX(), "cart", self.CART)
        slide = body(model, 0, pin.JointModelPX(), "bob_x", 0.0)
        body(model, slide, pin.JointModelPZ(), "bob", self.POLE)
        scene = pn.Scene(model, constraints=[pn.Distance("bob", "cart")], q0=[0.0, 1.0, 0.0])
        run = pn.simulate(scene, 10.0, output_dt=0.01, **TIGHT)
        theta = np.arctan2(run.q[:, 1] - run.q[:, 0], -run.q[:, 2])
        assert self.error(run, theta) < self.GOOD
        assert run.violation.max() < 1e-12


def test_chaplygin_sleigh():
    """v' = a w^2, w' = -b v w: speed as tanh and turn rate as sech of time (m = 1, I = 0.2, a = 0.3)."""
    scene = pn.load("knife_edge_sleigh")
    run = pn.simulate(scene, 5.0, record="energy", **TIGHT)
    x, y, heading = run.q[-1]
    vx, vy, rate = run.v[-1]
    along = vx * np.cos(heading) + vy * np.sin(heading)
    assert_close((along, rate), (1.1874297330598405, 0.00605407968349997), 1e-11)  # 1e-9 asked
    assert_close((heading, x, y), (2.034550223993275, -1.0070117444098092, 5.029786648193333), 1e-11)
    assert_close(run.energy["balance"], 0.0, 1e-12)


@pytest.mark.parametrize("with_rate", [True, False])
def test_appell_hamel(with_rate):
    """x'^2 + y'^2 = a^2 z'^2, nonlinear in the velocities: the direction stays, z'' = -g/(1 + a^2)."""
    square = 0.7**2

    def rows(t, q, v, data):
        return [[v[0], v[1], -square * v[2]]], [0.0]

    def rate(t, q, v):
        return [0.5 * (v[0] ** 2 + v[1] ** 2 - square * v[2] ** 2)]

    cone = pn.UserConstraint(rows, 1, rate=rate if with_rate else None)
    start = (0.21 * np.cos(0.4), 0.21 * np.sin(0.4), -0.3)
    run = pn.simulate(pn.Scene(point_mass(), constraints=[cone], v0=start), 2.0, **TIGHT)
    expected = (8.876678967572234, 3.752999672405208, -13.46778523489933)
    assert_close((*run.q[-1, :2], run.v[-1, 2]), expected, 1e-10)
    assert_close([rate(*state) for state in zip(run.t, run.q, run.v, strict=True)], 0.0, 1e-12)


def test_spherical_pendulum():
    """Conical motion at polar angle 1: Omega = sqrt(g/(l cos th)), tension m g/cos th, for ten turns."""
    theta, turn_rate, tension = 1.0, 4.261044729928317, 18.15650219044988
    start, across = (np.sin(theta), 0.0, -np.cos(theta)), (0.0, turn_rate * np.sin(theta), 0.0)
    scene = pn.Scene(point_mass(), constraints=[pn.Distance("mass", "origin")], q0=start, v0=across)
    run = pn.simulate(scene, 20.0 * np.pi / turn_rate, record=("forces", "energy"), **TIGHT)
    assert_close(np.arctan2(np.hypot(run.q[:, 0], run.q[:, 1]), -run.q[:, 2]), theta, 1e-11)
    assert_close(run.q[-1], start, 1e-10)
    assert_close(run.energy["total"], run.energy["total"][0], 1e-11)
    assert_close(run.q[:, 0] * run.v[:, 1] - run.q[:, 1] * run.v[:, 0], turn_rate * np.sin(theta) ** 2, 1e-11)
    assert_close(run.lam[:, 0], -tension, 1e-10)  # a pull


class TestRollingDisk:
    """Steady rolling: (5/4) Om^2 sin th cos th + (3/2) Om s cos th + (g/R) sin th = 0, textbook relation."""

    R = 0.5
    STEADY = (  # lean, yaw rate, spin: Euler disk at 0.3 and 0.8 rad to the floor, then two circles
        (0.5 * np.pi - 0.3, 16.296183499088283, -15.568338730165634),
        (0.5 * np.pi - 0.8, 10.45952836726495, -7.287223590080493),
        (0.2, 1.5, -2.0159681731294583),
        (0.5, -2.0, 4.371860847918718),
    )

    def state(self, lean, yaw_rate, spin):
        q = np.array([0.0, 0.0, self.R * np.cos(lean), 0.0, lean, 0.0])
        speed = self.R * (yaw_rate * np.sin(lean) + spin)
        return q, np.array([speed, 0.0, 0.0, yaw_rate, 0.0, spin])

    @pytest.mark.parametrize("steady", STEADY)
    def test_accelerations(self, steady):
        q, v = self.state(*steady)
        a = pn.load("rolling_disk").solve(q, v).a
        assert_close(a, [0.0, v[0] * v[3], 0.0, 0.0, 0.0, 0.0], 1e-10)

    @pytest.mark.parametrize("steady", STEADY)
    def test_motion_repeats(self, steady):
        """The center runs a circle, the lean stays, for one turn; slow circles are unstable, so no longer."""
        q, v = self.state(*steady)
        yaw_rate, radius = v[3], v[0] / v[3]
        run = pn.simulate(pn.load("rolling_disk"), 2.0 * np.pi / abs(yaw_rate), q=q, v=v, **TIGHT)
        turn = yaw_rate * run.t
        circle = np.column_stack([radius * np.sin(turn), radius * (1.0 - np.cos(turn))])
        assert_close(run.q[:, :2], circle, 1e-9)
        assert_close(run.q[:, 2:], q[2:] + np.outer(run.t, [0.0, yaw_rate, 0.0, v[5]]), 1e-9)
        assert_close(run.v[:, 3:], np.broadcast_to(v[3:], (len(run), 3)), 1e-9)
        assert run.violation.max() < 1e-12

    def test_upright_disk(self):
        """Held upright, a disk turns at any rates: the center runs a circle of radius R |s/Om|."""
        robot = pn.load("rolling_disk")
        q, v = self.state(0.0, 1.5, -3.0)
        upright = pn.PrescribedMotion("lean", pn.constant(0.0))
        scene = pn.Scene(robot.model, constraints=[*robot.constraints, upright], q0=q, v0=v)
        run = pn.simulate(scene, 5.0, record="forces", **TIGHT)
        radius = self.R * 3.0 / 1.5
        assert_close(np.linalg.norm(run.q[:, :2] - [0.0, -radius], axis=1), radius, 1e-11)
        assert_close(run.lam[:, 2], 2.0 * GRAVITY, 1e-10)  # the normal force carries the disk's weight


def test_balls_that_roll_on_a_pushed_box():
    """SimBenchmark's rolling test (leggedrobotics): 25 balls roll on a box that slides on rough ground.

    f2 = (F - f1)/M / (3.5/m + n/M) with f1 = mu (M + n m) g; accelerations are constant in time.
    """
    model = empty()
    joint = 0
    for axis in "XYZ":
        slide = getattr(pin, f"JointModelP{axis}")()
        joint = body(model, joint, slide, f"box_{axis}", 10.0 if axis == "Z" else 0.0)
    for side, height in (("bottom", -0.5), ("top", 0.5)):
        frame(model, side, joint, pin.SE3(np.eye(3), np.array([0.0, 0.0, height])))
    q0, rolls = [0.0, 0.0, 0.5], []
    for i in range(25):
        body(model, 0, pin.JointModelFreeFlyer(), f"ball{i}", 1.0, inertia=0.4 * 0.25 * np.eye(3))
        q0 += [2.0 * (i % 5) - 4.0, 2.0 * (i // 5) - 4.0, 1.5, 0.0, 0.0, 0.0, 1.0]
        rolls.append(pn.Rolling(f"ball{i}", 0.5, axis=None, plane="top"))
    along = np.array([0.5, np.sqrt(0.75), 0.0])
    push = pn.Wrench("top", [*(150.0 * along), 0.0, 0.0, 0.0])
    ground = pn.PointContact("bottom", mu=0.4)
    scene = pn.Scene(model, constraints=rolls, contacts=[ground], forces=[push], q0=q0)
    run = pn.simulate(scene, 4.0, **TIGHT)
    assert_close(run.v[-1, :3], 2.954 * along, 1e-9)
    for i in range(25):
        turned = pin.Quaternion(run.q[-1, 7 * i + 6 : 7 * i + 10]).toRotationMatrix()
        assert_close(turned @ run.v[-1, 6 * i + 3 : 6 * i + 6], 0.844 * along, 1e-9)
