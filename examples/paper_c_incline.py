"""Block on a vibrating incline with Coulomb friction: example (c) of the paper."""

import matplotlib.pyplot as plt
import numpy as np
import pinocchio as pin

import pin_nonideal as pn

mass, alpha, mu, beta, omega, g = 1.0, np.pi / 6, 0.3, 0.002, 40.0, 9.81  # y points downwards
slope, sine = np.array([1.0, np.tan(alpha)]), pn.sinusoid(beta, omega)
model = pin.Model()
model.gravity.linear = np.array([0.0, g, 0.0])
x = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
y = model.addJoint(x, pin.JointModelPY(), pin.SE3.Identity(), "y")
model.appendBodyToJoint(y, pin.Inertia(mass, np.zeros(3), np.zeros((3, 3))), pin.SE3.Identity())
n = np.array([-np.tan(alpha), 1.0])
plane = pn.UserConstraint(
    lambda t, q, v, data: (n[None, :].copy(), np.array([-sine(t)[2]])),  # Eq. (72)
    1,
    residual=lambda t, q: np.array([n @ q + sine(t)[0]]),
    rate=lambda t, q, v: np.array([n @ v + sine(t)[1]]),
)
friction = pn.UserLaw(  # mu |F_ideal| uphill, Eqs. (77), (78); |F_ideal| = |lam| / cos(alpha)
    lambda t, q, v, reactions: -mu * abs(reactions.lam[0]) * slope, reaction="ideal"
)
v0 = 0.1 * np.cos(alpha) * slope - [0.0, beta * omega]
scene = pn.Scene(model, constraints=[plane], laws=[friction], q0=[0.0, 0.0], v0=v0, name="incline")
run = pn.simulate(scene, 1.0, rtol=1e-10, atol=1e-11, output_dt=0.005, record="forces")
fall = g * run.t**2 / 2 + beta * np.sin(omega * run.t) - beta * omega * run.t
expected = 0.1 * run.t + (np.sin(alpha) - mu * np.cos(alpha)) * fall
assert np.abs(run.q[:, 0] / np.cos(alpha) - expected).max() < 1e-8
figure, (path, forces) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
path.plot(*run.q.T, label="path")
for force, color, name in ((run.F_ideal, "C0", "ideal"), (run.F_nonideal, "C1", "nonideal")):
    path.quiver(*run.q[::20].T, *force[::20].T, color=color, angles="xy", width=0.004, label=name)
    forces.plot(run.t, np.linalg.norm(force, axis=1), color=color, label=f"{name} [N]")
path.set(xlabel="x [m]", ylabel="y [m], downwards", aspect="equal", ylim=path.get_ylim()[::-1])
forces.set(xlabel="t [s]")
path.legend(), forces.legend()
figure.savefig("paper_c_incline.png")
