"""Example (b) of the paper: a bead on a rough ring in a vertical plane.

The script prints the paper's formulas beside the values from `pn.solve`.  Then it simulates the bead as a
scene with Coulomb friction from the multiplier of the ring, and compares the motion with the closed form.

Run: python oracles/paper_b_ring.py
Source: Udwadia, Kalaba, Phohomsiri, J. Appl. Mech. 71 (2004), Example (b), Eqs. (61)-(69).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

import pin_nonideal as pn


@dataclass(frozen=True)
class Ring:
    """Bead on x^2 + y^2 = R^2, y upwards, with the formulas of the paper; q = (x, y) [m], v = dq/dt.

    Args:
        mass: mass of the bead [kg].
        radius: radius R of the ring [m].
        mu: coefficient of friction.
        g: gravity [m/s^2].
    """

    mass: float = 1.0
    radius: float = 1.0
    mu: float = 0.25
    g: float = 9.81

    @property
    def mass_matrix(self):
        """Return M [kg]."""
        return self.mass * np.eye(2)

    @property
    def given(self):
        """Return F [N], the force of gravity."""
        return np.array([0.0, -self.mass * self.g])  # M a with the a of Eq. (61)

    def residual(self, t, q):
        """Return the residual of the ring, halved so that its rate is x xdot + y ydot."""
        return np.array([(q @ q - self.radius**2) / 2.0])  # Eq. (2)

    def rate(self, t, q, v):
        """Return the rate of the residual."""
        return np.array([q @ v])

    def rows(self, t, q, v, data=None):
        """Return A and b of A a = b."""
        return q[None, :].copy(), np.array([-(v @ v)])  # Eqs. (63), (64)

    def normal(self, q, v):
        """Return N = m (v^2 - y g) / R [N], positive if the ring pushes the bead towards its center."""
        return self.mass * (v @ v - q[1] * self.g) / self.radius

    def rubbing(self, h, v):
        """Return C for a friction force of size h against the velocity, Eq. (68); zero at rest."""
        speed = np.linalg.norm(v)
        return -h / speed * v if speed > 0.0 else np.zeros(2)

    def prescribed(self, t, q, v, reactions=None):
        """Return C with h as a function of the state, as in the paper."""
        return self.rubbing(self.mu * abs(self.normal(q, v)), v)

    def from_reactions(self, t, q, v, reactions):
        """Return C with h from the multiplier: the ring's force is lam [x, y], of size |lam| R."""
        return self.rubbing(self.mu * abs(reactions.lam[0]) * np.linalg.norm(q), v)

    def paper_null_space(self, q):
        """Return V."""
        return np.sqrt(self.mass) * np.array([[q[1]], [-q[0]]])  # Eq. (66)

    def paper_inverse(self, q):
        """Return J B^T, the Moore-Penrose inverse of B."""
        return np.sqrt(self.mass) / self.radius**2 * q  # Eq. (67)

    def paper_force(self, q, v, h):
        """Return the ideal and the nonideal constraint force, Eq. (69)."""
        (x, y), (xd, yd) = q, v
        ideal = -self.mass * (v @ v - y * self.g) / self.radius**2 * q
        nonideal = -h / np.linalg.norm(v) * (y * xd - x * yd) / self.radius**2 * np.array([y, -x])
        return ideal, nonideal

    def scene(self, reaction="total"):
        """Return the bead as a scene; h depends on the multiplier, or on the state if reaction=None."""
        model = pin.Model()
        model.name = "ring"
        model.gravity.linear = np.array([0.0, -self.g, 0.0])
        x = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
        y = model.addJoint(x, pin.JointModelPY(), pin.SE3.Identity(), "y")
        model.appendBodyToJoint(y, pin.Inertia(self.mass, np.zeros(3), np.zeros((3, 3))), pin.SE3.Identity())
        law = self.prescribed if reaction is None else self.from_reactions
        q0, v0 = self.at(0.0, 0.0)
        return pn.Scene(
            model,
            constraints=[
                pn.UserConstraint(self.rows, 1, residual=self.residual, rate=self.rate, name="ring")
            ],
            laws=[pn.UserLaw(law, reaction=reaction, name="rubbing")],
            q0=q0,
            v0=v0,
        )

    def at(self, angle, speed):
        """Return the state at an angle from the bottom [rad] with a speed along the ring [m/s]."""
        tangent = np.array([np.cos(angle), np.sin(angle)])
        return self.radius * np.array([np.sin(angle), -np.cos(angle)]), speed * tangent

    def speed_squared(self, angle, speed0):
        """Return v^2 at an angle [rad] for speed0 at the bottom, while N and the speed keep their signs.

        d(v^2)/d(angle) + 2 mu v^2 = -2 g R (sin + mu cos) has constant coefficients.
        """

        def forced(angle):
            factor = 2.0 * self.g * self.radius / (1.0 + 4.0 * self.mu**2)
            return factor * ((1.0 - 2.0 * self.mu**2) * np.cos(angle) - 3.0 * self.mu * np.sin(angle))

        return (speed0**2 - forced(0.0)) * np.exp(-2.0 * self.mu * angle) + forced(angle)


