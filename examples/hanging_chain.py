"""Chain of twelve links between two hooks: state of rest against the statics of a chain."""

import matplotlib.pyplot as plt
import numpy as np
import pinocchio as pin

import pin_nonideal as pn

n, link, mass, width = 12, 0.1, 0.2, 0.8
model, joint = pin.Model(), 0
for k in range(n):
    place = pin.SE3(np.eye(3), np.array([link if k else 0.0, 0, 0]))
    joint = model.addJoint(joint, pin.JointModelRY(), place, f"link {k}")
    rod = pin.Inertia(mass, np.array([link / 2, 0, 0]), mass * link**2 / 12 * np.diag([1e-3, 1, 1]))
    model.appendBodyToJoint(joint, rod, pin.SE3.Identity())
for name, parent, x in (("end", joint, link), ("hook", 0, width)):
    place = pin.SE3(np.eye(3), np.array([x, 0, 0]))
    model.addFrame(pin.Frame(name, parent, 0, place, pin.FrameType.OP_FRAME))

hook, q0 = pn.PointAnchor("end", "hook", axes="xz", name="hook"), [1.2] + [0.0] * 5 + [-2.0] + [0.0] * 5
rest = pn.equilibrium(pn.Scene(model, constraints=[hook], q0=q0, name="chain"))
assert rest.stable

# Each joint carries the horizontal force H and the weight beyond it: slopes grow by mass g / H per link.
down = np.cumsum(rest.q)  # angle of each link below the horizontal
H = abs(rest.lam[0])
expected = mass * 9.81 / H * ((n - 1) / 2 - np.arange(n))
assert np.abs(np.tan(down) - expected).max() < 1e-9
assert abs(link * np.cos(down).sum() - width) < 1e-12
figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
axes.plot(np.cumsum([0, *link * np.cos(down)]), -np.cumsum([0, *link * np.sin(down)]), "o-")
axes.set(xlabel="x [m]", ylabel="z [m]", aspect="equal", title=f"horizontal force {H:.2f} N")
figure.savefig("hanging_chain.png")
