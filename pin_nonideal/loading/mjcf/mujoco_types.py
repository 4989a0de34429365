"""Names of MuJoCo's objects in signatures. MuJoCo is optional, so the type checker does not see its types."""

from __future__ import annotations

from typing import Any, TypeAlias

Mujoco: TypeAlias = Any  # the Python package mujoco
MjModel: TypeAlias = Any  # mujoco.MjModel
MjSpec: TypeAlias = Any  # mujoco.MjSpec
MjsElement: TypeAlias = Any  # a body, geom, mesh or height field of a mujoco.MjSpec