# Values from `speed_squared` for mass 1, R = 1, mu = 0.25, g = 9.81 and a start at the bottom.  Times are
# quadratures of R / speed.  Start at 4 m/s: angle and rate after 0.2 s.  Start at 12 m/s: time of one loop
# and speed after it.
ANGLE_AT_0P2, RATE_AT_0P2 = 0.6446178976906048, 2.354981131780303
LOOP_TIME, SPEED_AFTER_LOOP = 1.201799564074831, 4.400375469951236


def show(name, paper, computed):
    paper, computed = np.atleast_1d(paper), np.atleast_1d(computed)
    for i, (p, c) in enumerate(zip(paper, computed, strict=True)):
        print(f"{name if i == 0 else '':24s} {p + 0.0:20.14f} {c + 0.0:20.14f} {abs(p - c):10.1e}")


def main():
    ring = Ring(mass=2.5, radius=0.8)
    q, v = ring.at(0.9, 3.0)
    A, b = ring.rows(0.0, q, v)
    h = ring.mu * abs(ring.normal(q, v))
    solution = pn.solve(ring.mass_matrix, ring.given, A, b, ring.rubbing(h, v))
    unit = pn.solve(ring.mass_matrix, np.zeros(2), A, [1.0])  # M^(1/2) a = J B^T for b = 1
    ideal, nonideal = ring.paper_force(q, v, h)

    print(f"{'Example (b)':24s} {'paper':>20s} {'computed':>20s} {'difference':>10s}")
    show("A V = 0", np.zeros(1), (A @ ring.paper_null_space(q))[0])
    show("J B^T, Eq. (67)", ring.paper_inverse(q), np.sqrt(ring.mass) * unit.a)
    show("F_ideal, Eq. (69)", ideal, solution.F_ideal)
    show("F_nonideal, Eq. (69)", nonideal, solution.F_nonideal)

    ring = Ring()
    q0, v0 = ring.at(0.0, 4.0)
    run = pn.simulate(ring.scene(), 0.2, q=q0, v=v0, rtol=1e-11, atol=1e-12)
    show("4 m/s: angle at 0.2 s", ANGLE_AT_0P2, np.arctan2(run.q[-1, 0], -run.q[-1, 1]))
    show("4 m/s: rate at 0.2 s", RATE_AT_0P2, np.linalg.norm(run.v[-1]) / ring.radius)
    q0, v0 = ring.at(0.0, 12.0)
    run = pn.simulate(ring.scene(), LOOP_TIME, q=q0, v=v0, rtol=1e-11, atol=1e-12)
    show("12 m/s: x after a loop", 0.0, run.q[-1, 0])
    show("12 m/s: speed after it", SPEED_AFTER_LOOP, np.linalg.norm(run.v[-1]))


if __name__ == "__main__":
    main()
