from collections.abc import Callable, Sequence
import enum
from typing import Annotated, overload

import numpy
from numpy.typing import NDArray

import pin_nonideal.simulation.options


pinocchio_version: str

state_layout: str

class Solutions(enum.Enum):
    """Proven number of motions under friction at a paradox."""

    unproven = 0

    none = 1

    several = 2

class FailureKind(enum.Enum):
    """Cause of the failure of an evaluation or a run."""

    singular_mass = 0
    """elements: the degree of freedom"""

    inconsistent = 1
    """elements: blocks of rows; value: residual"""

    not_finite = 2

    impact_energy = 11
    """elements: blocks of the contacts; value: energy gained"""

    paradox = 3
    """elements: friction elements; value: determinant"""

    not_converged = 4
    """elements: friction elements whose modes were not found"""

    closure = 5
    """elements: the block of rows; value: gap"""

    step_size = 6
    """value: number of steps so far of a run without progress"""

    stiff = 7
    """elements: the degree of freedom; value: rate"""

    growing = 12
    """
    elements: the degree of freedom, and its cause: 0 the actuation, 1 given forces, 2 laws; value: rate
    """

    unmet_law = 13
    """
    elements: the law (0 motion, 1 Signorini, 2 limits, 3 dissipation), and its dof, block or friction element; value: residual
    """

    steps = 8
    """value: maximum number of steps, which the run has taken"""

    wall = 9
    """value: maximum wall time, which the run has taken"""

    interrupted = 10

class CoreFailure(Exception):
    kind: FailureKind
    time: float
    elements: list[int]
    value: float
    solutions: Solutions
    limits: list[NDArray[numpy.float64]]
    accelerations: list[NDArray[numpy.float64]]

