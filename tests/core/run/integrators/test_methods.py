"""Integration methods are data: the stepping routine works with an external Butcher table."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from pin_nonideal.core_loader import core
from pin_nonideal.simulation.methods import METHODS, SCIPY

CORE = Path(__file__).parents[4] / "pin_nonideal" / "_core"
EIGEN = Path(pin.__file__).parents[4] / "include" / "eigen3"

# Bogacki and Shampine (1989), order 3 with an estimate of order 2, first same as last, on y'' = -y.
PROGRAM = r"""
#include "run/integrators/runge_kutta.hpp"
#include <cmath>
#include <cstdio>

static const double A[] = {0.5, 0.0, 0.75}, B[] = {2.0 / 9, 1.0 / 3, 4.0 / 9}, C[] = {0.0, 0.5, 0.75};
static const double E[] = {5.0 / 72, -1.0 / 12, -1.0 / 9, 1.0 / 8};

struct Oscillator {
    void derivative(double, const pn::VecX& y, pn::VecX& dy) const { dy[0] = y[1]; dy[1] = -y[0]; }
    void normalize(pn::VecX&) const {}
};

int main() {
    pn::Method method;
    method.order = 3;
    method.stages = 3;
    method.A = A;
    method.B = B;
    method.C = C;
    method.E = E;
    method.first_same_as_last = true;
    for (int steps : {20, 40, 80}) {
        pn::Step step(method.stages, method.rates(), 2, 2);
        pn::RungeKutta stepper(method, step);
        Oscillator system;
        pn::VecX middle(2);
        const auto norm = [](const pn::VecX& error, const pn::VecX&) { return error.norm(); };
        double estimate = 0.0, inside = 0.0;
        step.y1 << 1.0, 0.0;
        step.h = 1.0 / steps;
        for (int k = 0; k < steps; ++k) {
            step.t0 = k * step.h;
            step.y0 = step.y1;
            system.derivative(step.t0, step.y0, step.start_rate());
            stepper.advance(system);
            system.derivative(step.t0 + step.h, step.y1, step.end_rate());
            estimate = std::max(estimate, stepper.error(norm));
            stepper.make_interpolant(system);
            stepper.interpolate(0.5, middle);
            inside = std::max(inside, std::abs(middle[0] - std::cos(step.t0 + 0.5 * step.h)));
        }
        std::printf("%.17g %.17g %.17g\n", std::abs(step.y1[0] - std::cos(1.0)), inside, estimate);
    }
}
"""


def test_a_new_table_needs_no_other_line(tmp_path):
    compiler = shutil.which("c++")
    if compiler is None or not EIGEN.is_dir():
        pytest.skip("needs a C++ compiler and Eigen")
    source, program = tmp_path / "pair.cpp", tmp_path / "pair"
    source.write_text(PROGRAM)
    sources = [source, CORE / "run" / "integrators" / "runge_kutta.cpp"]
    subprocess.run(
        [compiler, "-std=c++17", "-I", CORE, "-isystem", EIGEN, *sources, "-o", program], check=True
    )
    output = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    errors = np.array([line.split() for line in output.splitlines()], dtype=float)
    orders = np.log2(errors[:-1] / errors[1:])
    # Order at the end, inside, and of the one-step estimate: all 3, the last as local error of order 2.
    np.testing.assert_allclose(orders, 3.0, atol=0.15)


def test_methods_are_listed_once():
    fixed = {"rk4": False, "semi_implicit_euler": False, "moreau": False}
    outside = {"Radau": True, "BDF": True, "LSODA": True}
    assert {"dop853": True, "dopri5": True} | fixed | outside == METHODS
    assert tuple(outside) == SCIPY
    assert len(core.methods()) == len(METHODS)
