"""Placements without Pinocchio's Data against Pinocchio's own."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.states.kinematics import joint_placements

from ..support.random_trees import JOINTS, tree


@pytest.mark.parametrize("seed", range(5))
def test_every_kind_of_joint_is_where_pinocchio_puts_it(seed):
    rng = np.random.default_rng(seed)
    model = tree(list(rng.permutation(list(JOINTS))), rng)
    q = pin.integrate(model, pin.neutral(model), rng.normal(0.0, 0.7, model.nv))
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    for ours, theirs in zip(joint_placements(model, q), data.oMi, strict=True):
        np.testing.assert_allclose(ours.homogeneous, theirs.homogeneous, atol=1e-14)


def test_a_scene_of_many_joints_needs_no_tensors():
    """Pinocchio's Data of 1281 degrees of freedom would take 60 GB."""
    scene = pn.load("n_four_bar", N=640)
    q, v = scene.initial_state()
    assert scene.acceleration(q, v).shape == (1281,)
