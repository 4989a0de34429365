"""An evaluation takes no memory from the heap: counted by a malloc that is loaded before the C library's."""

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

import pin_nonideal as pn

allocations = ctypes.c_long.in_dll(ctypes.CDLL(sys.argv[1]), "allocations")


def taken(runner, q, v, count):
    before = allocations.value
    runner.time_evaluations(q, v, 0.0, count)
    return allocations.value - before


found = {}
for case in sys.argv[2:]:
    name, terms = case.split(":")
    scene = pn.load(name, terms=terms)
    runner = scene._compiled.program.runner()
    q, v = scene.initial_state()
    if name == "panda_friction":  # one joint at rest sticks
        v[0] = 0.0
    taken(runner, q, v, 10)
    found[case] = [taken(runner, q, v, count) for count in (10, 1010)]
found["the counter itself"] = [0, allocations.value]
print(json.dumps(found))
"""

ROBOTS = ["four_bar", "delta", "solo12_standing", "panda_friction", "n_four_bar", "rolling_disk", "five_bar"]
NAMES = [f"{name}:{terms}" for terms in ("core", "pinocchio") for name in ROBOTS]


@pytest.fixture(scope="module")
def counts(tmp_path_factory):
    """Allocations of 10 and of 1010 evaluations, by robot."""
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
