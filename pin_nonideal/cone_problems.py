"""Contact and friction forces of several contacts at one instant, on plain arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .core_loader import core
from .errors import InputError
from .validation import array

__all__ = ["ConeResiduals", "ConeSolution", "cone_complementarity"]

Array = NDArray[np.floating[Any]]

# Velocities below this part of those in play are none, for the names of the modes alone.
AT_REST = 1e-9
LARGEST = 3  # rows of a contact: its normal and two slip directions


@dataclass(frozen=True)
class ConeResiduals:
    """By how much a solution misses the laws of contact.

    Parts of what is in play: of a velocity, the largest |w0| or, where it is more, |W| |f| of the row; of a
    force, the largest |f|; of a power, their product.

    Attributes:
        signorini: of w_n >= 0, f_n >= 0 and f_n w_n = 0.
        coulomb: of |f_t| <= mu f_n and |f| <= limit.
        dissipation: of maximum dissipation, f_t . w_t = -mu f_n |w_t| and f . w = -limit |w|.
    """

    signorini: float
    coulomb: float
    dissipation: float


@dataclass(frozen=True, eq=False)
class ConeSolution:
    """What `cone_complementarity` found.

    Attributes:
        f: forces (or impulses), (n,); the shortest with this w where contacts share a load that W does not
            split.
        w: W f + w0, (n,).
        modes: "open", "stick" or "slip" of each element.
        residuals: what f and w miss, with any status.
        status: "solved".  "infeasible": no forces whatever keep the contacts from being entered.  "jammed":
            the motion drives contacts into each other, so that none need exist, and none was found.
            "failed": none was found, which proves nothing.
        certificate: proof of "infeasible" or "jammed" that anyone can check, (n,); empty otherwise.
            Infeasible: y >= 0 on the normals and zero elsewhere, with y . w0 < 0 and u = -W^T y of u_n >= mu
            |u_t| for every contact (with boxes: y . w0 plus limit |u| of each is still negative), so that y
            . w < 0 whatever f.
            Jammed: forces y in the cones that balance by themselves, W^T y = 0, with y . w0 < 0.
    """

    f: Array
    w: Array
    modes: tuple[str, ...]
    residuals: ConeResiduals
    status: str
    certificate: Array


def cone_complementarity(
    W: ArrayLike,
    w0: ArrayLike,
    mu: ArrayLike,
    *,
    dims: ArrayLike | None = None,
    limits: ArrayLike = (),
    start: ArrayLike | None = None,
) -> ConeSolution:
    """Forces of unilateral contacts with Coulomb friction, normals and tangents together.

    With f = (f_n, f_t) and w = W f + w0 = (w_n, w_t) of each contact:

        w_n >= 0,  f_n >= 0,  f_n w_n = 0                                     (Signorini)
        |f_t| <= mu f_n,  f_t = -mu f_n w_t / |w_t| where w_t is not 0        (Coulomb)

    The cone is the exact circular one.  Both lines are f in K = {|f_t| <= mu f_n}, u = w + (mu |w_t|, 0) in
    the dual cone of K, and f . u = 0.  W is the Delassus matrix A M^-1 A^T of the contacts' rows, of any
    rank; it may be any square matrix (one that is not symmetric comes of contacts whose slip direction is
    known).  w are velocities and f impulses, or w accelerations and f forces.

    Args:
        W: response of w to f, (n, n) [1/kg for contacts of points].
        w0: w without forces, (n,) [m/s or m/s^2].
        mu: coefficient of friction of each contact, (k,), or one number for all; at least 0.
        dims: rows of each contact, (k,), or one number: 3 (normal and two slip directions), 2 (planar
            friction) or 1 (none).  None: the same for all, n / k; 3 where mu is one number.
        limits: limits of dry friction of one row each that follow the contacts' rows, |f| <= limit and
            f = -limit w / |w| where it slips, (m,) [N or N s].
        start: forces near the solution, (n,), such as those of the step before; None for a cold start.

    Returns:
        The `ConeSolution`.  Newton's method on the modes after Alart and Curnier; where it does not come to
        rest, an interior-point method on second-order cones first, with de Saxce's correction mu |w_t|
        inside Newton's equations or held in turn.  Contacts are scaled by their own response; one below
        1e-14 of the largest counts as none.

    Raises:
        InputError: a shape does not fit, a value is not finite, or a coefficient or limit is negative.

    Source: Acary, Cadoux, Lemaréchal, Malick, "A formulation of the linear discrete Coulomb friction
    problem via convex optimization", ZAMM 91 (2011); Alart, Curnier, Comput. Methods Appl. Mech. Eng. 92
    (1991).
    """
    w0 = array("w0", w0, (None,))
    n = len(w0)
    W = array("W", W, (n, n))
    limits = _bounds("limits", array("limits", limits, (None,)))
    rows, mu = _contacts(n - len(limits), array("mu", mu, (None,) * _depth(mu)), dims)
    start = None if start is None else array("start", start, (n,))
    solver = core.ConeSolver()
    every = [*rows, *[1] * len(limits)]
    status = solver.solve(np.ascontiguousarray(W), w0, every, [*mu, *limits], len(rows), start)
    f = solver.f
    w = W @ f + w0
    modes = _modes(f, w, np.abs(W) @ np.abs(f) + np.abs(w0).max(initial=0.0), every, len(rows))
    return ConeSolution(f, w, modes, ConeResiduals(*solver.residuals), status.name, solver.certificate)


def _depth(value: object) -> int:
    """0 of one number, 1 of a list."""
    return min(np.asarray(value, dtype=object).ndim, 1)


def _bounds(name: str, values: Array) -> Array:
    if values.ndim != 1 or (values < 0.0).any():
        raise InputError(f"{name} must be at least 0, one a row, got {values}; correct the negative ones")
    return values


def _contacts(rows: int, mu: Array, dims: ArrayLike | None) -> tuple[list[int], Array]:
    """Rows and coefficient of each contact, whose rows are `rows` together."""
    given = None if dims is None else array("dims", dims, (None,) * _depth(dims))
    if given is not None and given.ndim == 1:
        count = len(given)
    elif mu.ndim == 1 and len(mu) > 0:
        count = len(mu)
    else:
        count = rows // (LARGEST if given is None else max(int(given), 1)) if rows > 0 else 0
    if given is None:
        given = np.asarray(rows // count if count else LARGEST)
    each = [int(d) for d in np.broadcast_to(given, (count,))]
    if sum(each) != rows or any(not 1 <= d <= LARGEST for d in each) or (given != given.astype(int)).any():
        raise InputError(
            f"dims must be 1, 2 or 3 a contact and add up to the {rows} rows of contacts in w0, got {each};"
            " pass dims, or as many coefficients mu as there are contacts"
        )
    if mu.ndim > 1 or (mu.ndim == 1 and len(mu) != count):
        raise InputError(f"mu must be a number or have shape ({count},), got {mu.shape}; one a contact")
    return each, _bounds("mu", np.broadcast_to(mu, (count,)).astype(float))


def _modes(f: Array, w: Array, size: Array, dims: list[int], contacts: int) -> tuple[str, ...]:
    names, row = [], 0
    for e, dim in enumerate(dims):
        head = int(e < contacts)
        speed = np.linalg.norm(w[row + head : row + dim])
        if head and f[row] == 0.0 and w[row] > AT_REST * size[row]:
            names.append("open")
        else:
            names.append("slip" if speed > AT_REST * size[row : row + dim].max() else "stick")
        row += dim
    return tuple(names)
