"""All kinds of contacts in simulation, replay, plots, files and checkpoints.

A body of 1 kg on three slides falls by 1 cm on a fixed shape, bounces, slides and rests.  Gap, contact point,
normal and final weight have closed forms.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pinocchio as pin
import pytest

import pin_nonideal as pn
from pin_nonideal.description import contacts
from pin_nonideal.visualization.page.contact_points import contact_point_marks, contact_points
from pin_nonideal.visualization.page.force_arrows import arrows_of
from pin_nonideal.visualization.page.frames import sample
from pin_nonideal.visualization.page.friction_glyphs import elements_of
from pin_nonideal.visualization.page.markers import marks_of
from pin_nonideal.visualization.page.mode_timeline import gaps_of
from pin_nonideal.visualization.page.signals import plots_of

from ...support.replay_browser import Watched, headless_browser
from ...support.replay_runs import add_frame
from ...support.same_run import assert_same_run

KINDS = get_args(contacts.Contact)
G, DROP, SIDEWAYS = 9.81, 0.01, 0.05
ALL = ("forces", "energy", "laws", "reactions", "tau", "a")
ROUNDING = 1e-9  # positions and gaps of about 0.3 m, and forces of about 10 N at rest
# Kinds with a fixed contact point, with a point while they touch, and without one: their pages are opened by
# default, all pages with -m slow.
SHOWN = (contacts.PointContact, contacts.SphereContact, contacts.JointLimit)
PAGES = [kind if kind in SHOWN else pytest.param(kind, marks=pytest.mark.slow) for kind in KINDS]
CUBE = [(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-0.2, 0.2)]
RUBS: dict[str, Any] = {"mu": 0.5, "restitution": 0.3}


@dataclass(frozen=True)
class Case:
    """Contact of "body", which slides along x, y and z, with "base" at the world's origin.

    Attributes:
        contact: description of the contact.
        gap: function q -> gap.
        place: function q -> contact point; None for a contact without a contact point.
        normal: function q -> direction of the force on the body.
        rows: number of rows of `lam`; the first carries the weight.
    """

    contact: Any
    gap: Callable[[Any], float]
    place: Callable[[Any], Any] | None = None
    normal: Callable[[Any], Any] = lambda q: np.array([0.0, 0.0, 1.0])

    @property
    def row(self) -> str:
        """Return the name of the contact's row."""
        return "it lower" if isinstance(self.contact, pn.JointLimit) else "it"


def below(radius: float) -> Callable[[Any], Any]:
    """Return a function of the lowest point of a body with this radius."""
    return lambda q: q - [0.0, 0.0, radius]


def radial(q: Any) -> Any:
    return q / np.linalg.norm(q)


FLAT = {
    contacts.PointContact: Case(
        pn.PointContact("body", radius=0.1, height=0.2, name="it", **RUBS), lambda q: q[2] - 0.3, below(0.1)
    ),
    contacts.SphereContact: Case(
        pn.SphereContact("body", "base", 0.1, 0.2, name="it", **RUBS),
        lambda q: float(np.linalg.norm(q)) - 0.3,
        lambda q: q - 0.1 * radial(q),
        radial,
    ),
    contacts.CapsuleContact: Case(
        pn.CapsuleContact(
            "body",
            "base",
            ((0.0, -0.2, 0.0), (0.0, 0.2, 0.0)),
            ((-0.5, 0.0, 0.0), (0.5, 0.0, 0.0)),
            0.1,
            0.2,
            name="it",
            **RUBS,
        ),
        lambda q: q[2] - 0.3,
        lambda q: np.array([q[0], 0.0, q[2] - 0.1]),
    ),
    contacts.BoxContact: Case(
        pn.BoxContact("body", "base", (2.0, 2.0, 0.4), 0.1, name="it", **RUBS),
        lambda q: q[2] - 0.3,
        below(0.1),
    ),
    contacts.EllipsoidContact: Case(
        pn.EllipsoidContact("body", (0.4, 0.2, 0.1), height=0.2, name="it", **RUBS),
        lambda q: q[2] - 0.3,
        below(0.1),
    ),
    contacts.HullContact: Case(
        pn.HullContact("body", "base", CUBE, 0.1, name="it", **RUBS), lambda q: q[2] - 0.3, below(0.1)
    ),
    contacts.CylinderContact: Case(
        pn.CylinderContact("body", "base", length=0.4, below=1.0, radius1=0.1, name="it", **RUBS),
        lambda q: q[2] - 0.3,
        below(0.1),
    ),
    contacts.RimContact: Case(
        pn.RimContact("body", "base", CUBE, 0.09, 0.01, rpy=(np.pi / 2.0, 0.0, 0.0), name="it", **RUBS),
        lambda q: q[2] - 0.3,
        below(0.09),
    ),
    contacts.RevolvedContact: Case(  # the tip of a cone on the face of a cylinder
        pn.RevolvedContact("body", "base", (0.18, 0.0, 0.1), (0.4, 1.0, 1.0), 0.01, name="it", **RUBS),
        lambda q: q[2] - 0.3,
        below(0.1),
    ),
    contacts.JointLimit: Case(
        pn.JointLimit("z", lower=0.3, restitution=0.3, name="it"),
        lambda q: q[2] - 0.3,
    ),
    contacts.UserContact: Case(
        pn.UserContact(
            lambda t, q, v, data: (np.array([[0.0, 0.0, 1.0]]), np.zeros(1)),
            gap=lambda t, q: q[2] - 0.3,
            directions=lambda t, q: np.eye(3)[:2],
            name="it",
            **RUBS,
        ),
        lambda q: q[2] - 0.3,
    ),
}


