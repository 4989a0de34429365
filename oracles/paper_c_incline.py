"""Example (c) of the paper: a block on a vertically vibrating incline with Coulomb friction.

The script prints the paper's formulas beside the values from `pn.solve`.  Then it simulates the block as a
scene with friction from the size of the ideal constraint force, and compares the motion with the closed form.

Run: python oracles/paper_c_incline.py
Source: Udwadia, Kalaba, Phohomsiri, J. Appl. Mech. 71 (2004), Example (c), Eqs. (71)-(81).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

import pin_nonideal as pn


@dataclass(frozen=True)
class Incline:
    """Block on y = x tan(alpha) - beta sin(omega t), **y downwards**; q = (x, y) [m], v = dq/dt.

    Args:
        mass: mass of the block [kg].
        alpha: inclination [rad], between 0 and pi / 2.
        mu: coefficient of friction.
        beta: amplitude of the plane's vertical motion [m].
        omega: angular frequency of the plane [rad/s].
        g: gravity [m/s^2].
    """

    mass: float = 1.0
    alpha: float = np.pi / 6.0
    mu: float = 0.3
    beta: float = 0.002
    omega: float = 40.0
    g: float = 9.81

    @property
    def mass_matrix(self):
        """Return M [kg]."""
        return self.mass * np.eye(2)

    @property
    def given(self):
        """Return F [N], the force of gravity."""
        return np.array([0.0, self.mass * self.g])  # M a with the a of Eq. (71)

    @property
    def slope(self):
        """Return the direction [1, tan(alpha)] of the plane."""
        return np.array([1.0, np.tan(self.alpha)])

    def load(self, t):
        """Return the effective gravity g - beta omega^2 sin(omega t) [m/s^2]; not negative in contact."""
        return self.g - self.beta * self.omega**2 * np.sin(self.omega * t)

    def residual(self, t, q):
        """Return the depth below the plane [m]."""
        return np.array([q[1] - q[0] * np.tan(self.alpha) + self.beta * np.sin(self.omega * t)])  # Eq. (2)

    def rate(self, t, q, v):
        """Return the rate of the residual."""
        return np.array([v[1] - v[0] * np.tan(self.alpha) + self.beta * self.omega * np.cos(self.omega * t)])

    def rows(self, t, q, v, data=None):
        """Return A and b of A a = b."""
        A = np.array([[-np.tan(self.alpha), 1.0]])
        return A, np.array([self.beta * self.omega**2 * np.sin(self.omega * t)])  # Eq. (72)

    def friction(self, size, v):
        """Return C from |F_ideal|, against the motion along the plane; at rest, against downhill motion."""
        s = -1.0 if v[0] < 0.0 else 1.0
        return -self.mu * size * np.cos(self.alpha) * self.slope * s  # Eqs. (77), (78)

    def from_reactions(self, t, q, v, reactions):
        """Return C with |F_ideal| = |lam| |A| and |A| = 1 / cos(alpha)."""
        return self.friction(abs(reactions.lam[0]) / np.cos(self.alpha), v)

    def paper_null_space(self, delta):
        """Return V, for any delta != 0."""
        return np.sqrt(self.mass) * delta * self.slope[:, None]  # Eq. (73)

    def paper_inverse(self):
        """Return J B^T, the Moore-Penrose inverse of B."""
        return np.sqrt(self.mass) * np.cos(self.alpha) ** 2 * np.array([-np.tan(self.alpha), 1.0])  # Eq. (75)

    def paper_ideal(self, t):
        """Return F_ideal."""
        weight = self.mass * np.cos(self.alpha) ** 2 * self.load(t)
        return weight * np.array([np.tan(self.alpha), -1.0])  # Eq. (76)

    def paper_size(self, t):
        """Return the norm of F_ideal."""
        return self.mass * np.cos(self.alpha) * abs(self.load(t))  # Eq. (79)

    def paper_nonideal(self, t, v):
        """Return F_nonideal."""
        s = np.sign(v[0])
        return -self.mu * self.mass * np.cos(self.alpha) ** 2 * abs(self.load(t)) * self.slope * s  # Eq. (80)

    def scene(self):
        """Return the block as a scene."""
        model = pin.Model()
        model.name = "incline"
        model.gravity.linear = np.array([0.0, self.g, 0.0])
        x = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
        y = model.addJoint(x, pin.JointModelPY(), pin.SE3.Identity(), "y")
        model.appendBodyToJoint(y, pin.Inertia(self.mass, np.zeros(3), np.zeros((3, 3))), pin.SE3.Identity())
        q0, v0 = self.at(0.0, 0.0)
        return pn.Scene(
            model,
            constraints=[
                pn.UserConstraint(self.rows, 1, residual=self.residual, rate=self.rate, name="plane")
            ],
            laws=[pn.UserLaw(self.from_reactions, reaction="ideal", name="friction")],
            q0=q0,
            v0=v0,
        )

    def at(self, s, speed):
        """Return the state at t = 0, s [m] down the plane with a speed [m/s] relative to the plane."""
        down = np.cos(self.alpha) * self.slope
        return s * down, speed * down - np.array([0.0, self.beta * self.omega])

    def along(self, q):
        """Return the downhill distance of a position, or the downhill speed of a velocity."""
        return q[..., 0] / np.cos(self.alpha)

    def sliding(self, t, speed):
        """Return distance [m] and speed [m/s] down the plane at t, for a start at s = 0 with `speed`."""
        factor = np.sin(self.alpha) - self.mu * np.cos(self.alpha)
        lift = self.beta * np.sin(self.omega * t)
        lift_rate, lift_rate_0 = self.beta * self.omega * np.cos(self.omega * t), self.beta * self.omega
        distance = speed * t + factor * (self.g * t**2 / 2.0 + lift - lift_rate_0 * t)
        return distance, speed + factor * (self.g * t + lift_rate - lift_rate_0)


# Closed forms for alpha = pi / 6, g = 9.81.  Vibrating plane (mu 0.3, beta 0.002 m, omega 40 rad/s), start
# downhill at 0.1 m/s: distance and speed after 1 s, from `sliding`.
DISTANCE_AT_1, SPEED_AT_1 = 1.2592861690271027, 2.4242563711865315
# Plane at rest (mu 0.2), start uphill at 3 m/s: time and distance of the reversal, time and speed of the
# return, with the accelerations -g (sin + mu cos) and -g (sin - mu cos).
TURN_TIME, TURN_DISTANCE = 0.4542603826009345, 0.6813905739014018
RETURN_TIME, RETURN_SPEED = 1.1062503408749726, 2.0901873265201623


def show(name, paper, computed):
    paper, computed = np.atleast_1d(paper), np.atleast_1d(computed)
    for i, (p, c) in enumerate(zip(paper, computed, strict=True)):
        print(f"{name if i == 0 else '':28s} {p + 0.0:20.14f} {c + 0.0:20.14f} {abs(p - c):10.1e}")


def main():
    block, t = Incline(mass=3.0, alpha=0.4), 0.03
    v = np.array([0.5, 0.2])
    A, b = block.rows(t, None, v)
    ideal = pn.solve(block.mass_matrix, block.given, A, b).F_ideal
    size = np.linalg.norm(ideal)
    solution = pn.solve(block.mass_matrix, block.given, A, b, block.friction(size, v))
    unit = pn.solve(block.mass_matrix, np.zeros(2), A, [1.0])  # M^(1/2) a = J B^T for b = 1

    print(f"{'Example (c)':28s} {'paper':>20s} {'computed':>20s} {'difference':>10s}")
    show("A V = 0", np.zeros(1), (A @ block.paper_null_space(0.7))[0])
    show("J B^T, Eq. (75)", block.paper_inverse(), np.sqrt(block.mass) * unit.a)
    show("F_ideal, Eq. (76)", block.paper_ideal(t), solution.F_ideal)
    show("|F_ideal|, Eq. (79)", block.paper_size(t), size)
    show("F_nonideal, Eq. (80)", block.paper_nonideal(t, v), solution.F_nonideal)
    total = block.given + block.paper_ideal(t) + block.paper_nonideal(t, v)
    show("M a, Eq. (81)", total, block.mass * solution.a)

    block = Incline()
    q0, v0 = block.at(0.0, 0.1)
    run = pn.simulate(block.scene(), 1.0, q=q0, v=v0, rtol=1e-11, atol=1e-12)
    show("vibrating: distance at 1 s", DISTANCE_AT_1, block.along(run.q[-1]))
    show("vibrating: speed at 1 s", SPEED_AT_1, block.along(run.v[-1]))
    block = Incline(mu=0.2, beta=0.0)
    q0, v0 = block.at(0.0, -3.0)
    run = pn.simulate(block.scene(), RETURN_TIME, q=q0, v=v0, rtol=1e-11, atol=1e-12)
    show("thrown: s at the return", 0.0, block.along(run.q[-1]))
    show("thrown: speed at the return", RETURN_SPEED, block.along(run.v[-1]))


if __name__ == "__main__":
    main()
