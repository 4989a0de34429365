// Arrays and other plain data of calls from Python. Python checks user input before it reaches the core.
#pragma once

#include <algorithm>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>  // in every source: without it a source treats strings as a class

#include "constraints/geometry.hpp"

namespace pn {

namespace nb = nanobind;

using Array = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Array2 = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

inline Eigen::Map<const VecX> map(const Array& a) { return {a.data(), static_cast<Eigen::Index>(a.shape(0))}; }
inline Eigen::Map<const RowMajor> map(const Array2& a) {
    return {a.data(), static_cast<Eigen::Index>(a.shape(0)), static_cast<Eigen::Index>(a.shape(1))};
}

// Arrays returned to Python.
using Numbers = nb::ndarray<nb::numpy, double, nb::ndim<1>>;
using Table = nb::ndarray<nb::numpy, double, nb::ndim<2>>;

// Capsule that owns a vector, whose buffer moves without a copy.
inline nb::capsule owner_of(std::vector<double>&& x) {
    auto* kept = new std::vector<double>(std::move(x));
    kept->reserve(1);  // an empty array needs an address too
    return nb::capsule(kept, [](void* v) noexcept { delete static_cast<std::vector<double>*>(v); });
}
inline Numbers to_numpy(std::vector<double>&& x) {
    const nb::capsule owner = owner_of(std::move(x));
    auto* kept = static_cast<std::vector<double>*>(owner.data());
    return Numbers(kept->data(), {kept->size()}, owner);
}
inline Table to_table(std::vector<double>&& x, size_t rows, size_t columns) {  // x in row-major order
    const nb::capsule owner = owner_of(std::move(x));
    return Table(static_cast<std::vector<double>*>(owner.data())->data(), {rows, columns}, owner);
}
inline Numbers to_numpy(const double* data, size_t n) { return to_numpy(std::vector<double>(data, data + n)); }
inline Numbers to_numpy(const VecX& x) { return to_numpy(x.data(), x.size()); }

// Array argument of a user function. The next call reuses the array, unless the function has kept it.
class HandedArray {
public:
    HandedArray() = default;
    HandedArray(const HandedArray&) {}  // a copy of the function has its own array
    HandedArray& operator=(const HandedArray&) = delete;

    const nb::object& operator()(const double* x, size_t n) {
        if (data_ == nullptr || n != size_ || Py_REFCNT(array_.ptr()) > 1) {
            const Numbers new_array = to_numpy(x, n);
            data_ = new_array.data();
            size_ = n;
            array_ = nb::cast(new_array);
        } else {
            std::copy(x, x + n, data_);
        }
        return array_;
    }
    const nb::object& operator()(const VecX& x) { return (*this)(x.data(), static_cast<size_t>(x.size())); }

private:
    nb::object array_;
    double* data_ = nullptr;
    size_t size_ = 0;
};

// Arrays of n numbers that are returned repeatedly. A copy of a kept array in NumPy is faster than a new owned buffer.
class NumpyCopies {
public:
    explicit NumpyCopies(size_t n) : numbers_(to_numpy(std::vector<double>(n))), copy_(nb::cast(numbers_).attr("copy")) {}
    nb::object operator()(const double* x) {
        std::copy_n(x, numbers_.size(), numbers_.data());
        return copy_();
    }

private:
    Numbers numbers_;
    nb::object copy_;
};

inline void read_into(const nb::object& from, VecX& to) {
    const Array a = nb::cast<Array>(from);
    to = map(a);
}

using FrameTuple = std::tuple<int, std::vector<double>, std::vector<double>>;  // joint, R (row-major), p

inline Vec3 vec3(const std::vector<double>& x) { return Vec3(x[0], x[1], x[2]); }

inline Frame frame_of(const FrameTuple& f) {
    return {std::get<0>(f), Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(std::get<1>(f).data()),
            vec3(std::get<2>(f))};
}

// Python function, or None.
template <class Signature>
using Function = std::optional<nb::typed<nb::callable, Signature>>;

}  // namespace pn
