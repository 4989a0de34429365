"""Texts about a scene: its table in notebooks, and the notes of its report."""

from __future__ import annotations

from pin_nonideal.html_tables import names as listed
from pin_nonideal.html_tables import table

from .base import SceneBase


def html_summary(scene: SceneBase) -> str:
    """Return an HTML table with the parts of a scene, for notebooks.

    Args:
        scene: the scene.
    """
    joints = [str(name) for name in scene.model.names[1:]]
    actuation = type(scene.actuation).__name__ if scene.actuation is not None else "none"
    contacts = set(scene.contact_names)
    rows = [
        ("joints", listed(joints)),
        ("degrees of freedom", scene.model.nv),
        ("constraints", listed([name for name in scene.constraint_slices if name not in contacts])),
        ("contacts", listed(scene.contact_names)),
        ("laws", listed(scene.law_names)),
        ("forces", len(scene.forces)),
        ("actuation", "a function" if actuation == "function" else actuation),
    ]
    return table(f'Scene "{scene.name}"', rows)


def notes_of(scene: SceneBase, start_notes: list[str]) -> list[str]:
    """Return the notes, the source and the license of a scene, a line each.

    Args:
        scene: the scene.
        start_notes: notes on the closed initial state.
    """
    notes = [f"note: {note}" for note in (*scene.notes, *start_notes)]
    credits = {"source": scene.source, "licence": scene.licence}
    return notes + [f"{key}: {value}" for key, value in credits.items() if value]