class ReactionView:
    @property
    def lam(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    def of_joint(self, joint: int) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    def of_block(self, block: int) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

class Provider(enum.Enum):
    """Provider of kinematics, M and bias forces."""

    core = 0

    pinocchio = 1

class Load(enum.Enum):
    """Load on which the friction limit of a bearing depends."""

    none = 0

    revolute = 1

    prismatic = 2

    spherical = 3

    planar = 4

    multiplier = 5

    user = 6

class Mode(enum.IntEnum):
    """Mode of a friction element: slip in either direction, or stick."""

    slip_minus = -1

    sticking = 0

    slip_plus = 1

    unloaded = 2
    """no friction: the contact is open, or the caller removes the friction"""

class DisplayKind(enum.Enum):
    """Display of a constraint in a replay."""

    nothing = 0

    anchor = 1

    rod = 2

    contact = 3

    rolling = 4

    edge = 5

    drive = 6

    gear = 7

class ImpactLaw(enum.Enum):
    """Definition of restitution in an impact."""

    newton = 0
    """opening rate of a gap over its closing rate"""

    poisson = 1
    """impulse of expansion over impulse of compression"""

class Reaction(enum.Enum):
    """Motion whose reactions a law reads."""

    none = 0

    ideal = 1

    total = 2

class Builder:
    def __init__(self, model: object, terms: Provider = Provider.core) -> None: ...

    def select_rows(self, block: int, rows: Sequence[int]) -> None: ...

    def add_copy(self, row: int, first: int, factor: float) -> None: ...

    def add_breaks(self, times: Sequence[float]) -> None: ...

    def set_unilateral(self, restitution: float) -> None: ...

    def set_impact(self, law: ImpactLaw) -> None: ...

    def order_contacts(self, blocks: Sequence[int], pairs: Sequence[int]) -> None: ...

    def finish(self) -> Program: ...

    def add_friction(self, law: int, block: int, *, name: str, load: Load = Load.none, reaction: Reaction = Reaction.none, joint: int = -1, anchor: int = -1, row: int = 0, axis: Sequence[float] = [0.0, 0.0, 1.0], axis_dof: int = -1, constant: float = 0.0, mu: float = 0.0, radius: float = 0.0, axial_radius: float = 0.0, inverse_span: float = 0.0, static_ratio: float = 1.0, stribeck_velocity: float = 0.0, user_limit: Callable[[float, Annotated[NDArray[numpy.float64], dict(shape=(None,))], Annotated[NDArray[numpy.float64], dict(shape=(None,))], ReactionView], tuple[float, float]] | None = None) -> None: ...

    def add_law(self, name: str) -> int: ...

    def add_viscous(self, law: int, coefficient: float, *, dof: int = -1, count: int = 1, block: int = -1, anchor: int = -1) -> None: ...

    def add_drag(self, law: int, frame: tuple[int, Sequence[float], Sequence[float]], coefficient: float, exponent: float) -> None: ...

    def add_sigmoid(self, law: int, dof: int, phi1: float, phi2: float, phi3: float) -> None: ...

    def add_lugre(self, law: int, dof: int, stiffness: float, damping: float, viscous: float, coulomb: float, stiction: float, stribeck_velocity: float) -> None: ...

    def add_user_law(self, law: int, states: int, reaction: Reaction, function: Callable[..., object]) -> None: ...

    def add_spring_damper(self, frame1: tuple[int, Sequence[float], Sequence[float]], frame2: tuple[int, Sequence[float], Sequence[float]], stiffness: float, damping: float, rest_length: float) -> None: ...

    def add_joint_spring(self, joint: int, stiffness: float, rest: float, damping: float) -> None: ...

    @overload
    def add_wrench(self, frame: tuple[int, Sequence[float], Sequence[float]], value: Sequence[float]) -> None: ...

    @overload
    def add_wrench(self, frame: tuple[int, Sequence[float], Sequence[float]], function: Callable[[float], Annotated[NDArray[numpy.float64], dict(shape=(None,))]]) -> None: ...

    def add_user_force(self, function: Callable[[float, Annotated[NDArray[numpy.float64], dict(shape=(None,))], Annotated[NDArray[numpy.float64], dict(shape=(None,))]], Annotated[NDArray[numpy.float64], dict(shape=(None,))]]) -> None: ...

    def set_constant_torque(self, tau: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> None: ...

    def set_torque_function(self, function: Callable[[float, Annotated[NDArray[numpy.float64], dict(shape=(None,))], Annotated[NDArray[numpy.float64], dict(shape=(None,))]], Annotated[NDArray[numpy.float64], dict(shape=(None,))]]) -> None: ...

    def set_sampled_torque(self, function: Callable[[float, Annotated[NDArray[numpy.float64], dict(shape=(None,))], Annotated[NDArray[numpy.float64], dict(shape=(None,))]], Annotated[NDArray[numpy.float64], dict(shape=(None,))]], period: float) -> None: ...

    def set_hold_position(self, kp: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], kd: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], q: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> None: ...

    def set_torque_table(self, times: Sequence[float], values: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> None: ...

    def add_torque_table(self, times: Sequence[float], values: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> None: ...

    def limit_effort(self, min_effort: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], max_effort: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> None: ...

    @property
    def block_names(self) -> list[str]: ...

    @property
    def first_rows(self) -> list[int]: ...

    @property
    def rows(self) -> int: ...

    def add_point(self, name: str, frame1: tuple[int, Sequence[float], Sequence[float]], frame2: tuple[int, Sequence[float], Sequence[float]], axes: Sequence[int]) -> int: ...

    def add_plane_point(self, name: str, frame: tuple[int, Sequence[float], Sequence[float]], plane: tuple[int, Sequence[float], Sequence[float]], normal: Sequence[float], radius: float) -> int: ...

    def add_capsule_capsule(self, name: str, frame1: tuple[int, Sequence[float], Sequence[float]], frame2: tuple[int, Sequence[float], Sequence[float]], half1: float, half2: float, radius: float) -> int: ...

    def add_box(self, name: str, frame1: tuple[int, Sequence[float], Sequence[float]], frame2: tuple[int, Sequence[float], Sequence[float]], solid: Sequence[float], radius: float) -> int: ...

    def add_frame(self, name: str, frame1: tuple[int, Sequence[float], Sequence[float]], frame2: tuple[int, Sequence[float], Sequence[float]]) -> int: ...

    def add_hinge(self, name: str, frame1: tuple[int, Sequence[float], Sequence[float]], frame2: tuple[int, Sequence[float], Sequence[float]], axis: Sequence[float], normal1: Sequence[float], normal2: Sequence[float]) -> int: ...

    def add_distance(self, name: str, frame1: tuple[int, Sequence[float], Sequence[float]], frame2: tuple[int, Sequence[float], Sequence[float]], length: object) -> int: ...

    def add_knife_edge(self, name: str, frame: tuple[int, Sequence[float], Sequence[float]], axis: Sequence[float]) -> int: ...

    def add_rolling(self, name: str, frame: tuple[int, Sequence[float], Sequence[float]], plane: tuple[int, Sequence[float], Sequence[float]], radius: float, sphere: bool, axis: Sequence[float], tangent1: Sequence[float], tangent2: Sequence[float], normal: Sequence[float]) -> int: ...

    def add_coupling(self, name: str, joint1: int, joint2: int, ratio: float, offset: float, period: float, position: bool) -> int: ...

    def add_motion(self, name: str, joint: int, function: object, period: float) -> int: ...

    def add_limit(self, name: str, joint: int, bound: float, sign: float) -> int: ...

    def add_user(self, name: str, size: int, rows: Callable[[float, Annotated[NDArray[numpy.float64], dict(shape=(None,))], Annotated[NDArray[numpy.float64], dict(shape=(None,))]], tuple[Annotated[NDArray[numpy.float64], dict(shape=(None, None))], Annotated[NDArray[numpy.float64], dict(shape=(None,))]]] | None, residual: Callable[[float, Annotated[NDArray[numpy.float64], dict(shape=(None,))]], Annotated[NDArray[numpy.float64], dict(shape=(None,))]] | None, rate: Callable[[float, Annotated[NDArray[numpy.float64], dict(shape=(None,))], Annotated[NDArray[numpy.float64], dict(shape=(None,))]], Annotated[NDArray[numpy.float64], dict(shape=(None,))]] | None) -> int: ...

    def add_user_gap(self, name: str, rows: Callable[[float, Annotated[NDArray[numpy.float64], dict(shape=(None,))], Annotated[NDArray[numpy.float64], dict(shape=(None,))]], tuple[Annotated[NDArray[numpy.float64], dict(shape=(None, None))], Annotated[NDArray[numpy.float64], dict(shape=(None,))]]] | None, gap: Callable[[float, Annotated[NDArray[numpy.float64], dict(shape=(None,))]], Annotated[NDArray[numpy.float64], dict(shape=(None,))]] | None, rate: Callable[[float, Annotated[NDArray[numpy.float64], dict(shape=(None,))], Annotated[NDArray[numpy.float64], dict(shape=(None,))]], Annotated[NDArray[numpy.float64], dict(shape=(None,))]] | None) -> int: ...

    def add_dof_slip(self, name: str, dof: int, count: int) -> int: ...

    def add_hinge_slip(self, name: str, frame1: tuple[int, Sequence[float], Sequence[float]], frame2: tuple[int, Sequence[float], Sequence[float]], axis: Sequence[float]) -> int: ...

    def add_spin_slip(self, name: str, frame1: tuple[int, Sequence[float], Sequence[float]], frame2: tuple[int, Sequence[float], Sequence[float]], axes: Sequence[int]) -> int: ...

    def add_plane_point_slip(self, name: str, frame: tuple[int, Sequence[float], Sequence[float]], plane: tuple[int, Sequence[float], Sequence[float]], radius: float, tangent1: Sequence[float], tangent2: Sequence[float], normal: Sequence[float]) -> int: ...

    def add_capsule_capsule_slip(self, name: str, frame1: tuple[int, Sequence[float], Sequence[float]], frame2: tuple[int, Sequence[float], Sequence[float]], half1: float, half2: float, radius1: float) -> int: ...

    def add_box_slip(self, name: str, frame1: tuple[int, Sequence[float], Sequence[float]], frame2: tuple[int, Sequence[float], Sequence[float]], solid: Sequence[float], radius1: float) -> int: ...

    def add_coupling_slip(self, name: str, joint1: int, joint2: int, weight1: float, weight2: float) -> int: ...

    def add_user_slip(self, name: str, size: int, directions: Callable[[float, Annotated[NDArray[numpy.float64], dict(shape=(None,))]], Annotated[NDArray[numpy.float64], dict(shape=(None,))]] | None) -> int: ...

    def add_plane_ellipsoid(self, name: str, frame: tuple[int, Sequence[float], Sequence[float]], plane: tuple[int, Sequence[float], Sequence[float]], normal: Sequence[float], semiaxes: Sequence[float]) -> int: ...

    def add_plane_ellipsoid_slip(self, name: str, frame: tuple[int, Sequence[float], Sequence[float]], plane: tuple[int, Sequence[float], Sequence[float]], semiaxes: Sequence[float], tangent1: Sequence[float], tangent2: Sequence[float], normal: Sequence[float]) -> int: ...

    def add_hull(self, name: str, frame1: tuple[int, Sequence[float], Sequence[float]], frame2: tuple[int, Sequence[float], Sequence[float]], solid: tuple[Sequence[float], Sequence[float], Sequence[int]], radius: float) -> int: ...

    def add_hull_slip(self, name: str, frame1: tuple[int, Sequence[float], Sequence[float]], frame2: tuple[int, Sequence[float], Sequence[float]], solid: tuple[Sequence[float], Sequence[float], Sequence[int]], radius1: float) -> int: ...

    def add_revolved(self, name: str, frame1: tuple[int, Sequence[float], Sequence[float]], frame2: tuple[int, Sequence[float], Sequence[float]], solid: tuple[float, float, float], radius: float) -> int: ...

    def add_revolved_slip(self, name: str, frame1: tuple[int, Sequence[float], Sequence[float]], frame2: tuple[int, Sequence[float], Sequence[float]], solid: tuple[float, float, float], radius1: float) -> int: ...

    def add_capsule_cylinder(self, name: str, frame1: tuple[int, Sequence[float], Sequence[float]], frame2: tuple[int, Sequence[float], Sequence[float]], solid: tuple[float, float, float], half1: float, radius: float) -> int: ...

    def add_capsule_cylinder_slip(self, name: str, frame1: tuple[int, Sequence[float], Sequence[float]], frame2: tuple[int, Sequence[float], Sequence[float]], solid: tuple[float, float, float], half1: float, radius1: float) -> int: ...

    def add_disk_hull(self, name: str, frame1: tuple[int, Sequence[float], Sequence[float]], frame2: tuple[int, Sequence[float], Sequence[float]], solid: tuple[Sequence[float], Sequence[float], Sequence[int]], rim: float, radius: float) -> int: ...

    def add_disk_hull_slip(self, name: str, frame1: tuple[int, Sequence[float], Sequence[float]], frame2: tuple[int, Sequence[float], Sequence[float]], solid: tuple[Sequence[float], Sequence[float], Sequence[int]], rim: float) -> int: ...

    def add_cylinder_cylinder(self, name: str, frame1: tuple[int, Sequence[float], Sequence[float]], frame2: tuple[int, Sequence[float], Sequence[float]], first: tuple[float, float, float], second: tuple[float, float, float], radius: float) -> int: ...

    def add_cylinder_cylinder_slip(self, name: str, frame1: tuple[int, Sequence[float], Sequence[float]], frame2: tuple[int, Sequence[float], Sequence[float]], first: tuple[float, float, float], second: tuple[float, float, float], radius1: float, radius2: float) -> int: ...

    def repeat_contact(self, name: str, number: int, frames1: Sequence[tuple[int, Sequence[float], Sequence[float]]]) -> None: ...

    def repeat_contact_friction(self, name: str, number: int, frames1: Sequence[tuple[int, Sequence[float], Sequence[float]]]) -> None: ...

    def add_capsule_pairs(self, name: str, number: int, lines1: Sequence[tuple[tuple[int, Sequence[float], Sequence[float]], float]], lines2: Sequence[tuple[tuple[int, Sequence[float], Sequence[float]], float]], radius: float, restitution: float) -> int: ...

    def add_capsule_pair_friction(self, name: str, number: int, lines1: Sequence[tuple[tuple[int, Sequence[float], Sequence[float]], float]], lines2: Sequence[tuple[tuple[int, Sequence[float], Sequence[float]], float]], radius1: float, first: int, mu: float, static_ratio: float) -> None: ...

class ConstraintRows:
    @property
    def name(self) -> str: ...

    @property
    def first(self) -> int: ...

    @property
    def count(self) -> int: ...

    @property
    def holonomic(self) -> list[bool]: ...

    @property
    def moves_in_time(self) -> bool: ...

    @property
    def shown(self) -> DisplayKind: ...

class Instant:
    @property
    def a(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def F_ideal(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def F_nonideal(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def C(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def F(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def lam(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def lam_ideal(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def rank(self) -> int: ...

    @property
    def modes(self) -> list[Mode]: ...

    @property
    def closed(self) -> list[int]: ...

    @property
    def friction(self) -> list[Annotated[NDArray[numpy.float64], dict(shape=(None,))]]: ...

    @property
    def limits(self) -> list[float]: ...

    @property
    def unique(self) -> bool | None: ...

class Runner:
    def acceleration(self, q: object, v: object, t: float, tau: object | None, out: object) -> None: ...

    def solve(self, q: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], v: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], t: float = 0.0, tau: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)] | None = None, modes: Sequence[Mode] | None = None, frozen: bool = False, directions: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)] | None = None) -> Instant: ...

    def rows(self, q: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], v: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], t: float, blocks: Sequence[int] | None = None) -> tuple[Annotated[NDArray[numpy.float64], dict(shape=(None,))], Annotated[NDArray[numpy.float64], dict(shape=(None,))], Annotated[NDArray[numpy.float64], dict(shape=(None,))], Annotated[NDArray[numpy.float64], dict(shape=(None,))]]: ...

    def residuals(self, q: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], v: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], t: float) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    def row_lengths(self, q: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], v: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], t: float, own: bool = False, blocks: Sequence[int] | None = None) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    def slip_rows(self, q: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], v: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], t: float) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    def terms(self, q: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], v: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> tuple[Annotated[NDArray[numpy.float64], dict(shape=(None,))], Annotated[NDArray[numpy.float64], dict(shape=(None,))]]: ...

    def energies(self, q: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], v: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> tuple[float, float]: ...

    def project(self, q: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], v: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], t: float, max_residual: float) -> tuple[Annotated[NDArray[numpy.float64], dict(shape=(None,))], Annotated[NDArray[numpy.float64], dict(shape=(None,))], float, float, float]: ...

    def law_residuals(self, q: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], v: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], t: float = 0.0, tau: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)] | None = None, modes: Sequence[Mode] | None = None, a: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)] | None = None, loads: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)] | None = None, friction: Sequence[Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]] | None = None) -> list[tuple[float, int]]: ...

    def time_evaluations(self, q: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], v: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], t: float, count: int) -> float: ...

    @property
    def rank(self) -> int: ...

    @property
    def continues(self) -> bool: ...

    @continues.setter
    def continues(self, arg: bool, /) -> None: ...

    @property
    def factorization(self) -> tuple[float, bool, bool, bool]: ...

    def simulate(self, q: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], v: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], options: pin_nonideal.simulation.options.RunOptions, tick: Callable[[float], None] | None = None, save: Callable[[bytes], None] | None = None, save_interval: float = 0.0, events: Sequence[tuple[Callable[[float, Annotated[NDArray[numpy.float64], dict(shape=(None,))], Annotated[NDArray[numpy.float64], dict(shape=(None,))]], float], int, int]] = [], callback: Callable[[float, Annotated[NDArray[numpy.float64], dict(shape=(None,))], Annotated[NDArray[numpy.float64], dict(shape=(None,))]], object] | None = None, hint: Callable[[float, int, float, bool], None] | None = None) -> Outcome: ...

    def resume(self, state: bytes, options: pin_nonideal.simulation.options.RunOptions, tick: Callable[[float], None] | None = None, save: Callable[[bytes], None] | None = None, save_interval: float = 0.0) -> Outcome: ...