def made(case: Case) -> pn.Scene:
    """Return the scene with the body 1 cm above the fixed shape."""
    model, last = pin.Model(), 0
    model.name = "falling"
    for joint, name in ((pin.JointModelPX(), "x"), (pin.JointModelPY(), "y"), (pin.JointModelPZ(), "z")):
        last = model.addJoint(last, joint, pin.SE3.Identity(), name)
    model.appendBodyToJoint(last, pin.Inertia(1.0, np.zeros(3), 0.01 * np.eye(3)), pin.SE3.Identity())
    add_frame(model, "body", last, np.zeros(3))
    add_frame(model, "base", 0, np.zeros(3))
    return pn.Scene(
        model, contacts=[case.contact], q0=[0.0, 0.0, 0.3 + DROP], v0=[SIDEWAYS, 0.0, 0.0], name="falling"
    )


@pytest.fixture(scope="module", params=KINDS, ids=lambda kind: kind.__name__)
def case(request: Any) -> Case:
    """Return the case of a kind; a new kind needs an entry in the table."""
    return FLAT[request.param]


@pytest.fixture(scope="module")
def run(case: Case) -> Any:
    return pn.simulate(made(case), 0.6, record=ALL, output_dt=0.01)


def test_it_strikes_where_the_fall_ends_and_carries_the_weight_at_rest(case: Case, run: Any) -> None:
    strike = next(event for event in run.events if event.kind == "impact")
    assert strike.element == case.row
    # A gap of 1 cm over a round shape grows by 1e-6 m, since the body moves 0.5 mm sideways.
    assert strike.time == pytest.approx(np.sqrt(2.0 * DROP / G), abs=1e-4)
    assert strike.impulse[0] == pytest.approx(1.3 * np.sqrt(2.0 * DROP * G), rel=1e-3)
    rows = run.scene.constraint_slices[case.row]
    assert run.lam[-1, rows.start] == pytest.approx(G * case.normal(run.q[-1])[2], rel=1e-6)
    assert run.closed[-1].all()


def test_forces_of_contacts_are_those_on_the_body(case: Case, run: Any) -> None:
    """Newton's second law holds at each sample; stops and user gaps have no force at a point."""
    if case.place is None:
        assert "it" not in run.contact_forces
        return
    force = run.contact_forces["it"]
    np.testing.assert_allclose(force, run.a + np.array([0.0, 0.0, G]), atol=ROUNDING * G)
    open_ones = ~run.closed[:, 0]
    assert open_ones.any()
    assert not force[open_ones].any()


def test_gaps_and_normal_forces_are_plotted(case: Case, run: Any, tmp_path: Path) -> None:
    times, gaps = gaps_of(run)
    np.testing.assert_array_equal(times, run.t)
    np.testing.assert_allclose(gaps[case.row], [case.gap(q) for q in run.q], atol=ROUNDING)
    (plot,) = plots_of(run, ["contacts"])
    np.testing.assert_array_equal(
        plot.curves[case.row], run.lam[:, run.scene.constraint_slices[case.row].start]
    )
    path = tmp_path / "plots.png" if type(case.contact) in SHOWN else None
    figure = pn.plot(run, path, what=["gaps", "contacts", "modes"])
    assert len(figure.axes) == 3
    assert path is None or path.stat().st_size > 10_000


def test_files_keep_it(run: Any, tmp_path: Path) -> None:
    run.save(tmp_path / "run.npz")
    assert_same_run(run, pn.Trajectory.load(tmp_path / "run.npz"))


