"""Pile of twelve balls that fall into a box with rough walls and come to rest."""

import coal
import numpy as np
import pinocchio as pin

import pin_nonideal as pn

radius, wall, mu = 0.05, 0.13, 0.4
walls = {"floor": "z", "west": (1, 0, 0), "east": (-1, 0, 0), "south": (0, 1, 0), "north": (0, -1, 0)}
# Balls roll without resistance, so a ball of another pile may roll on.
model, shapes, rng = pin.Model(), pin.GeometryModel(), np.random.default_rng(17)
for name, normal in walls.items():
    height = 0.0 if name == "floor" else -wall
    shapes.addGeometryObject(pn.ground(name, normal=normal, height=height))
for k in range(12):
    grid = np.array([k % 2 - 0.5, k // 2 % 2 - 0.5, k // 4 + 0.7])
    place = 2.4 * radius * grid + 0.1 * radius * rng.uniform(-1.0, 1.0, 3)
    pn.free_body(model, f"ball {k}", coal.Sphere(radius), 1000.0, collision_model=shapes, place=place)
contacts = pn.geometry_contacts(model, shapes, mu=mu)
scene = pn.Scene(model, contacts=contacts, collision_model=shapes, name="pile")
run = pn.simulate(scene, 2.0, method="moreau", dt=1e-3, record=("energy", "forces"), output_dt=0.01)

starts = np.array([model.jointPlacements[k + 1].translation for k in range(12)])
centers = starts + run.q[-1].reshape(12, 7)[:, :3]
gaps = np.linalg.norm(centers[:, None] - centers, axis=-1) + 1e3 * np.eye(12) - 2.0 * radius
weight = pin.computeTotalMass(model) * 9.81
up = sum(f[:, 2] for name, f in run.contact_forces.items() if name.split(" on ")[-1] in walls)
total = run.energy["kinetic"] + run.energy["potential"]
speeds = np.linalg.norm(run.v[-1].reshape(12, 6)[:, :3], axis=1)
print("speed at the end", speeds.max(), "least gap [m]", gaps.min(), "load over weight", up[-1] / weight)
assert speeds.max() < 1e-9
assert gaps.min() > -1e-4
assert np.abs(centers[:, :2]).max() < wall - radius + 1e-4
assert abs(up[-1] - weight) < 1e-9 * weight
assert (np.diff(total) < 1e-6 * total[0]).all()
pn.plot(run, "contact_pile.png", what=[("Upward force of floor and walls [N]", {"force": up}), "energy"])