class Method:
    @property
    def name(self) -> str: ...

    @property
    def adaptive(self) -> bool: ...

    @property
    def outside(self) -> bool: ...

    @property
    def one_step(self) -> bool: ...

def methods() -> list[Method]: ...

class EventKind(enum.Enum):
    """Kind of an event between two smooth parts of a run."""

    stick = 0
    """an element comes to rest"""

    slip = 1
    """a sticking element begins to slip"""

    reverse = 2
    """the slip velocity reverses"""

    pull = 3
    """the normal force of a contact turns negative"""

    chatter = 4
    """a cluster of events is bridged by time stepping"""

    several = 5
    """the laws also allow other motions from this time on"""

    paradox = 6
    """
    time stepping continues from this time on through modes that allow no motion
    """

    user = 7
    """a function of the user crosses zero"""

    saturate = 8
    """the torque of a drive reaches its effort limit"""

    desaturate = 9
    """the torque of a drive falls below its effort limit"""

    jump = 10
    """the rate of a prescribed motion jumps, with an impulse"""

    impact = 11
    """a contact strikes, with an impulse"""

    touch_down = 12
    """a contact closes without an impulse, or its bouncing ends"""

    lift_off = 13
    """a contact opens"""

    relaxed = 14
    """
    steps violate the laws of contact from this time on, by the velocity in `miss`
    """

