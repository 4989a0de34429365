"""Bodies without inertia under constraints."""

from __future__ import annotations

import pinocchio as pin
import pytest

import pin_nonideal as pn

from ..support.loops import at
from ..support.mechanisms import body, empty, frame


def test_a_constraint_on_a_body_without_inertia_names_its_joint() -> None:
    model = empty()
    arm = body(model, 0, pin.JointModelRZ(), "shoulder", 1.0, lever=(0.1, 0.0, 0.0))
    hand = body(model, arm, pin.JointModelRZ(), "wrist", 1.0, place=at((0.2, 0.0, 0.0)))
    frame(model, "tip", hand, at((0.5, 0.0, 0.0)))
    with pytest.raises(pn.SingularMassError, match='singular at joint "wrist"'):
        pn.Scene(model, constraints=[pn.PointAnchor("tip")])
