"""Decoupled mechanisms: each has the same run as alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.simulation.components import components

SAME = 1e-12  # rounding of interpolants at the ends of steps
COULOMB: dict[str, Any] = {"coulomb": 0.1}
LOADED: dict[str, Any] = {"mu": 0.1, "radius": 0.05}


def pendulums(which: list[int], law: dict[str, Any], **said: Any) -> tuple[pn.Scene, np.ndarray]:
    """Return independent double pendulums with interleaved joints; the k-th is the same in any selection."""
    model, tips, q = pin.Model(), {}, {}
    shapes = np.random.default_rng(3).uniform(0.3, 0.6, (50, 2))
    angles = np.random.default_rng(4).uniform(0.0, 2.0, (50, 2))
    for level in range(2):
        for k in which:
            length = shapes[k, level]
            place = pin.SE3(np.eye(3), np.array([0.0, k, 0.0] if level == 0 else [0.0, 0.0, -shapes[k, 0]]))
            joint = model.addJoint(tips.get(k, 0), pin.JointModelRY(), place, f"joint{level} of {k}")
            lever = pin.SE3(np.eye(3), np.array([0.0, 0.0, -length]))
            model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.05), lever)
            model.addFrame(pin.Frame(f"end{level} of {k}", joint, 0, lever, pin.FrameType.OP_FRAME))
            tips[k] = joint
            q[joint] = angles[k, level]
    laws = [pn.JointFriction(name, **law) for name in list(model.names)[1:]]
    return pn.Scene(model, laws=laws, **said), np.array([q[joint] for joint in sorted(q)])


@pytest.mark.parametrize("law", [COULOMB, LOADED], ids=["coulomb", "loaded"])
def test_each_runs_as_it_does_alone(law: dict[str, Any]) -> None:
    which = list(range(7))
    scene, q = pendulums(which, law)
    whole = pn.simulate(scene, 2.0, q=q, output_dt=0.1)
    events, steps = [], 0
    for k in which:
        alone, q_alone = pendulums([k], law)
        one = pn.simulate(alone, 2.0, q=q_alone, output_dt=0.1)
        mine = [
            scene.model.joints[scene.model.getJointId(f"joint{level} of {k}")].idx_v for level in range(2)
        ]
        on = np.searchsorted(whole.t, one.t)
        assert (whole.t[on] == one.t).all()
        assert np.abs(whole.q[on][:, mine] - one.q).max() < SAME
        assert np.abs(whole.v[on][:, mine] - one.v).max() < SAME
        assert (whole.modes[on][:, mine] == one.modes).all()
        events += [(event.time, event.kind, event.element) for event in one.events]
        steps += one.stats.steps
    assert [(event.time, event.kind, event.element) for event in whole.events] == sorted(events)
    assert whole.stats.steps == steps  # events of one mechanism add no steps to others


def test_what_is_recorded_moves_nothing() -> None:
    scene, q = pendulums([0, 1, 2], LOADED)
    plain = pn.simulate(scene, 1.0, q=q, output_dt=0.05)
    full = pn.simulate(
        scene, 1.0, q=q, output_dt=0.05, record=("forces", "energy", "reactions", "dense", "a")
    )
    assert (plain.t == full.t).all()
    assert np.abs(plain.q - full.q).max() < SAME
    assert np.abs(plain.v - full.v).max() < SAME
    assert (plain.modes == full.modes).all()
    assert np.abs(full.energy["balance"]).max() < 1e-7
    later = full.at(np.linspace(0.0, 1.0, 37))
    step = np.abs(later.t[:, None] - plain.t).argmin(axis=1)
    hit = np.abs(later.t - plain.t[step]) < 1e-12
    assert hit.sum() >= 2
    assert np.abs(later.q[hit] - plain.q[step[hit]]).max() < 1e-9


def test_rollout_gives_the_bits_of_simulate() -> None:
    scene, q = pendulums([0, 1, 2, 3], LOADED)
    starts = q + np.linspace(0.0, 0.3, 5)[:, None]
    runs = pn.rollout(scene, starts, np.zeros_like(starts), 0.7, jobs=2)
    for start, run in zip(starts, runs, strict=True):
        alone = pn.simulate(scene, 0.7, q=start)
        assert (run.t == alone.t).all()
        assert (run.q == alone.q).all()
        assert (run.v == alone.v).all()


def test_arrays_have_the_bits_of_simulate() -> None:
    scene, q = pendulums([0, 1, 2], LOADED)
    starts = q + np.linspace(0.0, 1.0, 4)[:, None]
    runs = pn.rollout(scene, starts, np.zeros_like(starts), 0.5, jobs=2, as_arrays=True)
    assert repr(runs) == f"<RunArrays: 4 runs of up to {runs.samples.max()} samples, 0 failed>"
    assert runs.samples.min() < runs.samples.max()
    for i, start in enumerate(starts):
        alone, n = pn.simulate(scene, 0.5, q=start), runs.samples[i]
        assert n == len(alone)
        assert runs.steps[i] == alone.stats.steps
        assert (runs.t[i, :n] == alone.t).all()
        assert (runs.q[i, :n] == alone.q).all()
        assert (runs.v[i, :n] == alone.v).all()
        assert np.isnan(runs.t[i, n:]).all()
        assert (runs.last[0][i] == alone.q[-1]).all()
    assert len(pn.rollout(scene, starts[:0], starts[:0], 0.5, as_arrays=True)) == 0


class Drive:
    """The angle t of one joint, by a function that raises `error` after half a second of a run."""

    def __init__(self) -> None:
        self.error: BaseException | None = None

    def __call__(self, t: float) -> tuple[float, float, float]:
        if self.error is not None and t > 0.5:
            raise self.error
        return t, 1.0, 0.0

    def pendulums(self, error: BaseException) -> tuple[pn.Scene, np.ndarray]:
        motion = pn.PrescribedMotion("joint0 of 1", self, name="drive")
        scene, q = pendulums([0, 1, 2], COULOMB, constraints=[motion])
        assert len(components(scene._compiled)) == 3
        self.error = error
        return scene, scene.project(q)[0]


def test_a_failing_function_keeps_the_samples_of_all_mechanisms() -> None:
    scene, q = Drive().pendulums(ValueError("no data"))
    for call in (pn.simulate, lambda *_, **start: pn.rollout(scene, start["q"][None], None, 1.0)):
        with pytest.raises(
            pn.UserFunctionError, match='"drive": function of time raised ValueError: no data'
        ):
            call(scene, 1.0, q=q)
    with pytest.raises(pn.UserFunctionError) as caught:
        pn.simulate(scene, 1.0, q=q)
    assert 0.0 < caught.value.trajectory.t[-1] <= 0.5
    assert caught.value.trajectory.q.shape[1] == 6
    runs = pn.rollout(scene, np.tile(q, (2, 1)), None, 1.0, as_arrays=True, failures="keep")
    assert [type(runs.failures[k]) for k in range(2)] == [pn.UserFunctionError] * 2
    assert [runs.failures[k].index for k in range(2)] == [0, 1]


def test_an_interrupt_ends_the_runs_of_all_mechanisms() -> None:
    scene, q = Drive().pendulums(KeyboardInterrupt())
    with pytest.raises(pn.RunInterrupted, match="the run was interrupted at t = 0 s") as caught:
        pn.simulate(scene, 1.0, q=q)
    assert len(caught.value.trajectory) == 0
    with pytest.raises(pn.RunInterrupted) as caught:
        pn.rollout(scene, np.tile(q, (3, 1)), None, 1.0, failures="keep")
    assert caught.value.index == 0
    assert caught.value.results[1:] == [None, None]
    with pytest.raises(pn.RunInterrupted, match="the runs were interrupted"):
        pn.rollout(scene, np.tile(q, (3, 1)), None, 1.0, as_arrays=True, failures="keep")


@pytest.mark.parametrize(
    ("said", "groups"),
    [
        ({}, [[0], [1], [2]]),
        ({"forces": [pn.SpringDamper("end1 of 0", "end0 of 2", stiffness=5.0)]}, [[0, 2], [1]]),
        ({"constraints": [pn.JointCoupling("joint0 of 1", "joint0 of 2", ratio=1.0)]}, [[0], [1, 2]]),
        ({"forces": [pn.UserForce(lambda t, q, v: np.zeros(6))]}, []),
        ({"actuation": lambda t, q, v: np.zeros(6)}, []),
        ({"actuation": pn.HoldPosition(kp=1.0, kd=0.1)}, [[0], [1], [2]]),
    ],
)
def test_what_acts_on_both_makes_one_of_two(said: dict[str, Any], groups: list[list[int]]) -> None:
    scene, _ = pendulums([0, 1, 2], COULOMB, **said)
    names = [list(part.compiled.model.names)[1:] for part in components(scene._compiled)]
    assert sorted(sorted({int(name[-1]) for name in own}) for own in names) == groups


def test_loops_stay_closed() -> None:
    """Each mechanism has one row: the end of the second link stays below the first joint."""
    which = [0, 1, 2]
    rods = [pn.PointAnchor(f"end1 of {k}", axes="x") for k in which]
    law = {"coulomb": 0.05}
    scene, q = pendulums(which, law, constraints=rods)
    v = np.array([2.0, 3.0, 4.0, -1.0, 0.5, 0.0])
    run = pn.simulate(scene, 2.0, q=np.zeros_like(q), v=v, record="energy")
    assert len(components(scene._compiled)) == 3
    assert run.violation.max() < 1e-12
    assert run.violation_rate.max() < 1e-11
    assert np.abs(run.energy["balance"]).max() < 1e-7
