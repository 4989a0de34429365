"""Tools that compute the motions: this package and its alternatives, each with its best settings."""

from __future__ import annotations

from .base import Outcome, Setting, Tool
from .drake import Drake
from .exudyn import Exudyn
from .mujoco import MuJoCo
from .package import Package
from .pinocchio_odeint import PinocchioOdeint
from .pinocchio_scipy import PinocchioSciPy

TOOLS: dict[str, Tool] = {
    tool.name: tool for tool in (Package(), PinocchioSciPy(), PinocchioOdeint(), MuJoCo(), Exudyn(), Drake())
}

__all__ = ["TOOLS", "Outcome", "Setting", "Tool"]
