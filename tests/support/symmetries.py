"""Symmetry transformations of cases, under which results change by a known map only."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pinocchio as pin

import pin_nonideal as pn
from pin_nonideal.states.rows import holonomic_rows

from .cases import Carrier, Case, Maps
from .models import Units, other_order, rebuilt
from .random_trees import place_of


@dataclass(frozen=True, eq=False)
class Image:
    """Transformed case, and the map of its results.

    Attributes:
        case: transformed case.
        of: original case.
        carrier: map of coordinates and rows.
        place: placement of the image's world in that of the case.
        tolerance: factor of the tolerances.
        moving: whether no part is at rest.
        as_steps_shorten: whether first-order methods agree only in the limit of short steps. On a moving
            mount the position at a step's end has the error h^2 a/2, and projection changes all coordinates.
            Events without effect also end steps.
        without: kinds of values that are not compared.
    """

    case: Case
    of: Case
    carrier: Carrier
    place: pin.SE3 = field(default_factory=pin.SE3.Identity)
    tolerance: float = 1.0
    moving: bool = False
    as_steps_shorten: bool = False
    without: frozenset[str] = frozenset()

    def back(self, kind: str, value: Any) -> Any:
        """Return a value of the image as a value of the case."""
        maps = self.carrier.maps
        units = maps.units
        if kind in ("q", "place of rest"):
            return maps.q_back(value)
        if kind == "v":
            return maps.v_back(value)
        if kind == "a":
            return units.T * maps.v_back(value)
        if kind == "force":
            return maps.force_back(value)
        if kind == "lam":
            names = self.of.scene.constraint_slices
            return {name: self.carrier.rows_back(name, lambda called: value[called]) for name in names}
        if kind == "poses":
            return {name: self._poses(np.array(value[name])) for name in self.of.model.names if name in value}
        if kind == "by element":
            return {name: value[name] for name in value if not name.startswith(ADDED)}
        if kind == "events":
            return [self._event(*e) for e in value if not e[2].startswith(ADDED)]
        if kind == "energies":
            return {k: x / units.energy for k, x in value.items() if not k.startswith(ADDED)}
        factors = {"t": None, "energy": 1.0 / units.energy, "number": 1.0, "rates": units.T**2}
        return maps.time_back(value) if kind == "t" else factors[kind] * value

    def _poses(self, poses: np.ndarray) -> np.ndarray:
        back = self.place.inverse()
        poses[:, :3] = poses[:, :3] / self.carrier.maps.units.L @ back.rotation.T + back.translation
        for k, quaternion in enumerate(poses[:, 3:]):
            poses[k, 3:] = (pin.Quaternion(back.rotation) * pin.Quaternion(quaternion)).coeffs()
        return poses

    def _event(self, t: float, kind: str, element: str, impulse: Any) -> tuple[Any, ...]:
        units = self.carrier.maps.units
        size = None
        if impulse is not None:
            unit = self.carrier.row_units(element)[0]
            size = np.asarray(impulse) * unit / (units.energy * units.T)
        return self.carrier.maps.time_back(t), kind, element, size


ADDED = "added "  # prefix of names of elements that only the image has


@dataclass(frozen=True, eq=False)
class Transformation:
    """Transformation of a case to an image.

    Attributes:
        name: name of the transformation.
        make: function that returns the image of a case, or None if the symmetry does not apply.
        runs_only: whether only runs are affected.
    """

    name: str
    make: Callable[[Case], Image | None]
    runs_only: bool = False


ALL: dict[str, Transformation] = {}


def transformation(name: str, **more: Any) -> Callable[[Callable[[Case], Image | None]], Any]:
    """Register a function from a case to its image."""

    def register(make: Callable[[Case], Image | None]) -> Any:
        ALL[name] = Transformation(name, make, **more)
        return make

    return register


def then(first: Image, make: Callable[[Case], Image | None]) -> Image | None:
    """Return the image of an image; the second transformation keeps coordinates and names."""
    second = make(first.case)
    if second is None:
        return None
    carrier = replace(second.carrier, case=first.of)
    return replace(second, of=first.of, carrier=carrier)


def unchanged(case: Case, **changes: Any) -> Image:
    """Return the case with some fields changed, in the same coordinates."""
    changed = replace(case, **{"drawn": case.states, "moved": case.off, **changes})
    return Image(changed, case, Carrier(case, Maps.same(case.model)))


# --- The world and the mount ----------------------------------------------------------------------------


def explicit(case: Case) -> Image:
    """Replace the default world as plane or second frame by explicit world frames."""
    model = case.model.copy()
    q0 = case.scene.q0
    known = {f.name for f in model.frames}

    def frame(name: str, joint: int, place: pin.SE3) -> str:
        if name not in known:
            model.addFrame(pin.Frame(name, joint, 0, place, pin.FrameType.OP_FRAME), False)
            known.add(name)
        return name

    def pair(d: Any) -> Any:
        here = place_of(model, q0, d.frame1)
        first = model.frames[model.getFrameId(d.frame1)]
        level = pin.SE3(first.placement.rotation @ here.rotation.T, first.placement.translation)
        one = frame(f"{d.name} level", first.parentJoint, level)
        two = frame(f"{d.name} world", 0, pin.SE3(np.eye(3), here.translation))
        axis = {"axis": tuple(here.rotation @ np.array(d.axis))} if isinstance(d, pn.HingeAnchor) else {}
        return replace(d, frame1=one, frame2=two, **axis)

    def placed(d: Any) -> Any:
        if hasattr(d, "frame2") and d.frame2 is None:
            return pair(d)
        if hasattr(d, "plane") and d.plane is None:
            return replace(d, plane=frame("world axes", 0, pin.SE3.Identity()))
        return d

    lists = {key: tuple(map(placed, getattr(case, key))) for key in ("constraints", "contacts", "forces")}
    return unchanged(case, model=model, **lists)


transformation("world by name")(explicit)


def mounted(case: Case, place: pin.SE3) -> Image:
    made = rebuilt(case.model, mount=place)
    carrier = Carrier(case, Maps.same(case.model), turn=place.rotation)
    return Image(carrier.image(made.model), case, carrier, place)


def _somewhere(case: Case, size: float, turned: bool) -> pin.SE3:
    rng = np.random.default_rng(sum(map(ord, case.name)))
    quaternion = rng.standard_normal(4)
    R = pin.Quaternion(quaternion / np.linalg.norm(quaternion)).toRotationMatrix()
    return pin.SE3(R if turned else np.eye(3), size * rng.standard_normal(3))


@transformation("turned mount")
def _(case: Case) -> Image | None:
    return then(explicit(case), lambda c: mounted(c, _somewhere(case, 0.0, turned=True)))


@transformation("moved mount")
def _(case: Case) -> Image | None:
    return then(explicit(case), lambda c: mounted(c, _somewhere(case, 3.0, turned=False)))


def carried_along(case: Case, rate: float, growth: float) -> Image | None:
    """Place the scene on a mount that moves along a line; gravity compensates its acceleration."""
    if case.has(pn.Drag, pn.KnifeEdge):  # drag and knife edges depend on the world frame
        return None
    rng = np.random.default_rng(len(case.name))
    along = rng.standard_normal(3)
    along /= np.linalg.norm(along)
    made = rebuilt(case.model, moving=pin.JointModelPrismaticUnaligned(along))
    new = made.model
    new.gravity = pin.Motion(new.gravity.linear + growth * along, np.zeros(3))

    def q(t: float) -> np.ndarray:
        x = pin.neutral(new) * (maps.Sq.sum(axis=1) == 0.0)
        x[0] = rate * t + 0.5 * growth * t * t
        return x

    def v(t: float) -> np.ndarray:
        return np.eye(new.nv)[0] * (rate + growth * t)

    maps = Maps.chosen(case.model, new, made.joints)
    maps = replace(maps, more_q=q, more_v=v)
    carrier = Carrier(case, maps)
    drive = pn.PrescribedMotion("mount", pn.polynomial([0.0, rate, 0.5 * growth]), name="added drive")
    image = carrier.image(new)
    image = replace(image, constraints=(*image.constraints, drive))
    return Image(
        image,
        case,
        carrier,
        moving=True,
        as_steps_shorten=growth != 0.0,
        without=frozenset({"energies", "balance", "poses", "rank"}),
    )


@transformation("boosted")
def _(case: Case) -> Image | None:
    return then(explicit(case), lambda c: carried_along(c, 2.0, 0.0))


@transformation("accelerated")
def _(case: Case) -> Image | None:
    return then(explicit(case), lambda c: carried_along(c, 0.5, 3.0))


# --- Units ----------------------------------------------------------------------------------------------


def in_units(case: Case, units: Units) -> Image:
    from .models import model_letters

    of_v, of_q = (units.of(x) for x in model_letters(case.model))
    maps = Maps(np.diag(1.0 / of_v), np.diag(of_v), np.diag(1.0 / of_q), np.diag(of_q), units)
    carrier = Carrier(case, maps)
    made = rebuilt(case.model, units=units)
    return Image(carrier.image(made.model), case, carrier)


for _name, _units in {
    "millimeters": Units(L=1e3),
    "grams": Units(M=1e3),
    "milliseconds": Units(T=1e3),
    "tonnes, kilometers, hours": Units(L=1e-3, M=1e-3, T=1.0 / 3600.0),
}.items():
    transformation(_name)(lambda case, units=_units: in_units(case, units))


# --- Order, copies and factors --------------------------------------------------------------------------


@transformation("reversed lists")
def _(case: Case) -> Image:
    return unchanged(
        case, **{key: getattr(case, key)[::-1] for key in ("constraints", "contacts", "laws", "forces")}
    )


@transformation("branches in another order")
def _(case: Case) -> Image | None:
    order = other_order(case.model)
    if order == list(range(1, case.model.njoints)):
        return None
    made = rebuilt(case.model, order=order)
    carrier = Carrier(case, Maps.chosen(case.model, made.model, made.joints))
    return Image(carrier.image(made.model), case, carrier)


def loaded_names(case: Case) -> set[str]:
    """Return constraints whose reactions a law reads: copies would share the load."""
    if case.has(pn.UserLaw, pn.UserFriction):
        return {c.name for c in case.constraints}
    return {law.joint for law in case.laws if isinstance(law, pn.JointFriction)}


def shares_loads(case: Case) -> bool:
    """Check if friction depends on the loads of redundant rows."""
    loaded = case.has(pn.UserLaw, pn.UserFriction, pn.JointFriction, pn.Rolling) or any(
        getattr(c, "mu", 0.0) for c in case.contacts
    )
    return loaded and not independent(case)


def independent(case: Case) -> bool:
    """Check if all active rows are independent at the start."""
    scene = case.scene
    q, v = case.states[0]
    try:
        s = scene.solve(q, v, case.t0)
    except pn.PinNonidealError:
        return False
    dropped = len(scene.dropped)
    kept = sum(len(range(r.start, r.stop)) for r in scene.constraint_slices.values())
    return bool(s.rank == kept - dropped - int((~s.closed).sum()))


@transformation("stated twice")
def _(case: Case) -> Image | None:
    if shares_loads(case):
        return None
    loaded = loaded_names(case)
    doubles = [c for c in case.constraints if c.name not in loaded and not isinstance(c, pn.Rolling)]
    touches = [c for c in case.contacts if not isinstance(c, pn.JointLimit)]
    again = [replace(c, name=f"{ADDED}{c.name}") for c in (*doubles, *touches)]
    if not again:
        return None
    image = unchanged(
        case,
        constraints=(*again[: len(doubles)], *case.constraints),
        contacts=(*case.contacts, *again[len(doubles) :]),
    )
    one = np.eye(50)
    rows = {
        c.name: [
            (c.name, one[: _size(case, c.name), : _size(case, c.name)]),
            (f"{ADDED}{c.name}", one[: _size(case, c.name), : _size(case, c.name)]),
        ]
        for c in (*doubles, *touches)
    }
    return replace(image, carrier=replace(image.carrier, rows=rows), without=frozenset({"forces by contact"}))


def _size(case: Case, name: str) -> int:
    rows = case.scene.constraint_slices[name]
    return rows.stop - rows.start


def by_hand(case: Case, scale: float) -> Image | None:
    """Replace each constraint by user functions, with all rows times a factor."""
    if shares_loads(case) or case.has(pn.UserLaw, pn.UserFriction):
        return None
    if any(getattr(law, "mu", 0.0) for law in case.laws):  # user rows have no wrench on bodies
        return None
    loaded = loaded_names(case)
    chosen = [c for c in case.constraints if c.name not in loaded and _writable(c)]
    if not chosen:
        return None
    rows, written = {}, {}
    for c in chosen:
        parts = _as_functions(case, c, scale)
        written[c.name] = [part for part, _ in parts]
        one = scale * np.eye(_size(case, c.name))
        rows[c.name] = [(part.name, one[:, of]) for part, of in parts]
    image = unchanged(
        case, constraints=tuple(part for c in case.constraints for part in written.get(c.name, [c]))
    )
    return replace(image, carrier=replace(image.carrier, rows=rows), without=frozenset({"poses"}))


def _writable(c: Any) -> bool:
    """Check if user functions can represent a constraint; resistance torques cannot be represented.

    For angles between frames the rate is the derivative of the residual on the constraint only, but functions
    are also checked off the constraint.
    """
    resists = getattr(c, "torsional", 0.0) or getattr(c, "rolling", 0.0)
    return not (resists or isinstance(c, (pn.FrameAnchor, pn.HingeAnchor)))


def _as_functions(case: Case, c: Any, scale: float) -> list[tuple[pn.UserConstraint, np.ndarray]]:
    """Return a constraint as a user constraint, or as two if some rows are nonholonomic, with their rows."""
    if isinstance(c, pn.UserConstraint):

        def times(key: str) -> Any:
            f = getattr(c, key)
            return None if f is None else lambda *x: scale * np.asarray(f(*x))

        def both(*x: Any) -> Any:
            A, b = c.function(*x)
            return scale * np.asarray(A), scale * np.asarray(b)

        again = replace(c, function=both, residual=times("residual"), rate=times("rate"))
        return [(again, np.arange(c.size))]
    alone = pn.Scene(case.model, constraints=[c], q0=case.q0)
    program = alone._compiled.program
    runner, nv = program.runner(), case.model.nv
    places = holonomic_rows(program)

    def at(t: float, q: Any, v: Any, of: Any) -> Any:
        A, b, phi, rate = runner.rows(np.array(q), np.array(v), float(t))
        return [scale * x[of] for x in (A.reshape(-1, nv), b, phi, rate)]

    def part(of: Any, name: str, residual: Any) -> pn.UserConstraint:
        return pn.UserConstraint(
            lambda t, q, v, data: at(t, q, v, of)[:2],
            int(of.sum()),
            residual=residual,
            rate=lambda t, q, v: at(t, q, v, of)[3],
            name=name,
        )

    found = []
    if places.any():
        placed = part(places, c.name, lambda t, q: at(t, q, np.zeros(nv), places)[2])
        found.append((placed, np.flatnonzero(places)))
    if not places.all():
        rolled = part(~places, f"{ADDED}{c.name}" if found else c.name, None)
        found.append((rolled, np.flatnonzero(~places)))
    return found


transformation("rows by hand, times 1e4")(lambda case: by_hand(case, 1e4))
transformation("rows by hand, times 1e-4")(lambda case: by_hand(case, 1e-4))


# --- Bodies ---------------------------------------------------------------------------------------------


def split(case: Case, by: Any, hold: Any) -> Image | None:
    """Split the body of the middle joint into two parts that a joint and a constraint connect."""
    j = 1 + (case.model.njoints - 1) // 2
    if (
        j >= case.model.njoints
        or min(case.model.inertias[j].mass, *np.diag(case.model.inertias[j].inertia)) <= 0.0
    ):
        return None  # no body to split
    made = rebuilt(case.model, split=j, by=by)
    carrier = Carrier(case, Maps.chosen(case.model, made.model, made.joints))
    image = carrier.image(made.model)
    for name, joint in (("split a", made.joints[j]), ("split b", made.parts[j])):
        image.model.addFrame(pin.Frame(name, joint, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME), False)
    held = replace(image, constraints=(*image.constraints, hold))
    if shares_loads(case) or shares_loads(held):  # zero rows of a planar mechanism act on the split body
        return None
    return Image(held, case, carrier, without=frozenset({"rank"}))


@transformation("split by a weld")
def _(case: Case) -> Image | None:
    weld = pn.FrameAnchor("split a", "split b", name="added weld")
    return split(case, pin.JointModelRX(), weld)


@transformation("split by a lock")
def _(case: Case) -> Image | None:
    lock = pn.PrescribedMotion("split", pn.constant(0.0), name="added lock")
    return split(case, pin.JointModelPY(), lock)


# --- Time and steps -------------------------------------------------------------------------------------


@transformation("later")
def _(case: Case) -> Image:
    carrier = Carrier(case, Maps.same(case.model, later=2.0))
    return Image(carrier.image(case.model), case, carrier)


@transformation("cut in two", runs_only=True)
def _(case: Case) -> Image | None:
    if case.has(pn.LuGre, pn.actuation.SampledControl) or any(getattr(law, "states", 0) for law in case.laws):
        return None  # their internal state is lost
    return unchanged(case, parts=(0.37,))


@transformation("sampled more finely", runs_only=True)
def _(case: Case) -> Image:
    return unchanged(case, finer=5)


@transformation("rtol 1e-12", runs_only=True)
def _(case: Case) -> Image:
    return replace(unchanged(case, rtol=1e-12, atol=1e-14), tolerance=1.0)


@transformation("rtol 1e-6", runs_only=True)
def _(case: Case) -> Image:
    return replace(unchanged(case, rtol=1e-6, atol=1e-8), tolerance=3e3)


@transformation("dopri5", runs_only=True)
def _(case: Case) -> Image:
    return unchanged(case, method="dopri5")


@transformation("rk4", runs_only=True)
def _(case: Case) -> Image:
    return replace(unchanged(case, method="rk4"), tolerance=1e2)


@transformation("Radau", runs_only=True)
def _(case: Case) -> Image | None:
    if case.contacts or case.has(pn.JointFriction, pn.UserFriction, pn.actuation.SampledControl):
        return None  # events need the core's methods
    return replace(unchanged(case, method="Radau"), tolerance=1e2)


@transformation("Pinocchio's terms")
def _(case: Case) -> Image:
    return unchanged(case, terms="pinocchio")


# --- What cannot act ------------------------------------------------------------------------------------


def body_frames(model: pin.Model, case: Case) -> tuple[int, str]:
    """Return the last joint, and add a frame "added tip" to its body."""
    joint = model.njoints - 1
    place = pin.SE3(np.eye(3), np.array([0.1, 0.2, 0.3]))
    model.addFrame(pin.Frame("added tip", joint, 0, place, pin.FrameType.OP_FRAME), False)
    model.addFrame(pin.Frame("added root", joint, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME), False)
    return joint, "added tip"


@transformation("an idle row")
def _(case: Case) -> Image:
    """Add a rod between two points of one body, and a zero row."""
    model, nv = case.model.copy(), case.model.nv
    body_frames(model, case)
    rod = pn.Distance("added tip", "added root", name="added rod")
    nothing = pn.UserConstraint(
        lambda t, q, v, data: (np.zeros((1, nv)), np.zeros(1)),
        1,
        residual=lambda t, q: np.zeros(1),
        rate=lambda t, q, v: np.zeros(1),
        name="added nothing",
    )
    return unchanged(case, model=model, constraints=(rod, *case.constraints, nothing))


@transformation("a far contact")
def _(case: Case) -> Image:
    model = case.model.copy()
    _, tip = body_frames(model, case)
    far = pn.PointContact(tip, mu=0.5, height=-1e3, restitution=0.5, name="added far contact")
    return unchanged(case, model=model, contacts=(far, *case.contacts))


@transformation("laws and forces of nothing")
def _(case: Case) -> Image:
    model, nv = case.model.copy(), case.model.nv
    _, tip = body_frames(model, case)
    single = [model.names[j] for j in range(1, model.njoints) if model.joints[j].nv == 1]
    laws: list[Any] = [
        pn.Drag(tip, 0.0, name="added drag"),
        pn.UserLaw(lambda t, q, v, r: np.zeros(nv), reaction=None, name="added law"),
    ]
    if single:
        laws.append(pn.SigmoidFriction(single[-1], 0.0, 1.0, name="added sigmoid"))
    forces = (pn.Wrench(tip, np.zeros(6), name="added wrench"), *case.forces)
    return unchanged(case, model=model, laws=(*case.laws, *laws), forces=forces)


@transformation("friction without limit")
def _(case: Case) -> Image | None:
    """Add a dry friction element with a limit of zero, which may stick."""
    model = case.model
    single = [j for j in range(1, model.njoints) if model.joints[j].nv == 1]
    if not single:
        return None
    row = np.eye(model.nv)[model.joints[single[0]].idx_v]
    rub = pn.UserFriction(lambda t, q: row, lambda t, q, v, r: 0.0, name="added friction")
    # If two elements slip together, the event may name either.
    return replace(
        unchanged(case, laws=(*case.laws, rub)), as_steps_shorten=True, without=frozenset({"events"})
    )


@transformation("a body apart")
def _(case: Case) -> Image:
    """Add a balanced wheel on a spring that is independent of the rest."""
    model = case.model.copy()
    k = model.addJoint(0, pin.JointModelRY(), pin.SE3(np.eye(3), np.array([0.0, 9.0, 0.0])), "added wheel")
    Y = pin.Inertia(1.0, np.zeros(3), 0.01 * np.eye(3))
    model.appendBodyToJoint(k, Y, pin.SE3.Identity())
    carrier = Carrier(case, Maps.chosen(case.model, model, {j: j for j in range(case.model.njoints)}))
    image = carrier.image(model, q0=None)
    maps = carrier.maps
    q0, v0 = maps.state(case.q0, case.v0, 0.0)
    spring = pn.JointSpring("added wheel", 1.0, name="added spring")
    made = replace(image, q0=q0, v0=v0, forces=(*image.forces, spring))
    # The search steps depend on all coordinates and may reach another equilibrium, or none.
    made = replace(made, skips=made.skips | {"equilibrium"})
    return Image(made, case, carrier, without=frozenset({"energies"}))
