"""What each contact is: frozen descriptions of what is kept on what, and of the friction there."""

from __future__ import annotations

from dataclasses import dataclass

from .checks import label, nonnegative, optional_text, text, unit_axis
from .constraints import Axis
from .errors import InputError
from .laws import static_ratio

__all__ = [
    "PointContact",
]


@dataclass(frozen=True)
class PointContact:
    """Keeps the origin of a frame, or a sphere around it, on a plane, with Coulomb friction there.

    Residual: phi = n . (p - p_plane) - radius [m].
    Rows: 1.  lam: the normal force on the frame's body [N]; positive presses, and a negative one (a pull) is
    reported.
    Sliding friction on the body at the contact point: -mu lam u/|u|, with u the slip velocity in the
    plane, Eqs. (77)-(80); sticking holds while the tangential force is below static_ratio mu lam.
    A spot of contact of some size resists turning too.  With w the angular velocity of the frame's body
    against that of the plane, the torque torsional |lam| opposes its part along the normal (spinning), and
    the torque rolling |lam| its part along the plane (rolling); each sticks and slips on its own, as sliding
    does.

    Args:
        frame: name of a frame of the model.
        mu: kinetic coefficient of friction.
        static_ratio: static over kinetic friction of all three, at least 1.
        plane: name of the frame whose origin the plane goes through (its body may move); None for the world's
            origin.
        normal: normal of the plane, in the axes of the plane's frame: "x", "y", "z" or three numbers.
        radius: radius of the sphere around the frame's origin [m]; 0 for a point.
        torsional: torque against spinning over normal force [m]; where the spot is a circle of radius R,
            2/3 mu R when it presses evenly and 3/16 pi mu R when it is that of a sphere (Hertz).
        rolling: torque against rolling over normal force [m], the lever of rolling resistance.
        name: used in messages and results.
    """

    frame: str
    mu: float = 0.0
    static_ratio: float = 1.0
    plane: str | None = None
    normal: Axis = "z"
    radius: float = 0.0
    torsional: float = 0.0
    rolling: float = 0.0
    name: str | None = None

    def __post_init__(self) -> None:
        optional_text("PointContact: name", self.name)
        who = label(self)
        text(f"{who}: frame", self.frame)
        optional_text(f"{who}: plane", self.plane)
        if self.plane == self.frame:
            raise InputError(f'{who}: frame and plane must differ; both are "{self.frame}"')
        for key in ("mu", "radius", "torsional", "rolling"):
            object.__setattr__(self, key, nonnegative(f"{who}: {key}", getattr(self, key)))
        object.__setattr__(self, "static_ratio", static_ratio(who, self.static_ratio))
        object.__setattr__(self, "normal", unit_axis(f"{who}: normal", self.normal))


Contact = PointContact
