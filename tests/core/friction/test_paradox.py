"""Painleve paradox: beyond a closed-form friction threshold there is no solution or several.

The implicit equation is y = g(y), with the friction limit y and the limit g(y) of the motion under y.  For
one element g has the slopes -mu k and mu k: there is one solution if mu k < 1, and none or two beyond.
The determinant of the error is 1 - mu k.
"""

from __future__ import annotations

import re

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ...support.mechanisms import GRAVITY, body, empty, frame, hinge

# The core differentiates the reaction equation by differences with relative steps of 1e-7.
DETERMINANT = 1e-6
# A run near the threshold halves its steps until the determinant's error remains.
THRESHOLD = 1e-6
# Below the threshold the equation is solved to rounding, which its condition 1/(1 - mu k) magnifies; the case
# nearest to the threshold has 1 - mu k = 1e-4.
NEAR = 1e-4
SOLVED = 1e-13 / NEAR


class Rod:
    """A uniform rod, half its length h, that slides with its lower end on the ground at the angle th to it.

    N (1/m + (h c)^2/J) - T h^2 s c/J = g - h s w^2 and T = -mu |N| sgn(u) at the lower end, so that
    N = (g - h s w^2)/(p + sgn(u) mu r), p = 1/m + (h c)^2/J, r = h^2 s c/J, and k = r/p.
    """

    MASS, HALF = 2.0, 0.5
    J = MASS * HALF**2 / 3.0
    TURN = 0.3  # rate of turning [rad/s]

    def __init__(self, angle):
        self.angle = angle
        s, c = np.sin(angle), np.cos(angle)
        self.p = 1.0 / self.MASS + (self.HALF * c) ** 2 / self.J
        self.k = self.HALF**2 * s * c / self.J / self.p
        self.free = GRAVITY - self.HALF * s * self.TURN**2

    def normal(self, mu, sense):
        """Normal force while sliding in the sense +1 or -1 [N]."""
        return self.free / self.p / (1.0 + sense * mu * self.k)

    def state(self, sense):
        return [0.0, 0.0, self.angle], [0.7 * sense, 0.0, self.TURN]

    def model(self):
        model = empty()
        x = body(model, 0, pin.JointModelPX(), "x", 0.0)
        z = body(model, x, pin.JointModelPZ(), "z", 0.0)
        inertia = np.diag([1e-3, self.J, self.J])
        turn = body(
            model, z, hinge(0.0, -1.0, 0.0), "turn", self.MASS, lever=(self.HALF, 0.0, 0.0), inertia=inertia
        )
        frame(model, "tip", turn)
        frame(model, "ground", 0)
        return model

    def contact(self, mu, unilateral=False):
        """The ground as a contact with friction, kept as in a groove unless it may open."""
        tip = pn.PointContact("tip", mu=mu, unilateral=unilateral, name="ground")
        return pn.Scene(self.model(), contacts=[tip])

    def user_law(self, mu):
        """The same friction, known to the package only as a function of the reactions."""
        ground = pn.PointAnchor("tip", "ground", axes="z", name="ground")

        def rub(t, q, v, reactions):
            return [-mu * abs(reactions["ground"][0]) * np.sign(v[0]), 0.0, 0.0]

        return pn.Scene(self.model(), constraints=[ground], laws=[pn.UserLaw(rub, name="rub")])

    def user_friction(self, mu):
        """The same friction as the user's own limit along the user's own direction."""
        ground = pn.PointAnchor("tip", "ground", axes="z", name="ground")
        rub = pn.UserFriction(
            lambda t, q: [1.0, 0.0, 0.0],
            lambda t, q, v, reactions: mu * abs(reactions["ground"][0]),
            name="rub",
        )
        return pn.Scene(self.model(), constraints=[ground], laws=[rub])


ANGLES = (0.5, 1.1, 1.3)
WAYS = [(Rod.contact, "ground"), (Rod.user_law, "rub"), (Rod.user_friction, "rub")]


def raises(element, found=""):
    """The paradox, which shows "no solution", "several solutions", or "no solution or several"."""
    words = f'friction of "{element}" has {found}' + (" at t = 0 s: " if found else "")
    return pytest.raises(pn.FrictionParadoxError, match=re.escape(words))


