// States and torques from plain buffers, for calls in tight loops.
#pragma once

#include <algorithm>
#include <stdexcept>

#include "python/arrays.hpp"

namespace pn {

constexpr double unit_tolerance = 1e-6;  // tolerance of unit quaternions and (cos, sin) pairs, as in Python's checks

// Contiguous buffer of doubles, without an intermediate array object.
class NumberBuffer {
public:
    NumberBuffer(nb::handle object, int flags) {
        if (PyObject_GetBuffer(object.ptr(), &view_, PyBUF_C_CONTIGUOUS | PyBUF_FORMAT | flags) != 0) {
            PyErr_Clear();
            throw std::invalid_argument("expected a contiguous array of floats");
        }
    }
    ~NumberBuffer() { PyBuffer_Release(&view_); }
    NumberBuffer(const NumberBuffer&) = delete;
    NumberBuffer& operator=(const NumberBuffer&) = delete;
    void check(Eigen::Index n) const {
        if (view_.ndim != 1 || view_.shape[0] != n || view_.format == nullptr || view_.format[0] != 'd')
            throw std::invalid_argument("expected an array of floats of the model's size");
    }
    double* data() const { return static_cast<double*>(view_.buf); }

private:
    Py_buffer view_;
};

inline void read_buffer(nb::handle from, VecX& to) {
    const NumberBuffer buffer(from, 0);
    buffer.check(to.size());
    to = Eigen::Map<const VecX>(buffer.data(), to.size());
    if (!to.allFinite()) throw std::invalid_argument("expected finite numbers");
}

}  // namespace pn
