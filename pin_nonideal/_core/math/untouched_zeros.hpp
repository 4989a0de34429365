// Numbers that are zero until written. Pages that nothing writes take no memory.
#pragma once

#include <cstdlib>
#include <memory>
#include <new>

namespace pn {

class UntouchedZeros {
public:
    void allocate(size_t n) {
        numbers_.reset(n > 0 ? static_cast<double*>(std::calloc(n, sizeof(double))) : nullptr);
        if (n > 0 && !numbers_) throw std::bad_alloc();
    }
    double* data() { return numbers_.get(); }
    const double* data() const { return numbers_.get(); }
    double& operator[](size_t i) { return numbers_.get()[i]; }
    double operator[](size_t i) const { return numbers_.get()[i]; }

private:
    struct Free {
        void operator()(double* numbers) const { std::free(numbers); }
    };
    std::unique_ptr<double[], Free> numbers_;
};

}  // namespace pn
