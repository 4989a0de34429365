"""Example (a) of the paper: a particle under a nonlinear nonholonomic constraint and velocity-power drag.

A unit mass at (x, y, z) has the constraint ydot = z^2 xdot + alpha g(x, t) with a nonideal constraint force
along the velocity.  The script prints the paper's formulas beside the values from `pn.solve`.  Then it
simulates the particle as a scene and compares the motion with a closed form.

Run: python oracles/paper_a_particle.py
Source: Udwadia, Kalaba, Phohomsiri, J. Appl. Mech. 71 (2004), Example (a), Eqs. (51)-(59).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

import pin_nonideal as pn


@dataclass(frozen=True)
class Particle:
    """Particle with the formulas of the paper; q = (x, y, z) [m], v = (xdot, ydot, zdot) [m/s].

    Args:
        alpha: factor of the rheonomic term of the constraint, g(x, t) = sin(x - t).
        a0: drag coefficient.
        beta: half of the exponent of the speed in the drag.
        push: factor of the applied force (f_x, f_y, f_z) [N].
    """

    alpha: float = 0.3
    a0: float = 0.4
    beta: float = 1.0
    push: float = 2.0

    M = np.eye(3)

    def given(self, t, q, v):
        """Return the applied force (f_x, f_y, f_z) [N]."""
        x, y, z = q
        return self.push * np.array([z - x, np.sin(t) - y, x * y])

    def rate(self, t, q, v):
        """Return the velocity residual of the constraint."""
        return np.array([v[1] - q[2] ** 2 * v[0] - self.alpha * np.sin(q[0] - t)])

    def rows(self, t, q, v, data=None):
        """Return A and b of A a = b, the time derivative of the constraint."""
        x, _, z = q
        g_x, g_t = np.cos(x - t), -np.cos(x - t)
        A = np.array([[-(z**2), 1.0, 0.0]])  # Eq. (52)
        b = np.array([2.0 * z * v[2] * v[0] + self.alpha * (g_x * v[0] + g_t)])  # Eq. (53)
        return A, b

    def drag(self, t, q, v, reactions=None):
        """Return C, with the virtual work of a force against the velocity, Eq. (57)."""
        return -self.a0 * (v @ v) ** (self.beta - 0.5) * v  # Eq. (58)

    def paper_null_space(self, q, k1, k2):
        """Return V, for any k1 != k2."""
        z = q[2]
        return np.array([[1.0, 1.0], [z**2, z**2], [k1, k2]])  # Eq. (55)

    def paper_inverse(self, q):
        """Return J B^T, the Moore-Penrose inverse of B."""
        z = q[2]
        return np.array([-(z**2), 1.0, 0.0]) / (1.0 + z**4)  # Eq. (56)

    def paper_force(self, t, q, v):
        """Return the ideal and the nonideal constraint force, Eq. (59)."""
        (xd, yd, zd), z = v, q[2]
        f_x, f_y, _ = self.given(t, q, v)
        _, b = self.rows(t, q, v)
        along = xd + z**2 * yd
        ideal = (b[0] + z**2 * f_x - f_y) / (1.0 + z**4) * np.array([-(z**2), 1.0, 0.0])
        nonideal = (
            -self.a0
            * (v @ v) ** (self.beta - 0.5)
            / (1.0 + z**4)
            * np.array([along, z**2 * along, zd * (1.0 + z**4)])
        )
        return ideal, nonideal

    def start(self, q, direction):
        """Return the velocity at t = 0 that satisfies the constraint, from its x and z components."""
        xd, zd = direction
        return np.array([xd, q[2] ** 2 * xd + self.alpha * np.sin(q[0]), zd])

    def scene(self):
        """Return the particle as a scene."""
        model = pin.Model()
        model.name = "particle"
        model.gravity.linear = np.zeros(3)
        joint = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "position")
        model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.zeros((3, 3))), pin.SE3.Identity())
        return pn.Scene(
            model,
            constraints=[pn.UserConstraint(self.rows, 1, rate=self.rate, name="steering")],
            laws=[pn.UserLaw(self.drag, reaction=None, name="drag")],
            forces=[pn.UserForce(self.given)],
        )

    def coasting(self, t, q0, v0):
        """Return speed and height of the free particle (alpha = 0, no applied force, beta = 1) at times t.

        Only the drag changes the energy, so d|v|/dt = -a0 |v|^2.  The ratio of zdot to the speed is constant.
        """
        speed0 = np.linalg.norm(v0)
        travelled = np.log1p(self.a0 * speed0 * t) / self.a0
        return speed0 / (1.0 + self.a0 * speed0 * t), q0[2] + v0[2] / speed0 * travelled


def show(name, paper, computed):
    paper, computed = np.atleast_1d(paper), np.atleast_1d(computed)
    for i, (p, c) in enumerate(zip(paper, computed, strict=True)):
        print(f"{name if i == 0 else '':24s} {p + 0.0:20.14f} {c + 0.0:20.14f} {abs(p - c):10.1e}")


def main():
    particle, t = Particle(), 0.7
    q, v = np.array([0.3, -0.2, 0.9]), np.array([1.1, 0.4, -0.6])
    A, b = particle.rows(t, q, v)
    solution = pn.solve(particle.M, particle.given(t, q, v), A, b, particle.drag(t, q, v))
    unit = pn.solve(particle.M, np.zeros(3), A, [1.0])  # a = J B^T for b = 1: here M is the unit matrix
    ideal, nonideal = particle.paper_force(t, q, v)

    print(f"{'Example (a)':24s} {'paper':>20s} {'computed':>20s} {'difference':>10s}")
    for k1, k2 in [(0.0, 1.0), (-2.0, 5.0)]:
        show(f"A V = 0, k = {k1:g}, {k2:g}", np.zeros(2), (A @ particle.paper_null_space(q, k1, k2))[0])
    show("J B^T, Eq. (56)", particle.paper_inverse(q), unit.a)
    show("F_ideal, Eq. (59)", ideal, solution.F_ideal)
    show("F_nonideal, Eq. (59)", nonideal, solution.F_nonideal)

    coasting = Particle(alpha=0.0, push=0.0)
    q0 = np.array([0.0, 0.0, -0.8])
    v0 = coasting.start(q0, (1.5, 0.9))
    run = pn.simulate(coasting.scene(), 3.0, q=q0, v=v0, rtol=1e-11, atol=1e-12)
    speed, height = coasting.coasting(3.0, q0, v0)
    show("coasting: speed at 3 s", speed, np.linalg.norm(run.v[-1]))
    show("coasting: z at 3 s", height, run.q[-1, 2])


if __name__ == "__main__":
    main()
