"""Evaluations allocate no heap memory, counted by a preloaded malloc."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys

import pytest

COUNTER = r"""
#include <stddef.h>
#include <errno.h>

extern void *__libc_malloc(size_t);
extern void *__libc_calloc(size_t, size_t);
extern void *__libc_realloc(void *, size_t);
extern void *__libc_memalign(size_t, size_t);

long allocations = 0;

static void count(void) { __atomic_fetch_add(&allocations, 1, __ATOMIC_RELAXED); }

void *malloc(size_t n) { count(); return __libc_malloc(n); }
void *calloc(size_t n, size_t size) { count(); return __libc_calloc(n, size); }
void *realloc(void *old, size_t n) { count(); return __libc_realloc(old, n); }
void *memalign(size_t align, size_t n) { count(); return __libc_memalign(align, n); }
void *aligned_alloc(size_t align, size_t n) { count(); return __libc_memalign(align, n); }
int posix_memalign(void **out, size_t align, size_t n) {
    count();
    *out = __libc_memalign(align, n);
    return *out ? 0 : ENOMEM;
}
"""

SCRIPT = """
import ctypes, json, sys

import numpy as np
import pinocchio as pin

import pin_nonideal as pn
from pin_nonideal._core import ConeSolver

allocations = ctypes.c_long.in_dll(ctypes.CDLL(sys.argv[1]), "allocations")


def taken(runner, q, v, count):
    before = allocations.value
    runner.time_evaluations(q, v, 0.0, count)
    return allocations.value - before


def deep_ring(terms, n=50):
    model, parent, link = pin.Model(), 0, np.array([0.0, 0.0, 0.1])
    for i in range(n):
        place = pin.SE3(pin.rpy.rpyToMatrix(0.0, 6.28 / n, 0.0), link)
        parent = model.addJoint(parent, pin.JointModelRY(), place, f"j{i}")
        model.appendBodyToJoint(parent, pin.Inertia.Random(), pin.SE3.Identity())
    model.addFrame(pin.Frame("tip", parent, 0, pin.SE3(np.eye(3), link), pin.FrameType.OP_FRAME))
    wrench, drag = pn.Wrench("tip", [1.0] * 6), pn.Drag("tip", 0.1, 1.0)
    anchor = pn.PointAnchor("tip", None)
    return pn.Scene(model, constraints=[anchor], forces=[wrench], laws=[drag], terms=terms)


found = {}
for case in sys.argv[2:]:
    name, terms = case.split(":")
    scene = deep_ring(terms) if name == "deep_ring" else pn.load(name, terms=terms)
    runner = scene._compiled.program.runner()
    q, v = scene.initial_state()
    if name == "panda_friction":  # one joint at rest sticks
        v[0] = 0.0
    taken(runner, q, v, 10)
    found[case] = [taken(runner, q, v, count) for count in (10, 1010)]
rng = np.random.default_rng(0)
solver = ConeSolver()


def solved(count, warm):
    before = allocations.value
    solver.again(count, warm)
    return allocations.value - before


for k in range(6):  # a box on its corners: contacts that open, stick and slide, and share a load
    axes = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    corners = [np.array([x, y, -0.1]) for x in (0.2, -0.2) for y in (0.1, -0.1)]
    H = np.vstack([np.hstack([axes, np.cross(corner, axes)]) for corner in corners])
    push = rng.standard_normal(6) * 4.0 - np.array([0.0, 0.0, 9.81, 0.0, 0.0, 0.0])
    solver.solve(H @ H.T, H @ push, [3] * 4, [0.5] * 4, 4, None)
    solved(1, False)
    solved(1, True)
    for warm in (False, True):
        found[f"cones {k} {warm}"] = [solved(10, warm), solved(1010, warm)]


