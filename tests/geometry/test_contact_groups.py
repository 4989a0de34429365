"""Corners and edges of two shapes are added in groups, and are the same as contacts added one by one."""

from __future__ import annotations

from collections.abc import Callable

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.compilation.lowering import lower
from pin_nonideal.compilation.resolver import Resolver
from pin_nonideal.core_loader import core
from pin_nonideal.description.contacts.pair_of_shapes import (
    BallContacts,
    CapsulePairs,
    numbered,
    split,
)
from pin_nonideal.scene.scene import compiled_scene

EDGES = 12
CORNERS = 8
LINE = ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))


def boxes(count: int = 3, mu: float = 0.4) -> pn.Scene:
    """Return boxes that fall on the ground and on each other."""
    model, shapes, generator = pin.Model(), pin.GeometryModel(), np.random.default_rng(3)
    for k in range(count):
        turn = pin.rpy.rpyToMatrix(*generator.uniform(-0.5, 0.5, 3))
        place = pin.SE3(turn, np.array([0.04 * k, 0.02 * k, 0.1 + 0.18 * k]))
        pn.free_body(
            model, f"box {k}", coal.Box(0.1, 0.12, 0.14), mass=1.0, collision_model=shapes, place=place
        )
    contacts = pn.ground_contacts(model, shapes, mu=mu) + pn.geometry_contacts(model, shapes, mu=mu)
    return pn.Scene(model, contacts=contacts, collision_model=shapes)


def program_of(scene: pn.Scene, one_by_one: bool) -> core.Program:
    """Return the core's program of a scene."""
    compiled = compiled_scene(scene)
    spec = compiled.spec
    if one_by_one:
        spec = spec._replace(contacts=tuple(split(c) for c in spec.contacts))
    builder = core.Builder(compiled.model, core.Provider[spec.terms])
    lower(spec, builder, Resolver(compiled.model, compiled.q0))
    return builder.finish()


def shapes_on_each_other() -> pn.Scene:
    """Return a box, a mesh, a cylinder and a cone, each over the one before."""
    model, shapes = pin.Model(), pin.GeometryModel()
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(4, 4)
    mesh.addVertices(0.1 * np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))
    mesh.addTriangles(np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], dtype=np.uint64))
    mesh.endModel()
    mesh.buildConvexHull(True, "Qt")
    solids = (coal.Box(0.2, 0.2, 0.1), mesh.convex, coal.Cylinder(0.1, 0.1), coal.Cone(0.1, 0.1))
    for k, solid in enumerate(solids):
        place = pin.SE3(pin.rpy.rpyToMatrix(0.1 * k, 0.2, 0.3), np.array([0.0, 0.0, 0.1 + 0.15 * k]))
        pn.free_body(model, f"solid {k}", solid, mass=1.0, collision_model=shapes, place=place)
    contacts = pn.geometry_contacts(model, shapes, mu=0.3)
    return pn.Scene(model, contacts=contacts, collision_model=shapes)


def test_a_pair_of_boxes_adds_its_corners_and_edges_in_groups() -> None:
    pair = compiled_scene(boxes(2)).spec.contacts[-1]
    kinds = [(type(part), len(part)) for part in pair.parts]
    assert kinds == [(BallContacts, CORNERS), (BallContacts, CORNERS), (CapsulePairs, EDGES * EDGES)]
    assert list(pair.names) == [point.name for point in pair.points]
    assert list(pair.names) == [f"{pair.name} {k + 1}" for k in range(2 * CORNERS + EDGES * EDGES)]


@pytest.mark.parametrize("make", [lambda: boxes(mu=0.0), boxes, shapes_on_each_other])
def test_the_program_is_that_of_contacts_added_one_by_one(make: Callable[[], pn.Scene]) -> None:
    scene = make()
    together, single = program_of(scene, False), program_of(scene, True)
    for key in ("block_names", "first_rows", "contacts", "element_names", "law_names", "first_gap", "rows"):
        assert getattr(together, key) == getattr(single, key)
    blocks = list(range(together.first_gap, len(together.block_names)))
    q = scene.q0[None]
    gaps = [np.asarray(core.gap_values(p, q, np.zeros(1), blocks)) for p in (together, single)]
    np.testing.assert_array_equal(*gaps)
    elements = list(range(len(together.element_names)))
    axes = [np.asarray(core.slip_axes(p, q, np.zeros(1), elements)) for p in (together, single)]
    np.testing.assert_array_equal(*axes)


def test_points_are_described_by_name() -> None:
    compiled = compiled_scene(boxes())
    assert list(compiled.described) == list(compiled.slices)
    for contact, names in compiled.points.items():
        pair = next(c for c in compiled.spec.contacts if c.name == contact)
        assert [compiled.described[name] for name in names] == list(pair.points)


def test_a_name_of_a_point_is_refused_twice() -> None:
    scene = boxes(2)
    pair = scene.contacts[-1]
    own = pn.PointContact("box 0", radius=0.01, name=f"{compiled_scene(scene).spec.contacts[-1].name} 40")
    with pytest.raises(pn.InputError, match='40" is used twice'):
        pn.Scene(scene.model, contacts=[own, pair], collision_model=scene.collision_model)


def test_a_law_with_the_name_of_a_contact_with_friction_is_refused() -> None:
    """The friction of the contact is a law of this name."""
    scene = boxes(2)
    law = pn.JointFriction("box 0", viscous=0.1, name=scene.contact_names[-1])
    with pytest.raises(pn.InputError, match="names must be unique"):
        pn.Scene(scene.model, contacts=scene.contacts, laws=[law], collision_model=scene.collision_model)
    smooth = boxes(2, mu=0.0)
    again = pn.Scene(
        smooth.model, contacts=smooth.contacts, laws=[law], collision_model=smooth.collision_model
    )
    assert again.law_names == [law.name]


@pytest.mark.parametrize("mu", [0.0, 0.4])
def test_a_law_with_the_name_of_a_contact_point_is_refused(mu: float) -> None:
    scene = boxes(2, mu)
    for number, is_refused in ((1, True), (160, True), (161, False)):
        law = pn.JointFriction("box 0", viscous=0.1, name=f"{scene.contact_names[-1]} {number}")
        parts = {"contacts": scene.contacts, "laws": [law], "collision_model": scene.collision_model}
        if not is_refused:
            assert law.name in pn.Scene(scene.model, **parts).law_names
            continue
        with pytest.raises(pn.InputError, match="names must be unique"):
            pn.Scene(scene.model, **parts)


def test_a_group_of_one_contact_has_no_number() -> None:
    pairs = CapsulePairs(pn.CapsuleContact("a", "b", LINE, LINE, 0.1), (LINE,), (LINE,))
    (single,) = numbered([pairs], "pair")
    assert single.name == "pair"
    assert [part.name for part in numbered([pairs.like, pairs], "pair")] == ["pair 1", "pair 2"]


def test_the_violation_of_a_sample_is_that_of_all_contacts() -> None:
    """Samples of time stepping measure the gaps that may be closed only."""
    scene = boxes(5)
    run = pn.simulate(scene, 0.3, method="moreau", dt=1e-3, record="forces", progress=False)
    least = np.min([run.contact(name).gap for name in scene.contact_names], axis=0)
    assert run.violation.max() > 1e-6
    np.testing.assert_allclose(run.violation, np.maximum(0.0, -least), atol=1e-15)
