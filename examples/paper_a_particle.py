"""Particle under a nonlinear nonholonomic constraint with drag: example (a) of the paper."""

import matplotlib.pyplot as plt
import numpy as np
import pinocchio as pin

import pin_nonideal as pn

alpha, a0 = 0.3, 0.4  # ydot = z^2 xdot + alpha sin(x - t), drag a0 |v| v
model = pin.Model()
model.gravity.linear = np.zeros(3)
joint = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "position")
model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.zeros((3, 3))), pin.SE3.Identity())


def rate(t, q, v):
    return np.array([v[1] - q[2] ** 2 * v[0] - alpha * np.sin(q[0] - t)])


def rows(t, q, v, data=None):
    b = 2.0 * q[2] * v[2] * v[0] + alpha * np.cos(q[0] - t) * (v[0] - 1.0)
    return np.array([[-(q[2] ** 2), 1.0, 0.0]]), np.array([b])  # Eqs. (52), (53)


drag = pn.UserLaw(lambda t, q, v, r: -a0 * np.linalg.norm(v) * v, reaction=None, name="drag")  # Eq. (58)
scene = pn.Scene(model, constraints=[pn.UserConstraint(rows, 1, rate=rate, name="steering")], laws=[drag])
run = pn.simulate(scene, 3.0, [0.3, -0.2, 0.9], [1.1, 0.98, -0.6], output_dt=0.02, record="forces")
for t, q, v, ideal, nonideal in zip(run.t, run.q, run.v, run.F_ideal, run.F_nonideal, strict=True):
    A, b = rows(t, q, v)
    C, n = -a0 * np.linalg.norm(v) * v, A[0] / (A[0] @ A[0])
    assert np.allclose([ideal, nonideal], [b[0] * n, C - (A[0] @ C) * n])  # Eq. (59)
figure, (path, forces) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
path.plot(run.q[:, 0], run.q[:, 1], label="path")
for force, color, name in ((run.F_ideal, "C0", "ideal"), (run.F_nonideal, "C1", "nonideal")):
    path.quiver(*run.q[::10, :2].T, *force[::10, :2].T, color=color, width=0.004, label=name)
    forces.plot(run.t, np.linalg.norm(force, axis=1), color=color, label=f"{name} [N]")
path.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
forces.set(xlabel="t [s]")
path.legend(), forces.legend()
figure.savefig("paper_a_particle.png")
