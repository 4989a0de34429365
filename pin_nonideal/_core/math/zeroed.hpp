// Large arrays of zeros, of which a computation may use a small part.
#pragma once

#include <cstdlib>
#include <memory>
#include <new>
#include <vector>

namespace pn {

// Allocator of zeroed memory. The system provides a page of it at the first write to that page.
template <class Number>
struct ZeroedAllocator : std::allocator<Number> {
    template <class Other>
    struct rebind { using other = ZeroedAllocator<Other>; };

    ZeroedAllocator() = default;
    template <class Other>
    ZeroedAllocator(const ZeroedAllocator<Other>&) {}
    Number* allocate(size_t count) {
        void* memory = std::calloc(count, sizeof(Number));
        if (!memory && count > 0) throw std::bad_alloc();
        return static_cast<Number*>(memory);
    }
    void deallocate(Number* memory, size_t) { std::free(memory); }
    void construct(Number*) {}  // the memory is zero
    void construct(Number* place, const Number& value) { *place = value; }
};

template <class Number>
using ZeroedVector = std::vector<Number, ZeroedAllocator<Number>>;

}  // namespace pn
