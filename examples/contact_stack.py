"""Stack of six boxes, shifted to both sides in turn, which stands still to rounding."""

import coal
import numpy as np
import pinocchio as pin

import pin_nonideal as pn

edge, count, density = 0.2, 6, 500.0
model, shapes = pin.Model(), pin.GeometryModel()
shapes.addGeometryObject(pn.ground())
for k in range(count):
    place = (0.04 * (-1) ** k, 0.0, (k + 0.5) * edge)
    pn.free_body(model, f"box {k}", coal.Box(edge, edge, edge), density, collision_model=shapes, place=place)
below = ["ground", *(f"box {k}" for k in range(count - 1))]
contacts = [pn.GeometryContact(f"box {k}", below[k], mu=0.5) for k in range(count)]
scene = pn.Scene(model, contacts=contacts, collision_model=shapes, name="stack")
run = pn.simulate(scene, 0.5, method="moreau", dt=1e-3, record="forces", output_dt=0.01)

weight = density * edge**3 * 9.81
carried = [run.contact_forces[f"box {k} on {below[k]}"][:, 2] for k in range(count)]
drift = np.abs(run.q - run.q[0]).max()
print("drift [m]", drift, "load on the ground [N]", carried[0][-1], "weight of the stack [N]", count * weight)
assert drift < 1e-12
for k in range(count):
    assert np.abs(carried[k][1:] - (count - k) * weight).max() < 1e-9 * weight
pn.plot(
    run, "contact_stack.png", what=[("Loads below the boxes [N]", dict(zip(below, carried, strict=True)))]
)
