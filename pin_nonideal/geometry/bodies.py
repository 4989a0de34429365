"""Free bodies with a shape: joint, inertia and shapes in one call."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from pin_nonideal.errors import InputError, short_repr
from pin_nonideal.types import Array, GeometryModel, GeometryObject, Model, Placement
from pin_nonideal.validation import array, positive, text

from .shapes import check_lengths

__all__ = ["free_body", "placement", "shape_color"]


def free_body(
    model: Model,
    name: str,
    shape: GeometryObject,
    density: float | None = None,
    *,
    mass: float | None = None,
    collision_model: GeometryModel | None = None,
    visual_model: GeometryModel | None = None,
    place: Placement | ArrayLike | None = None,
    color: ArrayLike | None = None,
) -> int:
    """Add a free-flying body with the inertia of a homogeneous shape to a model.

    The body gets a free-flyer joint and a frame, both with its name and with the axes of the shape. The mass
    is density times volume, and the moments of inertia are density times the moments of the volume. The
    neutral configuration of the joint is the body at `place`, and `q` is the pose relative to `place`. Each
    given geometry model receives the shape under the same name, for `GeometryContact` and for display. A
    replay draws the collision model if the scene has no visual model.

    Args:
        model: pinocchio.Model, to which the body is added.
        name: name of the joint, of the frame and of the shape objects.
        shape: shape of coal with a volume: Box, Sphere, Capsule, Cylinder, Cone, Ellipsoid, or a closed mesh.
        density: density [kg/m^3]; leave it out if `mass` is given.
        mass: mass of the body [kg]; leave it out if `density` is given.
        collision_model: pinocchio.GeometryModel of `Scene`, to which the shape is added; None for no contacts
            of the shape.
        visual_model: pinocchio.GeometryModel for display, to which the shape is added too.
        place: pose in the world as a pinocchio.SE3, or the position alone [m], (3,); None for the origin.
        color: red, green, blue and optionally opacity of the shape, 0 to 1, (3,) or (4,); None for the color
            that the replay gives to the link.

    Returns:
        Index of the joint, as `model.addJoint` returns it.

    Raises:
        InputError: an argument is invalid, the name is taken, the shape encloses no volume, or not exactly
            one of density and mass is given.
    """
    if not isinstance(model, pin.Model):
        raise InputError(f"free_body: model must be a pinocchio.Model; got {short_repr(model)}")
    who = f'free_body "{text("free_body: name", name)}"'
    for key, geometry in (("collision_model", collision_model), ("visual_model", visual_model)):
        if geometry is not None and not isinstance(geometry, pin.GeometryModel):
            raise InputError(f"{who}: {key} must be a pinocchio.GeometryModel; got {short_repr(geometry)}")
        if geometry is not None and geometry.existGeometryName(name):
            raise InputError(f"{who}: {key} has a shape of this name already; give the body another name")
    if model.existJointName(name) or model.existFrame(name):
        raise InputError(f"{who}: model has a joint or frame of this name already; give another name")
    inertia = _inertia(who, shape, density, mass)
    at, rgba = placement(f"{who}: place", place), shape_color(f"{who}: color", color)
    joint = int(model.addJoint(0, pin.JointModelFreeFlyer(), at, name))
    frame = int(model.addJointFrame(joint))
    model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    for geometry in (collision_model, None if visual_model is collision_model else visual_model):
        if geometry is not None:
            item = pin.GeometryObject(name, joint, frame, pin.SE3.Identity(), shape)
            if rgba is not None:
                item.meshColor, item.overrideMaterial = rgba, True
            geometry.addGeometryObject(item)
    return joint


def placement(what: str, place: Placement | ArrayLike | None) -> Placement:
    """Return a pose or a position as a pinocchio.SE3.

    Args:
        what: name of the argument in messages.
        place: pinocchio.SE3, position (3,) or None.

    Raises:
        InputError: the value is neither.
    """
    if place is None:
        return pin.SE3.Identity()
    if isinstance(place, pin.SE3):
        array(what, place.homogeneous, (4, 4))
        return place.copy()
    return pin.SE3(np.eye(3), np.array(array(what, place, (3,))))


def shape_color(what: str, color: ArrayLike | None) -> Array | None:
    """Return red, green, blue and opacity, (4,), or None.

    Args:
        what: name of the argument in messages.
        color: three or four numbers from 0 to 1, or None.

    Raises:
        InputError: the value is neither.
    """
    if color is None:
        return None
    channels = array(what, color, (None,))
    if len(channels) not in (3, 4) or (channels < 0.0).any() or (channels > 1.0).any():
        raise InputError(
            f"{what} must be red, green, blue and optionally opacity, each from 0 to 1; "
            f"got {channels.tolist()}"
        )
    return np.array([*channels, 1.0][:4])


def _inertia(who: str, shape: object, density: float | None, mass: float | None) -> pin.Inertia:
    """Return the inertia of a homogeneous shape in its own axes, a pinocchio.Inertia.

    Raises:
        InputError: a length of the shape is not positive, the shape encloses no volume, or not exactly one of
            density and mass is given.
    """
    import coal

    if (density is None) == (mass is None):
        both = "neither" if density is None else "both"
        raise InputError(f"{who}: exactly one of density and mass must be given; got {both}")
    if not isinstance(shape, coal.CollisionGeometry):
        raise InputError(f"{who}: shape must be a shape of coal, such as coal.Box; got {short_repr(shape)}")
    check_lengths(f"{who}: shape", shape)
    volume = float(shape.computeVolume())
    moments = np.array(shape.computeMomentofInertiaRelatedToCOM())
    if volume < 0.0:  # mesh with inverted orientation
        volume, moments = -volume, -moments
    if not (volume > 0.0 and np.isfinite(moments).all() and np.linalg.eigvalsh(moments)[0] > 0.0):
        raise InputError(
            f"{who}: shape must enclose a volume; got a {type(shape).__name__} of {volume:g} m^3: "
            "give a solid, or a closed mesh"
        )
    if density is None:
        weight = positive(f"{who}: mass", mass)
    else:
        weight = positive(f"{who}: density", density) * volume
    return pin.Inertia(weight, np.array(shape.computeCOM()), weight / volume * moments)