class Event:
    @property
    def time(self) -> float: ...

    @property
    def kind(self) -> EventKind: ...

    @property
    def element(self) -> int: ...

    @property
    def energy_change(self) -> float: ...

    @property
    def miss(self) -> float: ...

    @property
    def impulse(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def v_minus(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def v_plus(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def of_contact(self) -> bool: ...

class Outcome:
    @property
    def t(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def q(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def v(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def violation(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def violation_rate(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def largest_violation(self) -> float: ...

    @property
    def a(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def tau(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def F_ideal(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def F_nonideal(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def lam(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def lam_ideal(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def energy(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def power(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def z(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def law_forces(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def limits(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def reactions(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def contact_forces(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def modes(self) -> Annotated[NDArray[numpy.int8], dict(shape=(None,))]: ...

    @property
    def dense_times(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def dense_states(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def dense_modes(self) -> Annotated[NDArray[numpy.int8], dict(shape=(None,))]: ...

    @property
    def dense_closed(self) -> Annotated[NDArray[numpy.int8], dict(shape=(None,))]: ...

    @property
    def dense_turning(self) -> Annotated[NDArray[numpy.int32], dict(shape=(None,))]: ...

    @property
    def dense_turning_counts(self) -> Annotated[NDArray[numpy.int32], dict(shape=(None,))]: ...

    @property
    def dense_directions(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def dense_sought(self) -> Annotated[NDArray[numpy.int8], dict(shape=(None,))]: ...

    @property
    def dense_torque(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def dense_moved(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def dense_impacts(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def closed(self) -> Annotated[NDArray[numpy.int8], dict(shape=(None,))]: ...

    @property
    def events(self) -> list[Event]: ...

    @property
    def steps(self) -> int: ...

    @property
    def rejected(self) -> int: ...

    @property
    def limited(self) -> int: ...

    @property
    def rounding(self) -> float: ...

    @property
    def evaluations(self) -> int: ...

    @property
    def factorizations(self) -> int: ...

    @property
    def projections(self) -> int: ...

    @property
    def iterations(self) -> int: ...

    @property
    def contact_misses(self) -> tuple[float, float, float]: ...

    @property
    def motion_residual(self) -> float: ...

    @property
    def stopped(self) -> BaseException | None: ...

def nearest_states(program: Program, q: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], v: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], t: float, max_residual: float, threads: int, names: Sequence[tuple[str, int, str]], values: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> tuple[Annotated[NDArray[numpy.float64], dict(shape=(None,))], Annotated[NDArray[numpy.float64], dict(shape=(None,))], Annotated[NDArray[numpy.float64], dict(shape=(None,))], Annotated[NDArray[numpy.float64], dict(shape=(None,))]]: ...

def dense_points(method: str) -> int: ...

def inside_steps(states: Annotated[NDArray[numpy.float64], dict(shape=(None, None, None), order='C', device='cpu', writable=False)], step: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)], part: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

def sample_inside(program: Program, options: pin_nonideal.simulation.options.RunOptions, t: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], y: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], modes: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], closed: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], turning: Annotated[NDArray[numpy.int64], dict(shape=(None,), order='C', device='cpu', writable=False)], directions: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], sought: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], torque: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], moved: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], impacts: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> Outcome: ...

def rollout(program: Program, q: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], v: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], options: pin_nonideal.simulation.options.RunOptions, threads: int, names: Sequence[tuple[str, int, str]], values: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> list[Outcome | None]: ...

def with_numbers(program: Program, names: Sequence[tuple[str, int, str]], values: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)]) -> Program: ...

def rollout_arrays(program: Program, q: NDArray[numpy.float64], v: NDArray[numpy.float64], options: pin_nonideal.simulation.options.RunOptions, threads: int, names: Sequence[tuple[str, int, str]], values: NDArray[numpy.float64]) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64], NDArray[numpy.float64], NDArray[numpy.float64], NDArray[numpy.float64], NDArray[numpy.float64], list[tuple[int, BaseException]]]: ...

class ExternalRun:
    def __init__(self, program: Program, options: pin_nonideal.simulation.options.RunOptions, tick: Callable[[float], None] | None = None, events: Sequence[tuple[Callable[[float, Annotated[NDArray[numpy.float64], dict(shape=(None,))], Annotated[NDArray[numpy.float64], dict(shape=(None,))]], float], int, int]] = []) -> None: ...

    def start(self, q: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], v: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> None: ...

    def derivative(self, t: float, y: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    def jacobian(self, t: float, y: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None))]: ...

    def follow(self, t: float, interpolant: Callable[[float], Annotated[NDArray[numpy.float64], dict(shape=(None,))]]) -> bool: ...

    def stop_before(self, end: float) -> float: ...

    @property
    def t(self) -> float: ...

    @property
    def done(self) -> bool: ...

    @property
    def y(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def rate(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def singular_onset(self) -> str | None: ...

    def outcome(self) -> Outcome: ...

class SteppedRun:
    def __init__(self, program: Program, method: str, period: float, dt: float, rtol: float, atol: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> None: ...

    def begin(self, q: object, v: object, t: float, tau: object | None) -> None: ...

    def advance(self, tau: object | None) -> None: ...

    def step(self, q: object, v: object, t: float, tau: object | None) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64]]: ...

    def state(self) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64]]: ...

    @property
    def begun(self) -> bool: ...

    @property
    def t(self) -> float: ...

    @property
    def modes(self) -> list[Mode]: ...

    def take_events(self) -> list[Event]: ...

class Program:
    def is_of(self, model: object) -> bool: ...

    def constraint_rows(self, blocks: Sequence[int]) -> list[ConstraintRows]: ...

    @property
    def constraints(self) -> list[ConstraintRows]: ...

    @property
    def bilateral(self) -> list[ConstraintRows]: ...

    @property
    def block_names(self) -> list[str]: ...

    @property
    def first_rows(self) -> list[int]: ...

    @property
    def free_gaps(self) -> list[int]: ...

    @property
    def rows(self) -> int: ...

    @property
    def states(self) -> int: ...

    @property
    def framed_contacts(self) -> list[int]: ...

    @property
    def contacts(self) -> list[int]: ...

    @property
    def first_gap(self) -> int: ...

    @property
    def law_names(self) -> list[str]: ...

    @property
    def power_names(self) -> list[str]: ...

    def law_supports(self) -> tuple[Annotated[NDArray[numpy.float64], dict(shape=(None,))], Annotated[NDArray[numpy.float64], dict(shape=(None,))]]: ...

    @property
    def reaction_blocks(self) -> list[int]: ...

    @property
    def element_laws(self) -> list[int]: ...

    @property
    def element_sizes(self) -> list[int]: ...

    @property
    def element_names(self) -> list[str]: ...

    @property
    def element_limits(self) -> list[tuple[int, float, float]]: ...

    def runner(self) -> Runner: ...

class ConeStatus(enum.Enum):
    """Result of a problem of contacts and friction."""

    solved = 0

    infeasible = 1

    jammed = 2

    failed = 3

class ConeSolver:
    def __init__(self) -> None: ...

    def solve(self, W: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], w0: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], dims: Sequence[int], bounds: Sequence[float], contacts: int, start: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)] | None = None) -> ConeStatus: ...

    def again(self, count: int, warm: bool) -> None: ...

    @property
    def f(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def residuals(self) -> tuple[float, float, float]: ...

    @property
    def certificate(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

    @property
    def unique_shares(self) -> bool: ...

    @property
    def steps(self) -> tuple[int, int]: ...

def gap_values(program: Program, q: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], t: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], blocks: Sequence[int]) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None))]: ...

def action_lines(program: Program, q: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], t: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], blocks: Sequence[int]) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None))]: ...

def slip_axes(program: Program, q: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], t: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], elements: Sequence[int]) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None))]: ...

def friction_program(W: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], alpha0: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], dims: Sequence[int], limits: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> Annotated[NDArray[numpy.float64], dict(shape=(None,))]: ...

def least_norm_friction(W: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], dims: Sequence[int], sizes: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], middles: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], force: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)]) -> tuple[bool, Annotated[NDArray[numpy.float64], dict(shape=(None,))]]: ...
