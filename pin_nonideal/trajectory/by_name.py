"""What a run recorded, by the name of a joint, frame, constraint, contact or law."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.errors import InputError, UnknownNameError, nearest
from pin_nonideal.states.joint_layout import CIRCLES, JointPlace
from pin_nonideal.states.kinematics import frame_motion
from pin_nonideal.types import Array
from pin_nonideal.validation import choice

from .records import FrameRecord, JointRecord, LawRecord, angles


class ByName:
    """What a Trajectory tells of its parts."""

    if TYPE_CHECKING:
        t: Array
        q: Array
        v: Array
        a: Array | None
        tau: Array | None
        lam: Array | None
        power: dict[str, Array] | None
        modes: NDArray[np.int8] | None
        limits: Array | None
        law_forces: dict[str, Array] | None
        reactions: dict[str, Array] | None
        scene: Any
        element_laws: list[int]
        law_names: list[str]
        law_dofs: list[list[int]]
        joints: list[JointPlace]
        rows: dict[str, tuple[int, int, bool]]

    def joint(self, name: str) -> JointRecord:
        """What one joint did.

        Args:
            name: of a joint; "base" is the only floating one.

        Returns:
            Its record; what was not recorded is None.

        Raises:
            UnknownNameError: there is no such joint.
        """
        floating = [place for place in self.joints if place.kind == "JointModelFreeFlyer"]
        known = {"base": floating[0]} if len(floating) == 1 else {}
        known |= {place.name: place for place in self.joints}
        if name not in known:
            raise UnknownNameError(f'no joint "{name}" in this run{nearest(name, known)}')
        place = known[name]
        rates = slice(place.v_first, place.v_first + place.nv)
        v, a, tau = (None if x is None else x[:, rates] for x in (self.v, self.a, self.tau))
        assert v is not None
        q = self.q[:, place.q_first : place.q_first + place.nq]
        if place.kind.startswith(CIRCLES):
            q = np.column_stack([q[:, :-2], angles(q[:, -2:], v[:, -1], self.t)])
        alone = place.nv == 1 and q.shape[1] == 1
        parts = [x if x is None or not alone else x[:, 0] for x in (q, v, a, tau)]
        return JointRecord(place.name, *parts)  # type: ignore[arg-type]

    def frame(self, name: str) -> FrameRecord:
        """How one frame moved: its placement and velocity in the world, from the kinematics of the tree.

        Args:
            name: of a frame or joint of the model.

        Raises:
            InputError: the run does not know its scene, which has the model.
            UnknownNameError: there is no such frame.
        """
        if self.scene is None:
            raise InputError(f'frame("{name}") needs the scene of the run, which this one has lost')
        model = self.scene.model
        known = [str(f.name) for f in model.frames] + [str(n) for n in model.names]
        if name not in known:
            raise UnknownNameError(f'no frame "{name}" in model "{model.name}"{nearest(name, known)}')
        return FrameRecord(name, *frame_motion(model, name, self.q, self.v))

    def force(self, name: str) -> Array:
        """What one constraint or contact exerts.

        Args:
            name: of a constraint or contact of the scene.

        Returns:
            Multipliers of a constraint's rows in M a = F + C + A^T lam, (nt, rows), those of an anchor the
            force on the body of frame1 in the axes of frame2 [N; N m]; record "forces".  Of a contact the
            force on the body of its frame in world axes [N], friction included, (nt, 3); record "reactions".

        Raises:
            InputError: it was not recorded.
            UnknownNameError: there is no such constraint or contact.
        """
        if name not in self.rows:
            raise UnknownNameError(f'no constraint or contact "{name}" in this run{nearest(name, self.rows)}')
        first, end, contact = self.rows[name]
        if contact:
            return self.reaction(name, "world")[:, :3]
        if self.lam is None:
            raise InputError(f'force("{name}") needs a run with record="forces"')
        return self.lam[:, first:end]

    def law(self, name: str) -> LawRecord:
        """What one law did.

        Args:
            name: of a law of the scene, or of a contact that rubs.

        Returns:
            Its record; what was not recorded is None.

        Raises:
            UnknownNameError: there is no such law.
        """
        if name not in self.law_names:
            raise UnknownNameError(f'no law "{name}" in this run{nearest(name, self.law_names)}')
        index, force, power = self.law_names.index(name), None, None
        if self.law_forces is not None:
            force = np.zeros(self.v.shape)
            force[:, self.law_dofs[index]] = self.law_forces[name]
            power = np.einsum("ij,ij->i", force, self.v)
        if self.power is not None:  # after three columns of the scene
            power = list(self.power.values())[len(self.power) - len(self.law_names) + index]
        own = [e for e, law in enumerate(self.element_laws) if law == index]
        columns = own[0] if len(own) == 1 else own
        limit = self.limits[:, columns] if own and self.limits is not None else None
        mode = self.modes[:, columns] if own and self.modes is not None else None
        return LawRecord(name, force, power, limit, mode)

    def reaction(self, name: str, axes: str = "own") -> Array:
        """What a joint, an anchor or a contact carries, all forces in it included: [force; moment], (nt, 6).

        A joint's is exerted on the body that it moves, about its origin; it contains the drive and the
        friction of the joint.  That of an anchor or contact is exerted on the body of frame1, about the
        origin of frame1; it contains the friction of its laws.

        Args:
            name: of a joint of the model, or of an anchor or contact, which goes before a joint of its name.
            axes: "own", the joint frame's or those of frame2, or "world".

        Raises:
            InputError: the run did not record "reactions", or `axes` is neither.
            UnknownNameError: nothing of that name carries a wrench.
        """
        if self.reactions is None:
            raise InputError(f'reaction("{name}") needs a run with record="reactions"')
        if name not in self.reactions:
            raise UnknownNameError(f'no joint, anchor or contact "{name}"{nearest(name, self.reactions)}')
        begin = 6 * ("own", "world").index(choice("reaction: axes", axes, ("own", "world")))
        return self.reactions[name][:, begin : begin + 6]