def stepped(scene, steps, **state):  # a run of time stepping with a sample at both ends
    before, length = allocations.value, steps * 1e-3
    options = {"method": "moreau", "dt": 1e-3, "output_dt": length, "progress": False}
    pn.simulate(scene, length, **options, **state)
    return allocations.value - before


def rubbing_humanoid():  # on two feet, held by a controller, with dry friction in all joints
    talos = pn.load("talos")
    model = talos.model
    scene = pn.Scene(
        model,
        constraints=[pn.FrameAnchor("left_sole_link"), pn.FrameAnchor("right_sole_link")],
        laws=[pn.JointFriction(joint, coulomb=20.0) for joint in list(model.names)[2:]],
        actuation=pn.HoldPosition(kp=500.0, kd=20.0),
        q0=talos.q0,
    )
    bent = np.concatenate([np.zeros(6), 0.02 * np.random.default_rng(3).standard_normal(model.nv - 6)])
    return scene, *scene.project(pin.integrate(model, scene.q0, bent), np.zeros(model.nv))


solo = pn.load("solo12_dropped")
landed = pn.simulate(solo, 1.5, method="moreau", dt=1e-3, output_dt=1.5, progress=False)
humanoid, q, v = rubbing_humanoid()
arm = pn.load("panda_friction")
for name, scene, state in [
    ("standing contacts", solo, {"q": landed.q[-1], "v": landed.v[-1]}),
    ("landing contacts", solo, {}),
    ("friction in joints", arm, {}),
    ("friction beside constraints", humanoid, {"q": q, "v": v}),
]:
    stepped(scene, 500, **state)
    found[name] = [min(stepped(scene, steps, **state) for _ in range(3)) for steps in (100, 400)]
found["the counter itself"] = [0, allocations.value]
print(json.dumps(found))
"""

ROBOTS = ["four_bar", "delta", "solo12_standing", "panda_friction", "n_four_bar", "rolling_disk", "five_bar"]
ROBOTS.append("deep_ring")
NAMES = [f"{name}:{terms}" for terms in ("core", "pinocchio") for name in ROBOTS]
STEPS = ["standing contacts", "landing contacts", "friction in joints", "friction beside constraints"]
CONES = [f"cones {k} {warm}" for k in range(6) for warm in (False, True)]


@pytest.fixture(scope="module")
def counts(tmp_path_factory):
    """Return the allocations of 10 and of 1010 evaluations, by robot."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None or not sys.platform.startswith("linux"):
        pytest.skip("needs a C compiler and glibc")
    folder = tmp_path_factory.mktemp("counter")
    source, library = folder / "counter.c", folder / "counter.so"
    source.write_text(COUNTER)
    subprocess.run([compiler, "-shared", "-fPIC", "-O1", str(source), "-o", str(library)], check=True)
    script = folder / "count.py"
    script.write_text(SCRIPT)
    run = subprocess.run(
        [sys.executable, str(script), str(library), *NAMES],
        env={**os.environ, "LD_PRELOAD": str(library)},
        cwd=folder,
        capture_output=True,
        text=True,
    )
    assert run.returncode == 0, run.stderr
    return json.loads(run.stdout)


def test_the_counter_counts(counts):
    assert counts["the counter itself"][1] > 1000


@pytest.mark.parametrize("name", NAMES)
def test_an_evaluation_allocates_nothing(counts, name):
    few, many = counts[name]
    assert many - few == 0, f"{(many - few) / 1000} allocations an evaluation"


@pytest.mark.parametrize("name", CONES)
def test_a_contact_problem_allocates_nothing(counts, name):
    few, many = counts[name]
    assert many - few == 0, f"{(many - few) / 1000} allocations a solve"


@pytest.mark.parametrize("name", STEPS)
def test_a_step_of_time_stepping_allocates_nothing(counts, name):
    few, many = counts[name]
    between = 0.1  # per step: the interpreter allocates in its check for Ctrl-C every few steps
    assert many - few < between * 300, f"{(many - few) / 300} allocations a step"
