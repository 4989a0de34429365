"""Contact and friction forces of several coupled contacts at one instant, on plain arrays."""

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

# Velocities below this fraction of the velocity scale count as zero in the names of the modes only.
AT_REST = 1e-9
MAX_ROWS = 3  # maximum number of rows of a contact: normal and two slip directions


@dataclass(frozen=True)
class ConeResiduals:
    """Relative residuals of a solution in the laws of contact.

    The scale of a velocity is the larger of max |w0| and |W| |f| of its row. The scale of a force is the
    largest |f|. The scale of a power is the product of both.

    Attributes:
        signorini: residual of w_n >= 0, f_n >= 0 and f_n w_n = 0.
        coulomb: residual of |f_t| <= mu f_n and |f| <= limit.
        dissipation: residual of maximum dissipation, f_t . w_t = -mu f_n |w_t| and f . w = -limit |w|.
    """

    signorini: float
    coulomb: float
    dissipation: float


@dataclass(frozen=True, eq=False)
class ConeSolution:
    """Result of `cone_complementarity`.

    Attributes:
        f: forces (or impulses), (n,); the minimum-norm forces for this w if contacts are hyperstatic.
        w: W f + w0, (n,).
        modes: "open", "stick" or "slip" of each element.
        residuals: residuals of f and w, for any status.
        status: "solved". "infeasible": no forces prevent penetration. "jammed": the motion drives contacts
            into each other, so a solution may not exist, and none was found. "failed": no solution was found,
            but one may exist.
        certificate: verifiable proof of "infeasible" or "jammed", (n,); empty otherwise.
            Infeasible: y >= 0 on the normals and zero elsewhere, with y . w0 < 0 and u = -W^T y with u_n >=
            mu |u_t| for each contact (with boxes: y . w0 plus the sum of limit |u| is still negative). Then
            y . w < 0 for any f.
            Jammed: self-balanced forces y in the cones, W^T y = 0, with y . w0 < 0.
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
    """Solve for the forces of unilateral contacts with Coulomb friction, normals and tangents coupled.

    Each contact has f = (f_n, f_t) and w = W f + w0 = (w_n, w_t), and satisfies

        w_n >= 0,  f_n >= 0,  f_n w_n = 0                                     (Signorini)
        |f_t| <= mu f_n,  f_t = -mu f_n w_t / |w_t| where w_t is not 0        (Coulomb)

    The friction cone is circular and exact. The conditions are equivalent to f in K = {|f_t| <= mu f_n},
    u = w + (mu |w_t|, 0) in the dual cone of K, and f . u = 0. W is the Delassus matrix A M^-1 A^T of the
    contacts' rows, of any rank. W may be any square matrix: contacts with known slip direction give
    nonsymmetric ones. w are velocities and f impulses, or w accelerations and f forces.

    Args:
        W: response of w to f, (n, n) [1/kg for contacts of points].
        w0: w without forces, (n,) [m/s or m/s^2].
        mu: coefficient of friction of each contact, (k,), or one number for all; at least 0.
        dims: number of rows of each contact, (k,), or one number: 3 (normal and two slip directions), 2
            (planar friction) or 1 (no friction). None: n / k for all contacts, or 3 if mu is one number.
        limits: limits of dry friction elements of one row each, after the contacts' rows, (m,) [N or N s]:
            |f| <= limit, and f = -limit w / |w| during slip.
        start: forces near the solution for a warm start, (n,), such as those of the last step; None for a
            cold start.

    Returns:
        The `ConeSolution`. The solver is Newton's method on the modes after Alart and Curnier. If it does not
        converge, an interior-point method on second-order cones provides a start, with De Saxcé's correction
        mu |w_t| inside Newton's equations or fixed alternately. Contacts are scaled by their response; a
        response below 1e-14 of the largest counts as zero.

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
    """Return 0 for a number, 1 for a list."""
    return min(np.asarray(value, dtype=object).ndim, 1)


def _bounds(name: str, values: Array) -> Array:
    if values.ndim != 1 or (values < 0.0).any():
        raise InputError(
            f"{name} must be a list of numbers of at least 0, got {values}; correct the negative numbers"
        )
    return values


def _contacts(rows: int, mu: Array, dims: ArrayLike | None) -> tuple[list[int], Array]:
    """Return the number of rows and the coefficient of each contact; `rows` is the total number of rows."""
    sizes = None if dims is None else array("dims", dims, (None,) * _depth(dims))
    if sizes is not None and sizes.ndim == 1:
        count = len(sizes)
    elif mu.ndim == 1 and len(mu) > 0:
        count = len(mu)
    else:
        count = rows // (MAX_ROWS if sizes is None else max(int(sizes), 1)) if rows > 0 else 0
    if sizes is None:
        sizes = np.asarray(rows // count if count else MAX_ROWS)
    each = [int(d) for d in np.broadcast_to(sizes, (count,))]
    if sum(each) != rows or any(not 1 <= d <= MAX_ROWS for d in each) or (sizes != sizes.astype(int)).any():
        raise InputError(
            f"dims must be 1, 2 or 3 for each contact and add up to the {rows} rows of contacts in w0, got "
            f"{each}; pass dims, or as many coefficients mu as there are contacts"
        )
    if mu.ndim > 1 or (mu.ndim == 1 and len(mu) != count):
        raise InputError(
            f"mu must be a number or have shape ({count},), got {mu.shape}; one number per contact"
        )
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
