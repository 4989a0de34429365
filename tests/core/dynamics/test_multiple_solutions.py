"""Load-dependent friction admits one motion, none or several, and the result reports which case holds.

For one element the image g of its limit is convex, so that y = g(y) has two solutions at most; g has lengths
of vectors in it, not sizes of numbers, and neither of two solutions need lie near the kink of a branch.
"""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from oracles.reaction_equation import acceleration, equation

from ...support.mechanisms import body, empty, frame
from ...support.random_loaded_joints import random_scene
from ...support.seeds import seeds

# The oracle's roots and the core's carry the rounding of one linear solution, magnified by 1/det(I - dg/dy),
# which is 1e4 at most in cases that are not in doubt.
SAME = 1e-7
# Error of the event time: the determinant is zero within rounding if the slope of g is within 1e-8 of one,
# and the slope grows by 0.25 per second.
INSTANT = 5e-8


def told(scene, q, v):
    """Return the number of solutions of `solve`, their accelerations, and the limits of several solutions."""
    try:
        s = scene.solve(q, v)
        return {True: "one", None: "not shown"}[s.unique], [s.a], []
    except pn.FrictionParadoxError as error:
        found = re.search("has (no solution|several solutions|no solution or several) at", str(error))[1]
        kind = {"no solution": "none", "several solutions": "two"}.get(found, "edge")
        return kind, error.solutions, error.limits


def check_random(seed):
    rng = np.random.default_rng([13, seed])
    scene, q, v = random_scene(rng)
    found, motions, limits = told(scene, q, v)
    equations = equation(scene, q, v)
    if equations.leaves_unloaded():
        return "unloaded"
    roots, doubtful = equations.roots(rng, others=limits)
    if doubtful:
        return "doubtful"
    expected = [acceleration(scene, q, v, y) for y in roots]
    assert found == ("none", "one", "two")[min(len(roots), 2)], f"seed {seed}: {len(roots)} solutions"
    for a in motions:
        apart = min(np.abs(a - b).max() / (1e-9 + np.abs(b).max()) for b in expected)
        assert apart < SAME, f"seed {seed}"
    return found


@pytest.mark.parametrize("seed", seeds(range(60)))
def test_random_loaded_joints(seed):
    check_random(seed)


@pytest.mark.stress
@pytest.mark.parametrize("seeds", list(pairwise(range(60, 10_161, 100))))
def test_ten_thousand_loaded_joints(seeds):
    found = [check_random(seed) for seed in range(*seeds)]
    assert found.count("doubtful") < 3
    print({kind: found.count(kind) for kind in sorted(set(found))})


class Drawer:
    """A drawer of 1 kg without weight, pushed along x and z at its center, which lies 4 m above its guide.

    y = mu |m| with m = 4 (y - cos th) / span about the guide and sin th across it:
    y = 0.3 |(4 y + cos th, sin th)|.
    """

    ANGLE = np.deg2rad(140.0)

    def scene(self, mu=0.3):
        model = empty((0.0, 0.0, 0.0))
        inertia = 1e-3 * np.eye(3)
        index = body(model, 0, pin.JointModelPX(), "j", 1.0, lever=(0.0, 0.0, 4.0), inertia=inertia)
        frame(model, "middle", index)
        push = pn.Wrench("middle", [0.0, 0.0, 0.0, 0.0, np.cos(self.ANGLE), np.sin(self.ANGLE)])
        law = pn.JointFriction("j", mu=mu, span=1.0, name="guide")
        return pn.Scene(model, laws=[law], v0=[1.0], forces=[push])

    def limits(self, mu=0.3):
        """Both solutions of (1 - 16 mu^2) y^2 - 8 mu^2 cos th y - mu^2 = 0."""
        c = np.cos(self.ANGLE)
        return np.sort(np.roots([1.0 - 16.0 * mu**2, -8.0 * mu**2 * c, -(mu**2)]).real)


