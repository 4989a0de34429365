"""Car on four driven wheels: acceleration on the plane in closed form, and a step of 3 cm."""

import coal
import numpy as np
import pinocchio as pin

import pin_nonideal as pn

radius, wheel, chassis, torque, step, edge = 0.1, 1.0, 8.0, 0.5, 0.03, 0.8
model, shapes = pin.Model(), pin.GeometryModel()
shapes.addGeometryObject(pn.ground())
place = pin.SE3(np.eye(3), np.array([edge + 1.0, 0.0, 0.5 * step]))
shapes.addGeometryObject(pin.GeometryObject("step", 0, 0, place, coal.Box(2.0, 1.0, step)))
body = coal.Box(0.5, 0.24, 0.1)
base = pn.free_body(model, "chassis", body, mass=chassis, collision_model=shapes, place=(0.0, 0.0, radius))
names = [f"{end} {side}" for end in ("front", "rear") for side in ("left", "right")]
across = pin.SE3(pin.rpy.rpyToMatrix(0.5 * np.pi, 0.0, 0.0), np.zeros(3))  # axis of the cylinder along y
for name in names:
    x, y = (0.2 if "front" in name else -0.2), (0.16 if "left" in name else -0.16)
    hub = model.addJoint(base, pin.JointModelRY(), pin.SE3(np.eye(3), np.array([x, y, 0.0])), name)
    model.appendBodyToJoint(hub, pin.Inertia.FromCylinder(wheel, radius, 0.05), across)
    shapes.addGeometryObject(pin.GeometryObject(name, hub, across, coal.Cylinder(radius, 0.05)))
contacts = [pn.GeometryContact(name, other, mu=0.8) for name in names for other in ("ground", "step")]
motors = pn.Table([0.0], {name: [torque] for name in names})
scene = pn.Scene(model, contacts=contacts, collision_model=shapes, actuation=motors, name="car")
run = pn.simulate(scene, 1.6, method="moreau", dt=1e-3, record="energy", output_dt=0.01)

x, z, turned = run.joint("chassis").q[:, 0], run.joint("chassis").q[:, 2], run.joint("front left").q
mass = chassis + 4.0 * wheel + 4.0 * 0.5 * wheel  # with the rotation of the wheels, I / R^2 = wheel / 2
a = 4.0 * torque / radius / mass
flat = x + 0.2 + np.sqrt(radius**2 - (radius - step) ** 2) < edge - 0.01
error = np.abs(x - 0.5 * a * run.t**2)[flat].max()
print("error of the distance [m]", error, "end of the run at [m]", x[-1], "height [m]", z[-1])
assert error < 1e-9
assert np.abs(x - radius * turned)[flat].max() < 1e-9
assert abs(z[-1] - step) < 1e-6
pn.plot(run, "contact_car.png", what=[("Position [m]", {"x": x, "z": z}), "energy"])