def test_checkpoints_go_on_with_it_bit_by_bit(case: Case, run: Any, kept: Any, tmp_path: Path) -> None:
    path, scene = tmp_path / "run", made(case)
    pn.simulate(scene, 0.6, record=ALL, output_dt=0.01, checkpoint=path, checkpoint_interval=0.0)
    every = list(kept)
    assert len(every) > 10
    for state in every[:: len(every) // 6]:
        path.write_bytes(state)
        assert_same_run(run, pn.resume(path, scene, checkpoint_interval=1e9))


def test_arrows_act_where_it_touches(case: Case, run: Any) -> None:
    motion = sample(run)
    arrows = [
        arrow for arrow in arrows_of(run, motion, contact_points(run, motion)) if arrow.name.startswith("it")
    ]
    assert arrows
    if case.place is None:  # generalized force
        (arrow,) = [found for found in arrows if found.joint == run.scene.model.getJointId("z")]
        rows = run.scene.constraint_slices[case.row]
        np.testing.assert_allclose(arrow.values[:, 2], motion.of(run.lam[:, rows.start]), atol=ROUNDING * G)
        return
    (arrow,) = arrows
    np.testing.assert_allclose(arrow.values, motion.of(run.contact_forces["it"]), atol=ROUNDING * G)
    np.testing.assert_allclose(arrow.origin, [case.place(q) for q in motion.q], atol=ROUNDING)


def test_marks_and_modes_are_where_it_touches(case: Case, run: Any) -> None:
    if case.place is None:
        return
    motion, scene_marks = sample(run), marks_of(run.scene._compiled)
    touches = contact_points(run, motion)
    (mark,) = [*scene_marks, *contact_point_marks(touches, motion, scene_marks)]
    (element,) = elements_of(run, motion, scene_marks, touches)
    body = run.scene.model.getJointId("z")
    assert (mark.name, mark.kind, mark.joint1, element.joint) == ("it", "contact", body, body)
    places = np.array([case.place(q) for q in motion.q])
    np.testing.assert_allclose(motion.local(body, places), element.point, atol=ROUNDING)
    np.testing.assert_allclose(element.axis, [case.normal(q) for q in motion.q], atol=ROUNDING)
    if mark.path is None:  # a sphere's center is fixed to its body
        np.testing.assert_allclose(mark.point1, np.zeros(3), atol=ROUNDING)
    else:
        np.testing.assert_allclose(mark.path, motion.local(body, places), atol=ROUNDING)
    slides = np.abs(motion.of(run.v)[:, 0]) > 1e-3
    loaded = (element.normal > 1e-3) & (motion.part == 0.0)
    np.testing.assert_allclose(element.share[slides & loaded], 1.0, atol=1e-6)
    normal = case.normal(run.q[-1])  # the slope at rest uses tan(a) of mu
    assert element.share[-1] == pytest.approx(np.hypot(*normal[:2]) / normal[2] / RUBS["mu"], abs=1e-6)
    assert element.normal[-1] == pytest.approx(G * normal[2], rel=1e-6)


def test_kept_contacts_and_stops_without_names_are_told_apart() -> None:
    """Bilateral contacts precede unilateral contacts in the core; a stop has one row per end."""
    scene = made(FLAT[contacts.BoxContact])
    groups = [
        [
            FLAT[contacts.BoxContact].contact,
            pn.PointContact("body", unilateral=False, height=0.31, name="kept"),
        ],
        [pn.JointLimit("z", 0.2, 0.5), pn.JointLimit("x", -1.0, 1.0), FLAT[contacts.BoxContact].contact],
        [pn.JointLimit("z", 0.2, 0.5), pn.JointLimit("z", 0.1, 0.6), FLAT[contacts.PointContact].contact],
    ]
    for group in groups:
        both = pn.Scene(scene.model, contacts=group, q0=[0.0, 0.0, 0.31], v0=scene.v0)
        run = pn.simulate(both, 0.3, record="forces")
        motion = sample(run)
        arrows = {
            arrow.name: arrow.values[-1, 2] for arrow in arrows_of(run, motion, contact_points(run, motion))
        }
        carries = "kept" if group is groups[0] else "it"
        assert list(arrows) == [carries]
        assert arrows[carries] == pytest.approx(G, rel=1e-6)
        assert len(pn.replay(run).text) > 100_000


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with headless_browser() as found:
        yield found


@pytest.mark.parametrize("case", PAGES, indirect=True, ids=lambda kind: kind.__name__)
def test_pages_show_it(case: Case, run: Any, browser: Any, tmp_path: Path) -> None:
    """The page draws the force arrow, the ring in the color of its mode, and a flash at impact."""
    page = Watched(browser, pn.replay(run, tmp_path / "run.html"))
    page.run("() => replay.seek(0.59)")
    (value,) = [arrow["value"] for arrow in page.run("() => replay.forces") if arrow["name"].startswith("it")]
    assert value == pytest.approx(G, rel=1e-4)
    if case.place is not None:
        end = run.q[-1] if isinstance(case.contact, pn.PointContact) else case.place(run.q[-1])
        mark = page.run("() => replay.poses().marks.it[0]")
        np.testing.assert_allclose(mark, end, atol=1e-6)  # positions are 32-bit numbers
        strike = next(event.time for event in run.events if event.kind == "impact")
        page.run("time => replay.seek(time)", strike - 1e-3)
        assert page.run("() => replay.flashes") == 0
        page.run("time => replay.seek(time)", strike + 1e-3)
        assert page.run("() => replay.flashes") == 1
    assert page.complaints == []
    page.close()
