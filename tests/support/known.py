"""Documented limits and open defects; an entry is removed with its defect."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import pytest


@dataclass(frozen=True)
class Known:
    """Known defect.

    Attributes:
        reason: description of the defect.
        example: scene, transformation and function that show the defect.
        scenes, transformations, functions: regular expressions of all affected names.
    """

    reason: str
    example: tuple[str, str, str]
    scenes: str = ".*"
    transformations: str = ".*"
    functions: str = ".*"
    marks: tuple[Any, ...] = ()

    def covers(self, scene: str, transformation: str, function: str) -> bool:
        parts = zip(
            (self.scenes, self.transformations, self.functions),
            (scene, transformation, function),
            strict=True,
        )
        return all(re.fullmatch(pattern, text) for pattern, text in parts)


KNOWN: list[Known] = [
    Known(
        "reactions that elements at rest share are of least norm over forces and torques, see `rest`",
        ("places 2", "an idle row", "rest"),
        scenes="(places|mechanism|ball loop) .*|robot .*four_bar",
        functions="rest",
    ),
    Known(
        "a fixed step that ends near a rest of slip in several directions ends it or not by rounding",
        ("ball loop 1", "turned mount", "simulate rk4"),
        scenes="ball loop .*",
        functions="simulate (rk4|semi_implicit_euler)|stepper",
    ),
    Known(
        "a ball's last stick in fixed steps, or in other units of time, is found or not by rounding",
        ("ball loop 0", "milliseconds", "simulate dop853"),
        scenes="ball loop .*",
        transformations="rk4|milliseconds|tonnes, kilometers, hours",
        functions="simulate (dop853|dopri5)",
    ),
    Known(
        "a start far off its loop ends near the nearest position, at a place that rounding decides",
        ("ball loop 19", "boosted", "simulate dop853"),
        scenes="ball loop 19",
        functions="simulate .*|stepper|poses of a replay",
        marks=(pytest.mark.slow,),
    ),
    Known(
        "two mirrored positions on the constraints are equally near, and rounding chooses",
        ("free Cardan 17", "grams", "project"),
        scenes="free Cardan 17",
        functions="project",
        marks=(pytest.mark.slow,),
    ),
    Known(
        "time stepping splits the load of four feet otherwise if rows act or friction holds a joint",
        ("robot solo12_dropped", "an idle row", "simulate moreau"),
        scenes="robot solo12_dropped|feet on a ramp, .*",
        transformations="boosted|accelerated|split by a lock|an idle row|friction without limit",
        functions="simulate moreau",
    ),
    Known(
        "differences in time, for a rate that is not given and for checks, have steps in seconds",
        ("rows of user", "tonnes, kilometers, hours", "solve"),
        scenes="rows of user",
        transformations="tonnes, kilometers, hours",
    ),
    Known(
        "time stepping of a contact that resists turning strikes otherwise where there are loops",
        ("touching PointContact", "an idle row", "simulate moreau"),
        scenes="touching .*",
        functions="simulate moreau",
    ),
    Known(
        "time stepping turns a free body by Cayley's map, and a body with rows by the joint's retraction",
        ("mechanism 60", "an idle row", "simulate moreau"),
        scenes="mechanism .*",
        transformations="split by a weld|split by a lock|an idle row",
        functions="simulate moreau",
    ),
    Known(
        "Radau at a tight tolerance stops at dead centers, with one error or another",
        ("side rods 0", "turned mount", "simulate Radau"),
        scenes="side rods .*",
        functions="simulate Radau",
        marks=(pytest.mark.slow,),
    ),
    Known(
        "Radau as the method of the scene stops at dead centers at a tight tolerance",
        ("side rods 0", "Radau", "simulate dop853"),
        scenes="side rods .*",
        transformations="Radau",
    ),
    Known(
        "time stepping with contacts takes its first modes from the end of a first step, without events",
        ("started loop 0", "a far contact", "simulate moreau"),
        scenes="started .*",
        transformations="a far contact",
        functions="simulate moreau",
    ),
    Known(
        "works are no part of the error of a step, and drives that move all bodies leave no other error",
        ("started loop 66", "friction without limit", "simulate dop853"),
        scenes="started loop (66|81)|cart 0",
        functions="simulate dop853",
    ),
    Known(
        "a user's rows state no break at which a drive starts a joint with friction",
        ("started with friction Spline", "rows by hand, times 1e4", "simulate rk4"),
        scenes="started with friction Spline",
        transformations="rows by hand.*",
        functions="simulate .*|stepper|poses of a replay",
    ),
    Known(
        "fixed steps pass the breaks of a user's rows, which nothing states",
        ("cart 17", "rows by hand, times 1e4", "simulate rk4"),
        scenes="(cart|motion) .*",
        transformations="rows by hand.*",
        functions="simulate (rk4|semi_implicit_euler|moreau)|stepper",
    ),
    Known(
        "the unit of time, and rounding in fixed steps, decide the instant at which accumulated bounces end",
        ("touching UserContact", "tonnes, kilometers, hours", "simulate semi_implicit_euler"),
        scenes="touching (UserContact|JointLimit)",
        transformations="tonnes, kilometers, hours|accelerated",
        functions="simulate semi_implicit_euler",
        marks=(pytest.mark.slow,),
    ),
    Known(
        "SciPy's Radau takes ten times the steps for driven shafts with a weld",
        ("driven Cardan 1", "split by a weld", "simulate Radau"),
        scenes="driven Cardan .*",
        transformations="split by a weld",
        functions="simulate Radau",
        marks=(pytest.mark.slow,),
    ),
]
