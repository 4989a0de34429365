"""Replay in an open meshcat window: robot, animation and force arrows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from pin_nonideal.types import Array

from .camera import link_length
from .contact_points import contact_points
from .force_arrows import Arrow, arrows_of
from .frames import Motion, sample
from .style import FORCES

if TYPE_CHECKING:
    from pin_nonideal.trajectory.trajectory import Trajectory

RATE = 30  # frames per second of the stored animation
MAX_DURATION = 20.0  # maximum duration of the animation [s]


def show(run: Trajectory, viewer: Any, name: str, forces: bool) -> Any:
    """Show a run in a `meshcat.Visualizer`.

    Args:
        run: run of the replay.
        viewer: open window.
        name: name of the robot in the window's tree.
        forces: whether arrows are drawn.

    Returns:
        Robot in the window, a pinocchio.visualize.MeshcatVisualizer.
    """
    import meshcat.animation
    from pinocchio.visualize import MeshcatVisualizer

    scene = run.scene
    shown = MeshcatVisualizer(scene.model, scene.collision_model, scene.visual_model)
    shown.initViewer(viewer=viewer)
    shown.loadViewerModel(rootNodeName=name)
    length = float(run.t[-1] - run.t[0])
    count = int(np.clip(RATE * length, 2, RATE * MAX_DURATION)) if length > 0.0 else 1
    motion = sample(run, (count - 1) / length if length > 0.0 else 1.0)
    arrows = (
        [a for a in arrows_of(run, motion, contact_points(run, motion)) if a.unit == "N"] if forces else []
    )
    scale = _add_arrows(viewer[name]["forces"], arrows, 0.3 * link_length(scene.model, [], motion.size))
    animation = meshcat.animation.Animation(default_framerate=RATE)
    for frame in range(len(motion.times)):
        with animation.at_frame(viewer, frame) as keyed:
            shown.viewer = keyed  # writes Pinocchio's placements into the animation
            shown.display(motion.q[frame])
            for number, arrow in enumerate(arrows):
                _place(keyed[name]["forces"][str(number)], arrow, motion, frame, scale)
    shown.viewer = viewer
    viewer.set_animation(animation)
    shown.display(motion.q[0])
    return shown


def _add_arrows(root: Any, arrows: list[Arrow], reach: float) -> float:
    """Add arrows of length one along y, and return the drawn length of one newton [m]."""
    import meshcat.geometry as shapes

    largest = max((arrow.largest() for arrow in arrows), default=1.0) or 1.0
    for number, arrow in enumerate(arrows):
        material = shapes.MeshLambertMaterial(color=int(FORCES[arrow.kind][1:], 16))
        node, head = root[str(number)], shapes.Cylinder(0.2, radiusTop=0.0, radiusBottom=0.1 * reach)
        node["shaft"].set_object(shapes.Cylinder(0.8, 0.04 * reach), material)
        node["shaft"].set_transform(_moved(0.4))
        node["head"].set_object(head, material)
        node["head"].set_transform(_moved(0.9))
    return reach / largest


def _moved(along: float) -> Array:
    place = np.eye(4)
    place[1, 3] = along
    return place


def _place(node: Any, arrow: Arrow, motion: Motion, frame: int, scale: float) -> None:
    """Rotate y to the direction of a force and scale it; a zero force is drawn as a point."""
    force, place = arrow.values[frame], np.eye(4)
    size = float(np.linalg.norm(force))
    if size > 0.0:
        place[:3, :3] = pin.Quaternion.FromTwoVectors(np.array([0.0, 1.0, 0.0]), force / size).matrix()
    place[:3, 3] = motion.poses[frame, arrow.joint, :3] if arrow.origin is None else arrow.origin[frame]
    node.set_transform(place)
    drawn = 1.0 if size > 0.0 else 1e-6
    node.set_property("scale", "vector3", [drawn, max(scale * size, 1e-6), drawn])