class TestDrawer:
    def test_the_error_shows_both(self):
        drawer = Drawer()
        small, large = drawer.limits()
        words = (
            f'friction of "guide" has several solutions at t = 0 s: limits of {small:.4g} and {large:.4g} '
            "(N m or N), det(I - d lam'/d lam) = -0.18; continue with the nearer one by "
            'several="continue", reduce mu, or use reaction="ideal"'
        )
        with pytest.raises(pn.FrictionParadoxError, match=re.escape(words)) as caught:
            drawer.scene().solve([0.0], [1.0])
        np.testing.assert_allclose(np.ravel(caught.value.limits), [small, large], rtol=1e-12)
        np.testing.assert_allclose(np.ravel(caught.value.solutions), [-small, -large], rtol=1e-12)
        for refused in (
            lambda s: s.acceleration([0.0], [1.0]),
            lambda s: pn.simulate(s, 1.0),
            lambda s: pn.rollout(s, [[0.0]], [[1.0]], 1.0),
        ):
            with pytest.raises(pn.FrictionParadoxError, match="has several solutions"):
                refused(drawer.scene())

    def test_continued_with_the_least_friction(self):
        drawer = Drawer()
        scene, small = drawer.scene(), drawer.limits()[0]
        s = scene.solve([0.0], [1.0], several="continue")
        assert s.unique is False
        assert s.a[0] == pytest.approx(-small, rel=1e-12)
        a = scene.acceleration([0.0], [1.0], several="continue")
        assert a[0] == pytest.approx(-small, rel=1e-12)
        run = pn.simulate(scene, 2.0, several="continue")
        assert [(e.time, e.kind, e.element) for e in run.events] == [(0.0, "several", "guide")]
        assert run.v[-1, 0] == pytest.approx(1.0 - 2.0 * small, rel=1e-12)

    def test_one_motion_is_shown(self):
        s = Drawer().scene(0.2).solve([0.0], [1.0])
        assert s.unique is True

    def test_of_users_functions_nothing_is_shown(self):
        scene = Drawer().scene(0.2)
        law = pn.UserLaw(lambda t, q, v, reactions: [-0.01 * np.abs(reactions.wrench("j")).sum()], name="rub")
        scene = pn.Scene(scene.model, laws=[law], v0=[1.0], forces=scene.forces)
        assert scene.solve([0.0], [1.0]).unique is None

    def test_refuses_other_words(self):
        with pytest.raises(pn.InputError, match=re.escape("solve: several must be one of")):
            Drawer().scene().solve([0.0], [1.0], several="guess")
        with pytest.raises(pn.InputError, match=re.escape("simulate: several must be one of")):
            pn.simulate(Drawer().scene(), 1.0, several="guess")


def rising_load():
    """A drawer pushed by 2 N, whose load of 0.5 kg rises by 1 m/s: g grows by 0.25 (2 + t), 1 at t = 2 s."""
    model = empty((0.0, 0.0, 0.0))
    inertia = 1e-3 * np.eye(3)
    slide = body(model, 0, pin.JointModelPX(), "j", 0.5, inertia=inertia)
    lift = body(model, slide, pin.JointModelPZ(), "lift", 0.5, lever=(0.0, 0.0, 1.0), inertia=inertia)
    frame(model, "base", slide)
    frame(model, "load", lift)
    law = pn.JointFriction("j", mu=0.5, span=1.0, name="guide")
    push = pn.Wrench("base", [2.0, 0.1, 0.0, 0.0, 0.0, 0.0])
    return pn.Scene(model, laws=[law], forces=[push], q0=[0.0, 1.0], v0=[3.0, 1.0])


class TestLostOnTheWay:
    @pytest.mark.parametrize(
        "options",
        [{}, {"method": "dopri5"}, {"output_dt": 0.25}, {"method": "rk4", "dt": 0.01}, {"method": "Radau"}],
    )
    def test_the_event_says_when(self, options):
        """One event has the instant, and the motion is smooth at this instant."""
        run = pn.simulate(rising_load(), 3.0, several="continue", record="energy", **options)
        assert [(e.kind, e.element) for e in run.events] == [("several", "guide")]
        assert run.events[0].time == pytest.approx(2.0, abs=INSTANT)
        assert np.isclose(run.t, run.events[0].time, rtol=0.0, atol=1e-12).any()
        assert np.all(np.diff(run.t) > 0.0)
        assert abs(run.energy["balance"]).max() < 1e-4
        fine = pn.simulate(rising_load(), 3.0, several="continue", rtol=1e-12, atol=1e-13)
        assert run.q[-1, 0] == pytest.approx(fine.q[-1, 0], rel=1e-5)

    @pytest.mark.parametrize("method", ["dop853", "dopri5"])
    def test_the_error_comes_then(self, method):
        with pytest.raises(pn.FrictionParadoxError) as caught:
            pn.simulate(rising_load(), 3.0, method=method)
        assert caught.value.time == pytest.approx(2.0, abs=INSTANT)
        assert caught.value.trajectory.t[-1] == pytest.approx(2.0, abs=INSTANT)

    def test_resumed_it_is_told_once(self, tmp_path):
        path = tmp_path / "run.npz"
        whole = pn.simulate(rising_load(), 3.0, several="continue", checkpoint=path, checkpoint_interval=0.0)
        again = pn.resume(path, rising_load())
        assert again.events == whole.events
        np.testing.assert_array_equal(again.q, whole.q)
        assert pn.Trajectory.load(whole.save(tmp_path / "kept")).events == whole.events

    def test_in_batches(self):
        scene = rising_load()
        single = pn.simulate(scene, 3.0, several="continue")
        q, v = scene.initial_state()
        for run in pn.rollout(scene, [q, q], [v, v], 3.0, several="continue", jobs=2):
            assert run.events == single.events
            np.testing.assert_array_equal(run.q, single.q)
