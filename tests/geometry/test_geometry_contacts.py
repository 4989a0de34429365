"""Boxes and collision geometry that touch planes, beside closed forms."""

from __future__ import annotations

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn

from ..support.contact_points import points_of
from ..support.mechanisms import GRAVITY, body, empty, frame
from ..support.refusals import refuses


def place(x=0.0, y=0.0, z=0.0):
    return pin.SE3(np.eye(3), np.array([x, y, z]))


def free_body(mass=1.0, inertia=0.02):
    model = empty((0.0, 0.0, -GRAVITY))
    joint = body(model, 0, pin.JointModelFreeFlyer(), "box", mass, inertia=inertia * np.eye(3))
    frame(model, "middle", joint, place())
    return model


def test_a_box_rests_on_four_corners():
    contacts = pn.box_contacts("middle", (0.4, 0.3, 0.2), mu=0.5, name="crate")
    assert contacts[0].name == "crate -x-y-z"
    start = [0, 0, 0.1, 0, 0, 0, 1]
    run = pn.simulate(pn.Scene(free_body(), contacts=contacts), 1.0, q=start, record="forces")
    assert np.abs(run.v).max() == 0.0
    lower = [run.contact_forces[c.name][-1, 2] for c in contacts if c.name.endswith("-z")]
    np.testing.assert_allclose(lower, GRAVITY / 4.0, rtol=1e-9)
    assert all((run.contact_forces[c.name] == 0.0).all() for c in contacts if c.name.endswith("+z"))


