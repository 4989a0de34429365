"""Crank, rod and piston at a prescribed speed: motion and force against closed forms."""

import numpy as np
import pinocchio as pin

import pin_nonideal as pn

r, L, omega = 0.05, 0.16, 300.0  # crank [m], rod [m], speed [rad/s]
model, one = pin.Model(), pin.SE3.Identity()
crank = model.addJoint(0, pin.JointModelRY(), one, "crank")
rod = model.addJoint(crank, pin.JointModelRY(), pin.SE3(np.eye(3), np.array([r, 0, 0])), "rod")
piston = model.addJoint(0, pin.JointModelPX(), one, "piston")
for joint, mass, lever, inertia in (
    (crank, 1.2, 0.0, 4e-3),
    (rod, 0.5, 0.4 * L, 2e-3),
    (piston, 0.4, 0.0, 1e-4),
):
    model.appendBodyToJoint(joint, pin.Inertia(mass, np.array([lever, 0, 0]), inertia * np.eye(3)), one)
end = pin.SE3(np.eye(3), np.array([L, 0, 0]))
model.addFrame(pin.Frame("rod end", rod, 0, end, pin.FrameType.OP_FRAME))
model.addFrame(pin.Frame("gudgeon", piston, 0, one, pin.FrameType.OP_FRAME))
pin_joint = pn.PointAnchor("rod end", "gudgeon", axes="xz", name="gudgeon pin")
flywheel = pn.PrescribedMotion("crank", pn.polynomial([0.0, omega]), name="flywheel")
scene = pn.Scene(model, constraints=[pin_joint, flywheel], q0={"piston": r + L}, name="engine")
run = pn.simulate(scene, 0.05, v={"crank": omega}, record=("a", "forces"), output_dt=1e-4)

# The piston's closed form, x = r cos + sqrt(L^2 - r^2 sin^2), and Newton's law for it alone.
angle, motion = omega * run.t, run.joint("piston")
root = np.sqrt(L**2 - (r * np.sin(angle)) ** 2)
assert np.abs(motion.q - (r * np.cos(angle) + root)).max() < 1e-10
slope = -r * np.sin(angle) - r**2 * np.sin(angle) * np.cos(angle) / root
assert np.abs(motion.v - omega * slope).max() < 1e-8 * omega
along = run.force("gudgeon pin")[:, 0]  # on the rod, so its opposite acts on the piston
assert np.abs(-along - 0.4 * motion.a).max() < 1e-6 * np.abs(along).max()
pn.plot(run, "engine.png", what=["piston", ("Force of the pin [N]", {"along the cylinder": along})])
