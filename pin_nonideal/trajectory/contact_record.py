"""Record of one contact of a run: its resultant, center of pressure and gap."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pin_nonideal.errors import InputError, UnknownNameError, nearest
from pin_nonideal.scene.scene import compiled_scene
from pin_nonideal.types import Array
from pin_nonideal.validation import text

from .contact_points import contact_bodies, contact_lines, gaps_of_points
from .fields import RunFields
from .records import ContactRecord
from .resultants import centers


def contact_record(run: RunFields, name: str) -> ContactRecord:
    """Return the record of one contact; see `Trajectory.contact`."""
    name = text("contact: name", name)
    if run.scene is None:
        raise InputError(f'contact("{name}") needs the scene of the run, which this one has lost')
    if not run.recorded("contact_forces"):
        raise InputError(f'contact("{name}") needs a run with record="forces"')
    scene, forces, torques = run.scene, run.contact_forces or {}, run.contact_torques or {}
    if name not in forces:
        if name in scene.contact_names:
            raise InputError(f'contact("{name}") has no contact point; see run.force("{name}")')
        raise UnknownNameError(f'no contact "{name}" in this run{nearest(name, forces)}')
    compiled = compiled_scene(scene)
    points = compiled.points.get(name, [name])
    q = np.asarray(run.q, dtype=float)
    bodies = contact_bodies(compiled, name)
    loads, touching = _loads(run, name)
    closed: NDArray[np.bool_] = np.ones(len(run.t), dtype=bool)
    if run.closed is not None:
        closed = run.closed[:, scene.contact_names.index(name)]
    return ContactRecord(
        name=name,
        points=list(points),
        bodies=(str(scene.model.names[bodies.joint]), str(scene.model.names[bodies.other])),
        closed=closed,
        force=forces[name],
        torque=torques[name],
        normal_force=loads.sum(axis=1),
        center=centers(loads, contact_lines(compiled, q, run.t, touching)[0]),
        gap=gaps_of_points(compiled, q, run.t, points).min(axis=1),
    )


def _loads(run: RunFields, name: str) -> tuple[Array, list[str]]:
    """Return the normal forces of the points of a contact that touch [N], (nt, n), and their names."""
    if run.points is not None and (columns := run.points.of(name)):
        return run.points.loads[:, columns], [run.points.names[k] for k in columns]
    last = run.rows[name][1] - 1
    plain_names = [] if name in compiled_scene(run.scene).points else [name]
    return run.lam[:, last : last + len(plain_names)], plain_names
