"""Recording changes neither motion nor events, and intermediate results of projection are not recorded."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.simulation import checkpoint

from ....support.mechanisms import body, empty, frame


def rod_on_a_point():
    """A uniform rod that falls over on a smooth point: the contact presses all the time."""
    model = empty()
    x = body(model, 0, pin.JointModelPX(), "x", 0.0)
    z = body(model, x, pin.JointModelPZ(), "z", 0.0)
    turn = body(model, z, pin.JointModelRY(), "turn", 1.0, inertia=0.1 * np.eye(3))
    frame(model, "tip", turn, pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.0])))
    return pn.Scene(
        model,
        contacts=[pn.PointContact("tip", unilateral=False)],
        q0=[0.0, 0.45, 1.2],
        v0=[0.3, 0.0, -0.5],
        name="rod",
    )


@pytest.mark.parametrize("method", ["dop853", "dopri5"])
def test_a_contact_that_presses_is_never_told_to_pull(method):
    for output_dt in (None, 0.003, 0.01):
        for record in ((), ("forces",)):
            run = pn.simulate(rod_on_a_point(), 0.2, output_dt=output_dt, method=method, record=record)
            assert run.events == []
            if record:
                assert run.lam.min() > 3.0


def almost_flat_parallelogram():
    """A four-bar whose rods lie on one line once a turn, but for a millimeter."""
    model = empty((0.0, 0.0, -9.81))
    joint, start = 0, pin.SE3.Identity()
    for name, length in (("a", 1.0), ("b", 2.0), ("c", 1.0)):
        inertia = np.diag([0.01, 0.1, 0.1])
        lever = (0.5 * length, 0.0, 0.0)
        joint = body(model, joint, pin.JointModelRY(), name, 1.0, place=start, lever=lever, inertia=inertia)
        start = pin.SE3(np.eye(3), np.array([length, 0.0, 0.0]))
    frame(model, "tip", joint, start)
    frame(model, "ground", 0, pin.SE3(np.eye(3), np.array([2.001, 0.0, 0.0])))
    loop = pn.PointAnchor("tip", "ground", axes="xz")
    return pn.Scene(model, constraints=[loop], q0=[-1.0, 1.0, 1.0], v0=[4.0, -4.0, 4.0])


@pytest.mark.parametrize("method", ["dop853", "dopri5"])
def test_recorded_multipliers_are_those_of_the_state(method):
    scene = almost_flat_parallelogram()
    run = pn.simulate(scene, 1.0, method=method, record=("forces",))
    for t, q, v, lam in zip(run.t, run.q, run.v, run.lam, strict=True):
        # One more evaluation near a singular position: its rounding over the square of the sine there.
        np.testing.assert_allclose(scene.solve(q, v, t=t).lam, lam, rtol=1e-6)


def rubbing_cart():
    """A cart on a rough rail whose law reads the wrench in a joint, time-stepped."""
    model = empty()
    x = body(model, 0, pin.JointModelPX(), "x", 1.0, inertia=0.1 * np.eye(3))
    z = body(model, x, pin.JointModelPZ(), "z", 1.0, inertia=0.1 * np.eye(3))
    frame(model, "foot", z)

    def drag(t, q, v, reactions):
        wrench = reactions.wrench("z")
        return [-0.05 * wrench[0] - 0.02 * abs(wrench[2]), 0.0]

    return pn.Scene(
        model,
        laws=[pn.UserLaw(drag, name="drag")],
        contacts=[pn.PointContact("foot", mu=0.3, unilateral=False)],
        actuation=lambda t, q, v: np.array([6.0 * np.sin(3.0 * t), 0.0]),
        v0=[1.0, 0.0],
    )


def test_time_stepping_goes_on_bit_by_bit_where_a_law_reads_wrenches(monkeypatch, tmp_path):
    options = {"method": "moreau", "dt": 0.01}
    alone = pn.simulate(rubbing_cart(), 1.0, **options)
    path, calls, save = tmp_path / "run", [], checkpoint.Saver.__call__

    def stop_at_last(saver, state):
        save(saver, state)
        calls.append(state)
        if len(calls) == 40:
            raise KeyboardInterrupt

    monkeypatch.setattr(checkpoint.Saver, "__call__", stop_at_last)
    with pytest.raises(pn.RunInterrupted):
        pn.simulate(rubbing_cart(), 1.0, **options, checkpoint=path, checkpoint_interval=0.0)
    monkeypatch.undo()
    run = pn.resume(path, rubbing_cart())
    np.testing.assert_array_equal(run.q, alone.q)
    np.testing.assert_array_equal(run.v, alone.v)
