"""The replay's frames: exact at samples, cubic between them, and a view that shows the motion."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from pin_nonideal.description.contacts import PointContact
from pin_nonideal.errors import InputError
from pin_nonideal.visualization.page.camera import pattern_spacings, view
from pin_nonideal.visualization.page.contact_surfaces import planes_of
from pin_nonideal.visualization.page.frames import MAX_FRAMES, MIN_FRAMES, POSITION_TOLERANCE, sample
from pin_nonideal.visualization.page.joint_tracks import Tracks, halfway
from pin_nonideal.visualization.page.stick_figure import link_bars
from pin_nonideal.visualization.page.visuals import Shape, Visual

from ..support.replay_runs import add_frame, four_bar, jointed, panda, run_of

# Placements are formed twice from the same configuration, once through a quaternion: a few roundings of 1 m.
ROUNDING = 1e-13
# Rates of the test runs come from differences with an error near 1e-9, times the length of a step below 1 s.
RATE_ERROR = 1e-8
NOTHING = np.zeros((0, 3))


def placements(model: pin.Model, q: object) -> np.ndarray:
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    return np.array([placement.homogeneous for placement in data.oMi])


def matrices(pose: np.ndarray) -> np.ndarray:
    return np.array([pin.XYZQUATToSE3(row).homogeneous for row in pose])


def test_frames_cover_the_run_with_both_ends() -> None:
    run = four_bar(count=5, duration=0.99)
    times = sample(run, fps=10.0).times
    np.testing.assert_allclose(times, [*np.arange(10) / 10.0, 0.99], atol=1e-12)


def test_frames_at_samples_are_the_runs_placements() -> None:
    run = panda(count=31, duration=0.5)
    motion = sample(run, fps=60.0)
    assert len(motion.times) == 31
    for frame in (0, 7, 30):
        expected = placements(run.scene.model, run.q[frame])
        np.testing.assert_allclose(matrices(motion.poses[frame]), expected, atol=ROUNDING)


def test_frames_between_samples_follow_a_cubic_motion_exactly() -> None:
    run = run_of(jointed(pin.JointModelPX()), [0.0, 0.4, 1.0], lambda t: np.array([t**3 - 2.0 * t**2 + t]))
    motion = sample(run, fps=37.0)
    t = motion.times
    np.testing.assert_allclose(motion.poses[:, 1, 0], t**3 - 2.0 * t**2 + t, atol=RATE_ERROR)


@pytest.mark.parametrize(
    ("joint", "q"),
    [
        (pin.JointModelRUBZ(), lambda t: np.array([np.cos(9.0 * t), np.sin(9.0 * t)])),
        (pin.JointModelRZ(), lambda t: np.array([9.0 * t])),
    ],
    ids=["continuous", "revolute"],
)
def test_a_joint_that_turns_more_than_once_in_a_step_keeps_turning(joint: object, q: object) -> None:
    run = run_of(jointed(joint), [0.0, 1.0], q)  # 9 rad in one step
    motion = sample(run, fps=20.0)
    turns = motion.rotation(1)
    angle = np.unwrap(np.arctan2(turns[:, 1, 0], turns[:, 0, 0]))
    np.testing.assert_allclose(angle, 9.0 * motion.times, atol=RATE_ERROR)


def test_a_free_body_between_samples_is_close_to_fourth_order() -> None:
    model = jointed(pin.JointModelFreeFlyer())

    def tumbling(t: float) -> np.ndarray:
        place = np.array([np.sin(t), t * t, 0.0])
        turn = pin.exp3(np.array([0.0, 0.0, np.sin(2.0 * t)])) @ pin.exp3(np.array([np.cos(t), 0.0, 0.0]))
        return pin.SE3ToXYZQUAT(pin.SE3(turn, place))

    def error(count: int) -> float:
        motion = sample(run_of(model, np.linspace(0.0, 1.0, count), tumbling), fps=100.0)
        exact = np.array([placements(model, tumbling(t))[1] for t in motion.times])
        found = np.array([matrices(pose)[1] for pose in motion.poses])
        return float(np.abs(found - exact).max())

    # Halving the steps divides the error by 16 in the limit; a linear blend would only divide it by 4.
    assert error(21) < error(11) / 12.0


def test_quaternions_of_neighbors_lie_on_one_side() -> None:
    run = run_of(jointed(pin.JointModelRZ()), np.linspace(0.0, 1.0, 50), lambda t: np.array([12.0 * t]))
    quaternions = sample(run, fps=60.0).poses[:, 1, 3:]
    assert np.sum(quaternions[1:] * quaternions[:-1], axis=1).min() > 0.9


def test_values_jump_at_an_event_that_has_two_samples() -> None:
    run = run_of(jointed(pin.JointModelPX()), [0.0, 0.5, 0.5, 1.0], lambda t: np.array([t]))
    values = np.array([0.0, 1.0, 5.0, 6.0])
    motion = sample(run, fps=4.0)
    np.testing.assert_allclose(motion.of(values), [0.0, 0.5, 5.0, 5.5, 6.0])


def test_one_sample_is_one_frame() -> None:
    motion = sample(run_of(jointed(pin.JointModelPX()), [2.0], lambda t: np.array([t])), fps=60.0)
    assert motion.times.tolist() == [2.0]
    assert motion.poses[0, 1, 0] == 2.0


def test_a_run_that_cannot_be_sampled_is_refused() -> None:
    run = four_bar()
    message = r"fps \* duration must be at most 200000 frames; got 300000 \* 1 s: lower fps"
    with pytest.raises(InputError, match=message):
        sample(run, fps=1.5 * MAX_FRAMES)
    run.q[3, 1] = np.nan
    with pytest.raises(InputError, match="a replay needs finite q and v; this run holds NaN or infinity"):
        sample(run, fps=60.0)
    run.t = run.t[:0]
    with pytest.raises(InputError, match="a replay needs a run with at least one sample; this one has none"):
        sample(run, fps=60.0)


def seen(run: object) -> object:
    model = run.scene.model
    planes = planes_of(run.scene._compiled)
    return view(model, sample(run, 30.0), link_bars(model, [], 1.0), [], NOTHING, planes)


def test_a_planar_mechanism_is_seen_across_its_plane() -> None:
    found = seen(four_bar())
    assert abs(found.direction[1]) > 0.9  # the mechanism moves in the x-z plane
    np.testing.assert_allclose(found.up, [0.0, 0.0, 1.0])
    right = np.cross(found.up, found.direction)
    assert right[0] > 0.9  # x points to the right on the screen
    assert not found.follow


def test_a_horizontal_mechanism_is_seen_from_above() -> None:
    model = jointed(pin.JointModelRZ(), pin.JointModelRZ())
    found = seen(run_of(model, np.linspace(0.0, 1.0, 9), lambda t: np.array([6.0 * t, 2.0 * t])))
    assert found.direction[2] > 0.7


def test_up_is_against_gravity() -> None:
    run = four_bar()
    run.scene.model.gravity.linear = np.array([0.0, -9.81, 0.0])
    np.testing.assert_allclose(seen(run).up, [0.0, 1.0, 0.0])
    run.scene.model.gravity.linear = np.zeros(3)
    np.testing.assert_allclose(seen(run).up, [0.0, 0.0, 1.0])


def test_the_camera_follows_what_travels_far() -> None:
    model = jointed(pin.JointModelPX(), pin.JointModelRY())
    assert seen(run_of(model, np.linspace(0.0, 1.0, 9), lambda t: np.array([30.0 * t, t]))).follow
    assert not seen(run_of(model, np.linspace(0.0, 1.0, 9), lambda t: np.array([0.1 * t, t]))).follow


def test_a_cart_is_followed_however_far_it_goes() -> None:
    """A body is as large as it is drawn, not as its path."""
    run = run_of(
        jointed(pin.JointModelPX(), lever=0.0), np.linspace(0.0, 50.0, 9), lambda t: np.array([20.0 * t])
    )
    box = Visual("box", 1, pin.SE3.Identity(), Shape("box", (0.5, 0.3, 0.2)), (1.0,) * 4)
    found = view(run.scene.model, sample(run, 30.0), [box], [], NOTHING, [])
    assert found.follow
    assert found.size == pytest.approx(np.linalg.norm([0.5, 0.3, 0.2]))
    assert np.abs(found.outline).max() < 1.0


def test_what_stands_still_leaves_half_of_the_view_to_what_moves() -> None:
    run = four_bar()
    motion, drawn = sample(run, 30.0), link_bars(run.scene.model, [], 1.0)
    alone = view(run.scene.model, motion, drawn, [], NOTHING, []).outline
    tile, white = Shape("box", (0.5, 0.5, 0.01)), (1.0,) * 4
    places = [pin.SE3(np.eye(3), np.array([0.5 * k, 0.0, 0.0])) for k in range(20)]
    plates = [Visual("plate", 0, place, tile, white) for place in places]
    beside = view(run.scene.model, motion, [*drawn, *plates], [], NOTHING, []).outline
    assert np.ptp(beside[:, 0]) <= 2.0 * np.linalg.norm(np.ptp(alone, axis=0))


def test_a_large_floor_does_not_push_the_robot_away() -> None:
    run = four_bar()
    motion, drawn = sample(run, 30.0), link_bars(run.scene.model, [], 1.0)
    here = pin.SE3.Identity()
    floor = Visual("floor", 0, here, Shape("box", (50.0, 50.0, 0.01)), (1.0, 1.0, 1.0, 1.0))
    stand = Visual("stand", 0, here, Shape("box", (0.2, 0.2, 1.6)), (1.0, 1.0, 1.0, 1.0))
    alone, on_floor, on_stand = (
        view(run.scene.model, motion, [*drawn, *more], [], NOTHING, []) for more in ([], [floor], [stand])
    )
    assert on_floor.size == alone.size
    assert on_stand.outline[:, 2].min() == pytest.approx(-0.8)


def test_every_drawn_point_lies_within_the_outermost_ones() -> None:
    run = four_bar()
    found, motion = seen(run), sample(run, 30.0)
    points = motion.poses[:, 1:, :3].reshape(-1, 3)
    for direction in np.eye(3):
        assert (found.outline @ direction).max() >= (points @ direction).max()
        assert (found.outline @ direction).min() <= (points @ direction).min()


def crank(turns: float, count: int, joint: object = None) -> object:
    """A link that turns evenly, and one that swings on it as fast."""
    model = jointed(joint or pin.JointModelRZ(), pin.JointModelRZ())
    w = 2.0 * np.pi * turns
    return run_of(model, np.linspace(0.0, 1.0, count), lambda t: np.array([w * t, 0.8 * np.sin(w * t)]))


def test_frames_are_close_where_the_motion_is_fast_and_never_few() -> None:
    slow = sample(run_of(jointed(pin.JointModelRZ()), [0.0, 0.03], lambda t: np.array([t])))
    assert MIN_FRAMES <= len(slow.times) <= 2 * MIN_FRAMES + 1
    fast = sample(crank(40.0, 2001))
    swing = np.abs(np.diff(fast.coordinates[:, 1]))
    assert swing.max() < 0.5
    assert not fast.held.any()


@pytest.mark.parametrize("turns", [0.5, 7.0, 40.0])
def test_what_the_page_blends_is_the_motion(turns: float) -> None:
    """Halfway between frames, where the blend is worst, against the closed form."""
    motion = sample(crank(turns, int(60 * turns)))
    between = (motion.times[1:] + motion.times[:-1]) / 2.0
    w = 2.0 * np.pi * turns
    swing = halfway(motion.times, motion.coordinates)[:, 1]
    np.testing.assert_allclose(swing, 0.8 * np.sin(w * between), atol=2.0 * POSITION_TOLERANCE)


def test_samples_too_far_apart_are_shown_one_by_one() -> None:
    motion = sample(crank(40.0, 55))
    assert motion.held.all()
    np.testing.assert_array_equal(motion.times, np.linspace(0.0, 1.0, 55))


def test_a_blend_does_not_reach_across_an_impact() -> None:
    """Two frames at one time: the slopes on either side are those of that side."""
    t = np.array([0.0, 0.5, 1.0, 1.0, 1.5, 2.0])
    x = np.array([0.0, 0.25, 1.0, 1.0, 0.5, 0.0])[:, None]  # t^2, then a line down
    np.testing.assert_allclose(halfway(t, x)[[0, 1, 3, 4], 0], [0.0625, 0.5625, 0.75, 0.25], atol=ROUNDING)


def test_tracks_place_joints_as_pinocchio_does() -> None:
    kinds = [
        pin.JointModelFreeFlyer(), pin.JointModelRX(), pin.JointModelPY(), pin.JointModelRUBZ(),
        pin.JointModelRevoluteUnaligned(1.0, 2.0, 3.0), pin.JointModelPrismaticUnaligned(0.0, 1.0, 1.0),
        pin.JointModelSpherical(), pin.JointModelSphericalZYX(), pin.JointModelTranslation(),
        pin.JointModelPlanar(), pin.JointModelHX(0.3),
    ]  # fmt: skip
    model = jointed(*kinds)
    tracks = Tracks(model)
    rng = np.random.default_rng(4)
    q = np.array([pin.integrate(model, pin.neutral(model), rng.normal(size=model.nv)) for _ in range(5)])
    found = tracks.placements(tracks.coordinates(q))
    for row, pose in zip(q, found, strict=True):
        np.testing.assert_allclose(matrices(pose), placements(model, row), atol=1e-12)


def test_a_belt_does_not_take_the_camera_away() -> None:
    model = jointed(pin.JointModelPX(), pin.JointModelPX(), pin.JointModelRZ())
    model.inertias[1] = pin.Inertia.Zero()
    run = run_of(model, np.linspace(0.0, 1.0, 40), lambda t: np.array([500.0 * t, -500.0 * t, 2.0 * t]))
    found = seen(run)
    assert not found.follow
    assert found.stays == [True, False, True, True]
    assert np.abs(found.outline).max() < 2.0


def test_the_ground_is_where_something_touches() -> None:
    model = jointed(pin.JointModelPZ())
    add_frame(model, "foot", 1, [0.0, 0.0, -0.3])
    t = np.linspace(0.0, 1.0, 5)
    assert seen(run_of(model, t, lambda x: np.array([x + 0.6]))).ground == 0.0
    assert seen(run_of(model, t, lambda x: np.array([x - 3.0]))).ground is None
    touching = run_of(model, t, lambda x: np.array([x - 3.0]), contacts=[PointContact("foot", name="c")])
    assert seen(touching).ground == 0.0


def test_a_belt_with_ribs_is_drawn_within_one_rib() -> None:
    model = jointed(pin.JointModelPX())
    motion = sample(run_of(model, np.linspace(0.0, 1.0, 5), lambda t: np.array([90.0 * t])), 30.0)

    def ribs(gap: float, count: int) -> list:
        rib = Shape("box", (0.02, 0.2, 0.01))
        places = [pin.SE3(np.eye(3), np.array([gap * k, 0.0, 0.0])) for k in range(count)]
        return [Visual(f"rib {k}", 1, place, rib, (1.0,) * 4) for k, place in enumerate(places)]

    axes = {1: np.array([1.0, 0.0, 0.0])}
    assert pattern_spacings(motion, ribs(0.1, 8), axes) == pytest.approx(dict.fromkeys(range(8), 0.1))
    assert pattern_spacings(motion, ribs(30.0, 8), axes) == {}  # it does not travel farther than it reaches
    assert pattern_spacings(motion, ribs(0.1, 3), axes) == {}
