"""Robots for timing of evaluations and steps: model, anchors and state, without a reference."""

from __future__ import annotations

from typing import Any

import pin_nonideal as pn

from .problems import Problem, solo12_gains


def scene_problem(scene: pn.Scene, title: str, anchors: Any = None, **extra: Any) -> Problem:
    """Return a problem with a scene's model, anchors and initial state.

    Args:
        scene: source of model, constraints and initial state.
        title: title in tables.
        anchors: replacement of the scene's constraints; None to keep them.
        extra: further attributes of the Problem.
    """
    q0, v0 = scene.initial_state()
    held = scene.constraints if anchors is None else anchors
    return Problem(
        name=scene.name, title=title, model=scene.model, q0=q0, v0=v0, duration=0.0, anchors=held, **extra
    )


def panda() -> Problem:
    return scene_problem(pn.load("panda_friction"), "Panda, free", ())


def four_bar() -> Problem:
    return scene_problem(pn.load("four_bar"), "four-bar, one loop")


def n_four_bar(count: int = 20) -> Problem:
    return scene_problem(pn.load("n_four_bar", N=count), f"{count} four-bars")


def solo12() -> Problem:
    return scene_problem(pn.load("solo12_standing"), "Solo12, four anchored feet")


def solo12_held() -> Problem:
    scene = pn.load("solo12_standing")
    return scene_problem(scene, "Solo12 standing on four anchored feet", hold=solo12_gains(scene.model))


def talos() -> Problem:
    robot = pn.load("talos")
    soles = (pn.FrameAnchor("left_sole_link"), pn.FrameAnchor("right_sole_link"))
    scene = pn.Scene(robot.model, constraints=soles, q0=robot.q0, name="talos")
    return scene_problem(scene, "Talos, two feet held in 6D")


def solo12_free() -> Problem:
    return scene_problem(pn.load("solo12_standing"), "Solo12, floating", ())


def talos_free() -> Problem:
    return scene_problem(pn.load("talos"), "Talos, floating", ())
