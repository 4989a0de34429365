"""A pair of shapes is one contact in all results, with the sums and resultants of its points."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.compilation.contact_groups import Groups
from pin_nonideal.description.contacts.point_names import NO_POINTS, ContactOfPoint
from pin_nonideal.scene.scene import compiled_scene
from pin_nonideal.states.rows import rows_at

G, MASS, EDGE, MU = 9.81, 4.0, 0.2, 0.6
EVERYTHING = ("contact_points", "reactions", "energy", "power", "a")
METHODS = {"moreau": {"dt": 1e-3}, "dop853": {}}


def pile(**options: object) -> pn.Scene:
    """Return two boxes on each other on the ground, turned and shifted, and a ball beside."""
    model, shapes = pin.Model(), pin.GeometryModel()
    shapes.addGeometryObject(pn.ground())
    for k in range(2):
        turn = pin.rpy.rpyToMatrix(0.0, 0.0, 0.3 * k)
        place = pin.SE3(turn, np.array([0.03 * k, 0.02 * k, (k + 0.5) * EDGE]))
        shape = coal.Box(EDGE, EDGE, EDGE)
        pn.free_body(model, f"box {k}", shape, mass=MASS, collision_model=shapes, place=place)
    pn.free_body(model, "ball", coal.Sphere(0.1), mass=1.0, collision_model=shapes, place=(1.0, 0.0, 0.1))
    contacts = [
        pn.GeometryContact("box 0", "ground", mu=MU),
        pn.GeometryContact("box 1", "box 0", mu=MU, name="upper"),
        pn.GeometryContact("ball", "ground", mu=MU),
    ]
    return pn.Scene(model, contacts=contacts, collision_model=shapes, **options)


NAMES = ["box 0 on ground", "upper", "ball on ground"]


def pushed(**options: object) -> pn.Scene:
    """Return the pile with a push on the lower box that is below the limit of its friction."""
    push = np.zeros(18)
    push[0] = 0.5 * MU * 2.0 * MASS * G
    return pile(actuation=push, **options)


@pytest.fixture(scope="module", params=sorted(METHODS))
def run(request: pytest.FixtureRequest) -> pn.Trajectory:
    return pn.simulate(pushed(), 0.02, method=request.param, record=EVERYTHING, **METHODS[request.param])


def test_each_result_has_one_entry_a_contact(run: pn.Trajectory) -> None:
    scene, nt = run.scene, len(run)
    assert [type(c).__name__ for c in scene.contacts] == ["GeometryContact"] * 3
    assert scene.contact_names == scene.element_names == scene.law_names == NAMES
    assert list(scene.constraint_slices) == list(run.rows) == run.law_names == run.element_names == NAMES
    assert run.element_laws == [0, 1, 2]
    for x in (run.closed, run.lam, run.lam_ideal, run.modes, run.limits):
        assert x.shape == (nt, 3)
    assert list(run.contact_forces) == list(run.contact_torques) == list(run.contact_points) == NAMES
    assert list(run.law_forces) == NAMES
    assert set(run.reactions) == {"box 0", "box 1", "ball", *NAMES}
    assert [name for name in run.energy if " on " in name or name == "upper"] == NAMES
    assert [name for name in run.power if " on " in name or name == "upper"] == NAMES
    assert not any(name.endswith(tuple("123456789")) and "ground_" in name for name in run.columns())


def test_forces_carry_the_boxes(run: pn.Trajectory) -> None:
    push = 0.5 * MU * 2.0 * MASS * G
    loads = np.array([2.0 * MASS * G, MASS * G, G])
    np.testing.assert_allclose(run.lam, np.tile(loads, (len(run), 1)), rtol=1e-9)
    np.testing.assert_allclose(run.limits, np.tile(MU * loads, (len(run), 1)), rtol=1e-9)
    assert run.closed.all()
    assert (run.modes == 0).all()
    for name, force in zip(NAMES, ([-push, 0, loads[0]], [0, 0, loads[1]], [0, 0, loads[2]]), strict=True):
        np.testing.assert_allclose(run.contact_forces[name], np.tile(force, (len(run), 1)), atol=1e-7)
        np.testing.assert_allclose(run.force(name), run.contact_forces[name], atol=1e-10)


def test_laws_and_moments_balance_the_equation_of_motion(run: pn.Trajectory) -> None:
    """The wrenches of the contacts and the weight hold each box; the parts of C are those wrenches."""
    for k in range(len(run)):
        friction = sum(run.law(name).force[k] for name in NAMES)
        np.testing.assert_allclose(
            run.F_ideal[k] + run.F_nonideal[k] + run.tau[k] - run.scene.bias_forces(run.q[k], run.v[k]),
            run.scene.mass_matrix(run.q[k]) @ run.a[k],
            atol=1e-7,
        )
        np.testing.assert_allclose(friction[:3] + run.tau[k, :3], 0.0, atol=1e-7)  # along the ground
    lower, upper = run.reaction("box 0 on ground"), run.reaction("upper", "world")
    middle = run.frame("box 0").translation
    above = run.frame("box 1").translation
    moment = lower[:, 3:] - upper[:, 3:] - np.cross(above - middle, upper[:, :3])
    np.testing.assert_allclose(moment, 0.0, atol=1e-6)
    turned = np.einsum("kji,kj->ki", run.frame("box 0").rotation, upper[:, :3])
    np.testing.assert_allclose(run.reaction("upper")[:, :3], turned, atol=1e-12)


def test_points_add_up_to_the_contact(run: pn.Trajectory) -> None:
    for name, count in zip(NAMES, (8, 160, 1), strict=True):
        points, record = run.contact_points[name], run.contact(name)
        assert len(points.points) == count
        assert points.places.shape == points.forces.shape == (len(run), count, 3)
        assert points.gaps.shape == points.closed.shape == (len(run), count)
        assert points.points == record.points
        np.testing.assert_allclose(points.forces.sum(axis=1), run.contact_forces[name], atol=1e-9)
        moment = np.cross(points.places - record.center[:, None], points.forces).sum(axis=1)
        np.testing.assert_allclose(moment, run.contact_torques[name], atol=1e-9)
        np.testing.assert_allclose(points.gaps.min(axis=1), record.gap, atol=1e-15)
        assert (np.abs(points.gaps[points.closed]) < 1e-10).all()
        assert not points.forces[~points.closed].any()
        assert (points.closed.any(axis=1) == run.closed[:, NAMES.index(name)]).all()
    runner = compiled_scene(run.scene).program.runner()
    gaps = rows_at(runner, run.q[-1], run.v[-1], float(run.t[-1]))[2]
    every = np.hstack([run.contact_points[name].gaps[-1] for name in NAMES])
    np.testing.assert_allclose(every, gaps, atol=1e-15)


def test_a_run_records_the_points_that_touch_only() -> None:
    """Two boxes have 160 points, of which a few touch."""
    scene = pushed()
    plain = pn.simulate(scene, 0.02, method="moreau", dt=1e-3, record="forces")
    every = pn.simulate(scene, 0.02, method="moreau", dt=1e-3, record="contact_points")
    assert len(plain.points.names) < 16
    assert "ball on ground" not in plain.points.names
    assert not plain.contact_points
    for name in NAMES:
        np.testing.assert_array_equal(plain.contact_forces[name], every.contact_forces[name])
        np.testing.assert_allclose(plain.contact_torques[name], every.contact_torques[name], atol=1e-12)
        np.testing.assert_allclose(plain.contact(name).center, every.contact(name).center, atol=1e-12)


def test_files_and_parts_of_runs_keep_the_points(run: pn.Trajectory, tmp_path: Path) -> None:
    read = pn.Trajectory.load(run.save(tmp_path / "run.npz"), run.scene)
    alone = pn.Trajectory.load(tmp_path / "run.npz", None)
    some = run.samples(slice(1, 3))
    for name in NAMES:
        points = run.contact_points[name]
        for other in (read, alone):
            assert other.contact_points[name].points == points.points
            for key in ("closed", "gaps", "places", "forces"):
                np.testing.assert_array_equal(getattr(other.contact_points[name], key), getattr(points, key))
            np.testing.assert_array_equal(other.contact_torques[name], run.contact_torques[name])
        np.testing.assert_array_equal(some.contact_points[name].gaps, points.gaps[1:3])
        np.testing.assert_array_equal(some.contact(name).force, run.contact(name).force[1:3])
        np.testing.assert_array_equal(read.contact(name).center, run.contact(name).center)


def test_a_solution_has_one_entry_a_contact() -> None:
    scene = pushed()
    now = scene.solve(scene.q0, scene.v0)
    np.testing.assert_allclose(now.lam, [2.0 * MASS * G, MASS * G, G], rtol=1e-9)
    assert now.closed.tolist() == [True] * 3
    assert now.modes.tolist() == [0] * 3
    slips = scene.solve(scene.q0, scene.v0, modes=[1, 0, 0])
    assert slips.modes.tolist() == [1, 0, 0]
    raised = scene.q0.copy()
    raised[2] += 0.1
    raised[9] += 0.1
    apart = scene.solve(raised, scene.v0)
    assert apart.closed.tolist() == [False, True, True]
    assert apart.modes.tolist()[0] == 2
    assert scene.jacobian("box 0 on ground").shape == (8, 18)
    assert scene.jacobian("ball on ground").shape == (1, 18)


def test_a_rocking_box_has_events_of_the_pair() -> None:
    """A box falls onto an edge and then onto its face: impacts are summed, and no point is named."""
    scene = pile(
        q0={"box 0": {"xyz": [0.0, 0.0, 0.15], "rpy": [0.2, 0.0, 0.0]}, "box 1": {"xyz": [2.0, 0.0, 0.1]}}
    )
    run = pn.simulate(scene, 0.6, record="forces")
    assert {event.element for event in run.events} <= set(NAMES)
    impacts = [event for event in run.events if event.kind == "impact" and event.element == NAMES[0]]
    assert len(impacts) >= 2
    for event in impacts:
        gained = MASS * (event.v_plus[2] - event.v_minus[2])  # the axes of the box are turned about x only
        turned = pin.rpy.rpyToMatrix(0.2, 0.0, 0.0) if event is impacts[0] else None
        if turned is not None:
            gained = MASS * (turned @ (event.v_plus - event.v_minus)[:3])[2]
            assert event.impulse[0] == pytest.approx(gained, rel=1e-6)
    keys = [(event.time, event.kind, event.element) for event in run.events]
    assert len(keys) == len(set(keys))
    for event in run.events:
        after = int(np.searchsorted(run.t, event.time, side="right")) - 1
        column = NAMES.index(event.element)
        if event.kind in ("touch_down", "lift_off"):
            assert run.closed[after, column] == (event.kind == "touch_down")
        if event.kind in ("slip", "stick"):
            assert run.modes[after, column] == (0 if event.kind == "stick" else 1)


def test_parameters_of_a_rollout_reach_all_points() -> None:
    scene = pushed()
    rates = [0.2, 0.4, 0.5]
    runs = pn.rollout(
        scene,
        None,
        None,
        duration=0.02,
        method="moreau",
        dt=1e-3,
        record="forces",
        parameters={"box 0 on ground": {"mu": rates}},
    )
    own = scene.contacts[0]
    for mu, run in zip(rates, runs, strict=True):
        contacts = [pn.GeometryContact(own.geometry1, own.geometry2, mu=mu), *scene.contacts[1:]]
        alone = pn.simulate(scene.replace(contacts=contacts), 0.02, method="moreau", dt=1e-3, record="forces")
        np.testing.assert_allclose(run.q, alone.q, atol=1e-14)
        np.testing.assert_allclose(run.limits[:, 0], alone.limits[:, 0], atol=1e-9)
    with pytest.raises(pn.InputError, match="rounding changes the structure of the scene"):
        pn.rollout(scene, None, None, 0.01, parameters={"upper": {"rounding": [1e-3, 2e-3]}})


def test_copies_and_replacements_keep_the_manifolds() -> None:
    scene = pile()
    for again in (copy.deepcopy(scene), pickle.loads(pickle.dumps(scene)), scene.replace(name="other")):
        assert again.contact_names == NAMES
        assert [type(c) for c in again.contacts] == [pn.GeometryContact] * 3
        assert compiled_scene(again).points == compiled_scene(scene).points
    assert scene.replace(remove=["upper"]).contact_names == [NAMES[0], NAMES[2]]
    with pytest.raises(pn.UnknownNameError, match='"upper 3" to remove'):
        scene.replace(remove=["upper 3"])
    twice = [pn.GeometryContact("box 0", "ground"), pn.GeometryContact("box 0", "ground")]
    with pytest.raises(pn.InputError, match='"box 0 on ground" is used twice'):
        scene.replace(contacts=twice)


def test_messages_name_the_pair() -> None:
    scene = pile()
    q = scene.q0.copy()
    q[2] -= 0.05
    with pytest.raises(pn.InputError, match=r'contact "(box 0 on ground|upper)" starts'):
        scene.project(q)
    with pytest.raises(pn.UnknownNameError, match=r'no constraint or contact "upper 3".*nearest: "upper"'):
        scene.jacobian("upper 3")
    assert "contact upper: 1 rows of 160 points, may open" in scene.report()
    assert [row["kind"] for row in scene.describe().contacts] == ["GeometryContact"] * 3


def test_rest_names_the_pair() -> None:
    """A push on one box, half of its friction."""
    model, shapes = pin.Model(), pin.GeometryModel()
    pn.free_body(
        model, "box", coal.Box(EDGE, EDGE, EDGE), mass=MASS, collision_model=shapes, place=(0, 0, 0.1)
    )
    push = [0.5 * MU * MASS * G, 0.0, 0.0, 0.0, 0.0, 0.0]
    contacts = pn.ground_contacts(model, shapes, mu=MU)
    found = pn.rest(pn.Scene(model, contacts=contacts, actuation=push, collision_model=shapes))
    assert list(found.friction) == ["box on ground"]
    np.testing.assert_allclose(found.lam, [MASS * G], rtol=1e-6)
    assert found.margin == pytest.approx(0.5, abs=1e-6)
    assert np.linalg.norm(found.friction["box on ground"]) == pytest.approx(push[0], rel=1e-6)
    slides = pn.rest(
        pn.Scene(model, contacts=contacts, actuation=np.multiply(push, 3), collision_model=shapes)
    )
    assert 'at their limits: "box on ground"' in slides.reason


def test_a_law_reads_the_load_of_the_pair() -> None:
    """The sum over its points, and not the load of one of them."""
    model, shapes = pin.Model(), pin.GeometryModel()
    pn.free_body(
        model, "box", coal.Box(EDGE, EDGE, EDGE), mass=MASS, collision_model=shapes, place=(0, 0, 0.1)
    )
    read = []

    def law(t: float, q: np.ndarray, v: np.ndarray, reactions: object) -> list[float]:
        read.append((reactions["box on ground"].copy(), reactions.lam.copy()))
        return [0.0] * 6

    contacts = pn.ground_contacts(model, shapes)
    scene = pn.Scene(model, contacts=contacts, laws=[pn.UserLaw(law)], collision_model=shapes)
    scene.solve(scene.q0, scene.v0)
    for one, every in read:
        np.testing.assert_allclose(one, [MASS * G], rtol=1e-9)
        np.testing.assert_allclose(every, [MASS * G], rtol=1e-9)
    assert read


def test_groups_of_entries() -> None:
    groups = Groups(
        ["a 1", "a 2", "b", "c 1", "c 2", "c 3"],
        ContactOfPoint({"a": ["a 1", "a 2"], "c": ["c 1", "c 2", "c 3"]}),
    )
    assert groups.names == ["a", "b", "c"]
    assert groups.index.tolist() == [0, 0, 1, 2, 2, 2]
    assert groups.slices() == {"a": slice(0, 2), "b": slice(2, 3), "c": slice(3, 6)}
    modes = np.array([[0, 1, 2, 2, 2, 2], [2, 0, -1, 2, -1, 0]], dtype=np.int8)
    assert groups.modes(modes).tolist() == [[1, 2, 2], [0, -1, -1]]
    assert groups.modes(modes).dtype == np.int8
    assert groups.sum(np.arange(6.0)).tolist() == [1.0, 2.0, 12.0]
    assert groups.least(np.arange(6.0)).tolist() == [0.0, 2.0, 3.0]
    assert groups.any(modes[0] == 1).tolist() == [True, False, False]
    assert Groups([], NO_POINTS).sum(np.zeros((4, 0))).shape == (4, 0)


def test_a_joint_may_have_the_name_of_a_contact_point() -> None:
    model, shapes = pin.Model(), pin.GeometryModel()
    names = ["box", "box on ground 3", "other"]
    for k, name in enumerate(names):
        shape, place = coal.Box(EDGE, EDGE, EDGE), (k, 0.0, 0.5 * EDGE)
        pn.free_body(model, name, shape, mass=MASS, collision_model=shapes, place=place)
    scene = pn.Scene(model, contacts=pn.ground_contacts(model, shapes), collision_model=shapes)
    run = pn.simulate(scene, 0.01, method="moreau", dt=1e-3, record="reactions")
    assert list(run.reactions)[: len(names)] == names
    for name in names:
        assert np.abs(run.reactions[name]).max() < 1e-9
        np.testing.assert_allclose(np.linalg.norm(run.reaction(f"{name} on ground")[-1, :3]), MASS * G)
