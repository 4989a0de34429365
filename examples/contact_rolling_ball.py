"""Billiard ball with side spin, which slides along a parabola and then rolls straight."""

import coal
import matplotlib.pyplot as plt
import numpy as np
import pinocchio as pin

import pin_nonideal as pn

g, r, mu, v, w = 9.81, 0.0285, 0.2, np.array([2.0, 0.0, 0.0]), np.array([-30.0, 10.0, 0.0])
model = pin.Model()
pn.free_body(model, "ball", coal.Sphere(r), mass=0.17)
cloth = pn.PointContact("ball", mu=mu, radius=r, name="cloth")
scene = pn.Scene(model, contacts=[cloth], q0=[0.0, 0.0, r, 0.0, 0.0, 0.0, 1.0], v0=[*v, *w])
run = pn.simulate(scene, 1.0, rtol=1e-11, atol=1e-12, output_dt=0.005, record="forces")

slip = v + np.cross(w, [0.0, 0.0, -r])
rolls = 2.0 * np.linalg.norm(slip) / (7.0 * mu * g)  # start of rolling [s]
place = v * rolls - 0.5 * mu * g * slip / np.linalg.norm(slip) * rolls**2
stick = next(event.time for event in run.events if event.kind == "stick")
at = run.q[np.argmin(np.abs(run.t - stick)), :2]
velocity = pin.Quaternion(run.q[-1, 3:7]).toRotationMatrix() @ run.v[-1, :3]
print("rolls from [s]", stick, "at [m]", at, "with [m/s]", velocity)
assert abs(stick - rolls) < 1e-9
assert np.abs(at - place[:2]).max() < 1e-9
assert np.abs(velocity - v + 2.0 / 7.0 * slip)[:2].max() < 1e-9
figure, axes = plt.subplots(figsize=(7, 3), layout="constrained")
axes.plot(run.q[:, 0], run.q[:, 1], label="path")
force = run.contact_forces["cloth"][::10]
axes.quiver(run.q[::10, 0], run.q[::10, 1], force[:, 0], force[:, 1], color="C1", label="friction")
axes.set(xlabel="x [m]", ylabel="y [m]")
axes.legend()
figure.savefig("contact_rolling_ball.png")
