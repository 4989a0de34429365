// Comparison of lists of flags and modes, eight at a time. Of thousands of contacts in a scene few are closed.
#pragma once

#include <cstdint>
#include <cstring>
#include <vector>

namespace pn {

// Compare modes or flags bytewise.
template <class Byte>
bool same_bytes(const std::vector<Byte>& a, const std::vector<Byte>& b) {
    static_assert(sizeof(Byte) == 1);
    return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size()) == 0);
}

// Return the first index from `from` on whose flag or mode differs from `value`, or the size of the list.
template <class Byte>
size_t next_other(const std::vector<Byte>& list, size_t from, Byte value) {
    static_assert(sizeof(Byte) == 1);
    std::uint64_t eight, values;
    std::memset(&values, static_cast<unsigned char>(value), sizeof values);
    for (; from + sizeof eight <= list.size(); from += sizeof eight) {
        std::memcpy(&eight, list.data() + from, sizeof eight);
        if (eight != values) break;
    }
    while (from < list.size() && list[from] == value) ++from;
    return from;
}

// Return the first index from `from` on at which two lists of one length differ, or their length.
template <class Byte>
size_t next_difference(const std::vector<Byte>& a, const std::vector<Byte>& b, size_t from) {
    static_assert(sizeof(Byte) == 1);
    std::uint64_t eight, other;
    for (; from + sizeof eight <= a.size(); from += sizeof eight) {
        std::memcpy(&eight, a.data() + from, sizeof eight);
        std::memcpy(&other, b.data() + from, sizeof other);
        if (eight != other) break;
    }
    while (from < a.size() && a[from] == b[from]) ++from;
    return from;
}

}  // namespace pn
