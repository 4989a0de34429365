"""Bead on a rough ring in a vertical plane: example (b) of the paper."""

import matplotlib.pyplot as plt
import numpy as np
import pinocchio as pin

import pin_nonideal as pn

mass, R, mu, g, start = 1.0, 1.0, 0.25, 9.81, 12.0
model = pin.Model()
model.gravity.linear = np.array([0.0, -g, 0.0])
x = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
y = model.addJoint(x, pin.JointModelPY(), pin.SE3.Identity(), "y")
model.appendBodyToJoint(y, pin.Inertia(mass, np.zeros(3), np.zeros((3, 3))), pin.SE3.Identity())
ring = pn.UserConstraint(
    lambda t, q, v, data: (q[None, :].copy(), np.array([-(v @ v)])),  # Eqs. (63), (64)
    1,
    residual=lambda t, q: np.array([(q @ q - R**2) / 2]),
    rate=lambda t, q, v: np.array([q @ v]),
)
friction = pn.UserLaw(  # mu |N| against the velocity, Eq. (68)
    lambda t, q, v, reactions: -mu * abs(reactions.lam[0]) * R * v / np.linalg.norm(v), reaction="ideal"
)
scene = pn.Scene(model, constraints=[ring], laws=[friction], q0=[0.0, -R], v0=[start, 0.0], name="ring")
run = pn.simulate(scene, 1.2, rtol=1e-10, atol=1e-11, output_dt=0.01, record="forces")
# The equation of v^2 along the ring has constant coefficients: d(v^2)/da + 2 mu v^2 = -2 g R (sin + mu cos).
a = np.unwrap(np.arctan2(run.q[:, 0], -run.q[:, 1]))
f = 2 * g * R / (1 + 4 * mu**2) * ((1 - 2 * mu**2) * np.cos(a) - 3 * mu * np.sin(a))
assert np.abs((start**2 - f[0]) * np.exp(-2 * mu * a) + f - (run.v**2).sum(axis=1)).max() < 1e-7
figure, (path, forces) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
path.plot(*run.q.T, label="path")
for force, color, name in ((run.F_ideal, "C0", "ideal"), (run.F_nonideal, "C1", "nonideal")):
    path.quiver(*run.q[::6].T, *force[::6].T, color=color, width=0.004, label=name)
    forces.plot(run.t, np.linalg.norm(force, axis=1), color=color, label=f"{name} [N]")
path.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
forces.set(xlabel="t [s]")
path.legend(), forces.legend()
figure.savefig("paper_b_ring.png")