class TestGeometry:
    @staticmethod
    def scene(shape, radius_or_half, **more):
        model = free_body()
        geometry = pin.GeometryModel()
        geometry.addGeometryObject(pn.ground("floor", height=0.1))
        geometry.addGeometryObject(pin.GeometryObject("thing", 1, place(), shape))
        contact = pn.GeometryContact("thing", "floor", **more)
        return model, geometry, contact

    @pytest.mark.parametrize(
        ("shape", "height", "places"),
        [
            (coal.Sphere(0.2), 0.3, 1),
            (coal.Capsule(0.1, 0.4), 0.4, 2),
            (coal.Box(0.2, 0.3, 0.4), 0.3, 8),
        ],
    )
    def test_shapes_land_on_a_half_space(self, shape, height, places):
        model, geometry, contact = self.scene(shape, None, mu=0.4)
        scene = pn.Scene(model, contacts=[contact], collision_model=geometry)
        assert len(points_of(scene)) == places
        run = pn.simulate(scene, 0.5, q=[0, 0, height + 0.1, 0, 0, 0, 1])
        impact = next(e for e in run.events if e.kind == "impact")
        assert impact.time == pytest.approx(np.sqrt(0.2 / GRAVITY), abs=1e-11)
        assert run.q[-1, 2] == pytest.approx(height, abs=1e-10)
        pairs = pn.geometry_contacts(model, geometry, mu=0.4)
        assert pairs == [pn.GeometryContact("floor", "thing", mu=0.4)]
        assert points_of(pn.Scene(model, contacts=pairs, collision_model=geometry)) == points_of(scene)

    @pytest.mark.parametrize(
        ("shape", "fixed", "height"),
        [
            (coal.Sphere(0.2), coal.Sphere(0.1), 0.3),
            (coal.Sphere(0.2), coal.Capsule(0.1, 0.4), 0.3),
            (coal.Capsule(0.1, 0.6), coal.Sphere(0.2), 0.6),
            (coal.Capsule(0.1, 0.6), coal.Capsule(0.1, 0.4), 0.5),
        ],
    )
    def test_spheres_and_capsules_land_on_each_other(self, shape, fixed, height):
        """The fixed one lies along x; the other stands along z, and falls on its middle."""
        model, geometry, _ = self.scene(shape, None)
        lying = pin.SE3(pin.rpy.rpyToMatrix(0.0, np.pi / 2.0, 0.0), np.zeros(3))
        geometry.addGeometryObject(pin.GeometryObject("log", 0, lying, fixed))
        contact = pn.GeometryContact("thing", "log", mu=0.4)
        scene = pn.Scene(model, contacts=[contact], collision_model=geometry)
        assert scene.contact_names == ["thing on log"]
        run = pn.simulate(scene, 0.2, q=[0, 0, height + 0.1, 0, 0, 0, 1])
        impact = next(e for e in run.events if e.kind == "impact")
        assert impact.time == pytest.approx(np.sqrt(0.2 / GRAVITY), abs=1e-11)
        assert impact.v_plus == pytest.approx(np.zeros(6), abs=1e-12)

    def test_a_convex_mesh_stands_on_its_vertices(self):
        points = np.array([[0.2, 0, 0], [-0.1, 0.17, 0], [-0.1, -0.17, 0], [0, 0, 0.3]], dtype=float)
        points[:, 2] -= 0.05
        mesh = coal.BVHModelOBBRSS()
        mesh.beginModel(4, 4)
        mesh.addVertices(points)
        for a, b, c in ((0, 1, 2), (0, 1, 3), (1, 2, 3), (0, 2, 3)):
            mesh.addTriangle(points[a], points[b], points[c])
        mesh.endModel()
        mesh.buildConvexHull(True, "Qt")
        model, geometry, contact = self.scene(mesh.convex, None, mu=0.4)
        scene = pn.Scene(model, contacts=[contact], collision_model=geometry)
        run = pn.simulate(scene, 0.5, q=[0, 0, 0.2, 0, 0, 0, 1])
        assert run.q[-1, 2] == pytest.approx(0.15, abs=1e-10)
        model, geometry, contact = self.scene(mesh, None, mu=0.4)
        assert points_of(pn.Scene(model, contacts=[contact], collision_model=geometry)) == points_of(scene)

    @staticmethod
    def mesh(points, triangles):
        mesh = coal.BVHModelOBBRSS()
        mesh.beginModel(len(triangles), 3 * len(triangles))
        for corners in triangles:
            mesh.addTriangle(*np.asarray(points, dtype=float)[list(corners)])
        mesh.endModel()
        return mesh

    def test_a_mesh_that_is_not_convex_is_refused(self):
        corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0.1, 0.1, 0.1]]
        dent = [(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 4), (2, 3, 4), (3, 1, 4)]
        model, geometry, contact = self.scene(self.mesh(corners, dent), None)
        with refuses(
            'GeometryContact: geometry "thing" is a mesh that must be convex; its surface lies 0.1 m inside '
            "its convex hull: split it into convex parts, or make a convex mesh of it",
            pn.InputError,
        ):
            pn.Scene(model, contacts=[contact], collision_model=geometry)
        model, geometry, contact = self.scene(self.mesh(corners, dent[:3]), None)
        with pytest.raises(pn.InputError, match="is a mesh that must be closed"):
            pn.Scene(model, contacts=[contact], collision_model=geometry)
        flat = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]
        model, geometry, contact = self.scene(self.mesh(flat, [(0, 1, 2), (1, 2, 3)]), None)
        with pytest.raises(pn.InputError, match='"thing" must span a solid, at least four points out of'):
            pn.Scene(model, contacts=[contact], collision_model=geometry)

    def test_what_does_not_touch_is_refused(self, tmp_path):
        model, geometry, contact = self.scene(coal.Plane(np.array([0.0, 0.0, 1.0]), 0.0), None)
        with pytest.raises(pn.InputError, match='geometry "thing" is a Plane; spheres, capsules, boxes, cyl'):
            pn.Scene(model, contacts=[contact], collision_model=geometry)
        with pytest.raises(pn.InputError, match="needs the scene's collision_model"):
            pn.Scene(model, contacts=[contact])
        with pytest.raises(pn.UnknownNameError, match='no geometry "thin" in the collision model; nearest'):
            pn.Scene(model, contacts=[pn.GeometryContact("thin", "floor")], collision_model=geometry)
        with pytest.raises(pn.InputError, match="on the same body, which cannot touch itself"):
            pn.Scene(model, contacts=[pn.GeometryContact("floor", "floor")], collision_model=geometry)
        with refuses("geometry_contacts: model must be a pinocchio.Model; got 3", pn.InputError):
            pn.geometry_contacts(3, geometry)
        with refuses("geometry_contacts: mu must not be negative; got -1", pn.InputError):
            pn.geometry_contacts(model, geometry, mu=-1.0)
        with refuses('geometry_contacts: srdf: no file "none.srdf"; give a path', pn.LoadingError):
            pn.geometry_contacts(model, geometry, "none.srdf")
        text = tmp_path / "text.srdf"
        text.write_text("hello")
        with refuses(f'geometry_contacts: srdf "{text}" must be an SRDF file: ', pn.LoadingError):
            pn.geometry_contacts(model, geometry, text)


def test_a_box_needs_edges():
    with pytest.raises(
        pn.InputError, match=r"size must be positive, got \[0.1, 0.0, 0.1\]; give three edges"
    ):
        pn.box_contacts("a", (0.1, 0.0, 0.1))