class TestRod:
    @pytest.mark.parametrize("sense", [-1, 1])
    @pytest.mark.parametrize("angle", ANGLES)
    @pytest.mark.parametrize(("way", "element"), WAYS)
    def test_one_solution_below_the_threshold(self, way, element, angle, sense):
        rod = Rod(angle)
        for share in (0.1, 0.5, 0.9, 1.0 - NEAR):
            s = way(rod, share / rod.k).solve(*rod.state(sense))
            assert s.lam[0] == pytest.approx(rod.normal(share / rod.k, sense), rel=SOLVED)

    @pytest.mark.parametrize("sense", [-1, 1])
    @pytest.mark.parametrize("angle", ANGLES)
    @pytest.mark.parametrize(("way", "element"), WAYS)
    def test_none_or_two_beyond_it(self, way, element, angle, sense):
        """A rod that slides against its lean has no motion; in the other direction there are two."""
        rod = Rod(angle)
        none = (
            "no solution" if way is Rod.contact else "no solution or several"
        )  # user functions have no diagnostics
        for share in (1.0 + NEAR, 1.1, 1.7, 3.0):
            with raises(element, "several solutions" if sense > 0 else none) as caught:
                way(rod, share / rod.k).solve(*rod.state(sense))
            assert len(caught.value.solutions) == len(caught.value.limits) == (2 if sense > 0 else 0)
            assert caught.value.time == 0.0
            assert caught.value.element == element
            assert caught.value.determinant == pytest.approx(1.0 - share, abs=DETERMINANT)

    @pytest.mark.parametrize("angle", ANGLES)
    def test_a_tip_that_may_open_does_not_pull(self, angle):
        """A unilateral contact excludes pulling: one motion is left away from the lean, none against it."""
        rod = Rod(angle)
        for share in (0.1, 0.9, 1.0, 1.0 + NEAR, 1.1, 3.0):
            s = rod.contact(share / rod.k, unilateral=True).solve(*rod.state(1))
            assert s.lam[0] == pytest.approx(rod.normal(share / rod.k, 1), rel=SOLVED)
            assert s.unique
            if share > 1.0:
                with raises("ground", "no solution"):
                    rod.contact(share / rod.k, unilateral=True).solve(*rod.state(-1))

    @pytest.mark.parametrize("angle", ANGLES)
    @pytest.mark.parametrize(("way", "element"), WAYS)
    def test_the_threshold_itself_is_a_paradox(self, way, element, angle):
        """The unique solution diverges at the threshold, within the error of the determinant."""
        rod = Rod(angle)
        for beyond in (0.0, 1e-16, -1e-16, 1e-13, -1e-13, 1e-10, -1e-10, 1e-9, -1e-9):
            with raises(element) as caught:
                way(rod, (1.0 + beyond) / rod.k).solve(*rod.state(-1))
            assert abs(caught.value.determinant) < DETERMINANT

    def test_on_the_ideal_reaction_there_is_no_paradox(self):
        """The law of the paper depends on ideal reactions, which friction does not change."""
        rod = Rod(1.1)
        ground = pn.PointAnchor("tip", "ground", axes="z", name="ground")

        def rub(t, q, v, reactions):
            return [-2.0 / rod.k * abs(reactions["ground"][0]) * np.sign(v[0]), 0.0, 0.0]

        law = pn.UserLaw(rub, reaction="ideal", name="rub")
        s = pn.Scene(rod.model(), constraints=[ground], laws=[law]).solve(*rod.state(-1))
        ideal = rod.free / rod.p
        assert s.lam[0] == pytest.approx(ideal * (1.0 + 2.0), rel=1e-12)


class Ladder:
    """Two slides joined by a rod of length L, one along x with friction in its guide, one pushed along z.

    With tension T in the rod at the angle th, the guide is pressed by s |T|:
    T (c^2/m + s^2/M) + sgn(u) mu c s |T|/m = s F/M + w^2/L, so k = (s c/m)/(c^2/m + s^2/M).
    """

    LIGHT, HEAVY, LENGTH, SPEED = 1.0, 3.0, 0.8, 0.4

    def __init__(self):
        self.angle = 1.2
        s, c = np.sin(self.angle), np.cos(self.angle)
        self.D = c**2 / self.LIGHT + s**2 / self.HEAVY
        self.k = s * c / self.LIGHT / self.D
        rates = np.array([self.SPEED, -self.SPEED * c / s])  # c u + s w = 0 with the rod along (-c, s)
        self.square = (rates @ rates) / self.LENGTH

    def scene(self, mu, push):
        model = empty(gravity=(0.0, 0.0, 0.0))
        foot = body(model, 0, pin.JointModelPX(), "foot", self.LIGHT)
        head = body(model, 0, pin.JointModelPZ(), "head", self.HEAVY)
        frame(model, "foot end", foot)
        frame(model, "head end", head)
        rod = pn.Distance("foot end", "head end", length=self.LENGTH, name="rod")
        guide = pn.JointFriction("foot", mu=mu, name="guide")
        return pn.Scene(model, constraints=[rod], laws=[guide], actuation=np.array([0.0, push]))

    def state(self, sense):
        s, c = np.sin(self.angle), np.cos(self.angle)
        q = self.LENGTH * np.array([c, s])
        return q, sense * self.SPEED * np.array([1.0, -c / s])

    def foot_acceleration(self, mu, push, sense):
        s, c = np.sin(self.angle), np.cos(self.angle)
        right = s * push / self.HEAVY + self.square
        T = right / (self.D + np.sign(right) * sense * mu * s * c / self.LIGHT)
        return (-c * T - sense * mu * s * abs(T)) / self.LIGHT


