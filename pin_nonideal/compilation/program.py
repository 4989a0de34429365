"""A scene as the core knows it: the program under construction, and what its numbers are called."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass
class Lowered:
    """A scene as the core knows it.

    Attributes:
        builder: the core's program under construction.
        slices: rows of `lam` of each constraint and contact, by name.
        blocks: the core's block of each constraint and contact, by name.
        anchors: (name, frame id 1, frame id 2 or None for the world) of what joins two frames.
        friction_names: names of the frictional elements, in the core's order.
        law_names: names of the laws, in the core's order (columns of the ledger).
        opaque: blocks whose rows a few samples do not show, given by Python functions or functions of time.
        unprojected: names of user constraints without residual and rate.
        z0: initial states of laws.
        rows: number of rows of all constraints and contacts.
    """

    builder: Any
    slices: dict[str, slice] = field(default_factory=dict)
    blocks: dict[str, int] = field(default_factory=dict)
    anchors: list[tuple[str, int, int | None]] = field(default_factory=list)
    friction_names: list[str] = field(default_factory=list)
    law_names: list[str] = field(default_factory=list)
    opaque: set[int] = field(default_factory=set)
    unprojected: list[str] = field(default_factory=list)
    z0: Array = field(default_factory=lambda: np.zeros(0))
    rows: int = 0

    def add_rows(self, name: str, block: int, count: int) -> None:
        """Books the rows of a constraint or contact.

        Args:
            name: its name.
            block: the core's block.
            count: number of its rows.
        """
        self.blocks[name] = block
        self.slices[name] = slice(self.rows, self.rows + count)
        self.rows += count

    def add_law(self, name: str) -> int:
        """A law's column of the ledger.

        Args:
            name: its name.

        Returns:
            The core's index of the law.
        """
        self.law_names.append(name)
        return int(self.builder.add_law(name))

    def add_states(self, count: int) -> None:
        """States of a law, zero at the start.

        Args:
            count: how many.
        """
        self.z0 = np.concatenate([self.z0, np.zeros(count)])

    def add_friction(
        self,
        name: str,
        law: int,
        block: int,
        load: str,
        reaction: str,
        *,
        joint: int = -1,
        anchor: int = -1,
        axis: Any = (0.0, 0.0, 1.0),
        limit: Callable[..., float] | None = None,
        constant: float = 0.0,
        mu: float = 0.0,
        radius: float = 0.0,
        axial_radius: float = 0.0,
        inverse_span: float = 0.0,
        static_ratio: float = 1.0,
        stribeck_velocity: float = 0.0,
    ) -> None:
        """A frictional element, which sticks or slips along the rows of a block.

        Args:
            name: of the element.
            law: the core's index of the law that it belongs to.
            block: rows of the slip.
            load: what loads it: "revolute", "prismatic", "spherical", "contact", "user" or "none".
            reaction: "total", "ideal" or "none".
            joint: joint whose wrench loads it, or -1.
            anchor: block whose multipliers load it, or -1.
            axis: of the bearing, (3,).
            limit: the user's limit of the friction.
            constant: dry friction without load [N m or N].
            mu: coefficient of friction.
            radius: at which the radial load rubs [m].
            axial_radius: at which the axial load rubs [m].
            inverse_span: one over the lever of the moment [1/m].
            static_ratio: static over kinetic friction.
            stribeck_velocity: of the fall from static to kinetic [rad/s or m/s]; 0 for none.
        """
        numbers = {
            "constant": constant,
            "mu": mu,
            "radius": radius,
            "axial_radius": axial_radius,
            "inverse_span": inverse_span,
            "static_ratio": static_ratio,
            "stribeck_velocity": stribeck_velocity,
        }
        direction = [float(x) for x in axis]
        self.builder.add_friction(name, law, block, load, reaction, joint, anchor, direction, numbers, limit)
        self.friction_names.append(name)