class TestLadder:
    @pytest.mark.parametrize("sense", [-1, 1])
    @pytest.mark.parametrize("push", [-20.0, 20.0])
    def test_one_solution_below_the_threshold(self, push, sense):
        ladder = Ladder()
        for share in (0.1, 0.5, 0.9, 1.0 - NEAR):
            mu = share / ladder.k
            s = ladder.scene(mu, push).solve(*ladder.state(sense))
            assert s.a[0] == pytest.approx(ladder.foot_acceleration(mu, push, sense), rel=SOLVED)

    @pytest.mark.parametrize("sense", [-1, 1])
    @pytest.mark.parametrize("push", [-20.0, 20.0])
    def test_none_or_two_beyond_it(self, push, sense):
        ladder = Ladder()
        for share in (1.0 + NEAR, 1.1, 1.7, 3.0):
            with raises("guide", "several solutions" if sense * push > 0.0 else "no solution") as caught:
                ladder.scene(share / ladder.k, push).solve(*ladder.state(sense))
            assert caught.value.element == "guide"
            assert caught.value.determinant == pytest.approx(1.0 - share, abs=DETERMINANT)


def block_that_grows_rough(start, growth):
    """A sliding block that friction lifts a little: N = m g/(1 + mu k), k = 1/2, mu k = start + growth t."""
    model = empty()
    x = body(model, 0, pin.JointModelPX(), "x", 0.0)
    z = body(model, x, pin.JointModelPZ(), "z", 1.0)
    frame(model, "block", z)
    frame(model, "ground", 0)
    ground = pn.PointAnchor("block", "ground", axes="z", name="ground")

    def limit(t, q, v, reactions):
        return 2.0 * (start + growth * t) * abs(reactions["ground"][0])

    rub = pn.UserFriction(lambda t, q: [1.0, -0.5], limit, name="rub")
    return pn.Scene(model, constraints=[ground], laws=[rub], v0=[50.0, 0.0])


class TestRuns:
    """A run ends at the onset of the paradox and keeps its samples."""

    @pytest.mark.parametrize("method", ["dop853", "dopri5"])
    def test_at_the_time_of_the_threshold(self, method):
        """The motion is smooth at mu k = 1, where a second motion appears."""
        start, growth = 0.8, 0.4
        threshold = (1.0 - start) / growth
        scene = block_that_grows_rough(start, growth)
        with pytest.raises(pn.FrictionParadoxError) as caught:
            pn.simulate(scene, 2.0, method=method)
        error, kept = caught.value, caught.value.trajectory
        assert error.element == "rub"
        assert -THRESHOLD < error.determinant <= 0.0
        assert error.time == pytest.approx(threshold, abs=THRESHOLD)
        assert kept.t[-1] == pytest.approx(threshold, abs=THRESHOLD)
        assert str(error).endswith("; the trajectory up to this time is in error.trajectory")
        for i in np.flatnonzero(kept.t < threshold - NEAR / growth):
            lam = scene.solve(kept.q[i], kept.v[i], t=kept.t[i]).lam[0]
            assert lam == pytest.approx(GRAVITY / (1.0 + start + growth * kept.t[i]), rel=SOLVED)

    def test_from_the_start(self):
        rod = Rod(1.1)
        q, v = rod.state(-1)
        with raises("ground", "no solution") as caught:
            pn.simulate(rod.contact(1.5 / rod.k), 1.0, q=q, v=v)
        assert caught.value.time == 0.0
        assert len(caught.value.trajectory) == 0
