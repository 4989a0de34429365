// Bytes of a state, written and read by one list of fields. The state read is bitwise identical to the state written.
// The scene determines the size of each buffer, so that bytes of another scene are rejected. A checksum rejects damaged
// bytes.
#pragma once

#include <cstdint>
#include <cstring>
#include <map>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include "math/spatial.hpp"

namespace pn {

class Archive {
public:
    Archive() = default;  // writes
    // Reads what `seal` has completed.
    explicit Archive(const std::string& state) : bytes(state), reads(true) {
        std::uint64_t written;
        require(bytes.size() >= sizeof written);
        const size_t n = bytes.size() - sizeof written;
        std::memcpy(&written, bytes.data() + n, sizeof written);
        bytes.resize(n);
        require(written == checksum());
    }

    std::string bytes;

    template <class... T>
    void operator()(T&... items) { (item(items), ...); }
    // Write or read a vector whose length changes over a run.
    template <class T>
    void list(std::vector<T>& x) { resized(x); }
    void sized(VecX& x) {
        Eigen::Index n = x.size();
        raw(&n, sizeof n);
        if (reads) {
            require(n >= 0 && static_cast<size_t>(n) <= bytes.size() - at);
            x.resize(n);
        }
        raw(x.data(), n * sizeof(double));
    }
    void require(bool fits) const {
        if (!fits) throw std::invalid_argument("the state does not fit the scene");
    }
    void end() const { require(at == bytes.size()); }
    // Append the checksum, by which a reader rejects damaged bytes.
    void seal() {
        const std::uint64_t sum = checksum();
        bytes.append(reinterpret_cast<const char*>(&sum), sizeof sum);
    }

private:
    bool reads = false;
    size_t at = 0;

    // FNV-1a of all bytes.
    std::uint64_t checksum() const {
        std::uint64_t sum = 0xcbf29ce484222325;
        for (unsigned char byte : bytes) sum = (sum ^ byte) * 0x100000001b3;
        return sum;
    }
    void raw(void* data, size_t n) {
        if (n == 0) return;
        if (!reads) {
            bytes.append(static_cast<const char*>(data), n);
            return;
        }
        require(n <= bytes.size() - at);
        std::memcpy(data, bytes.data() + at, n);
        at += n;
    }
    void same(size_t size) {
        size_t written = size;
        raw(&written, sizeof written);
        require(written == size);
    }
    template <class T>
    std::enable_if_t<std::is_arithmetic_v<T> || std::is_enum_v<T>> item(T& x) { raw(&x, sizeof x); }
    void item(bool& x) {
        char c = x;
        raw(&c, 1);
        x = c != 0;
    }
    template <int rows, int columns>
    void item(Eigen::Matrix<double, rows, columns>& x) {
        same(static_cast<size_t>(x.size()));
        raw(x.data(), x.size() * sizeof(double));
    }
    void item(Vec3& x) { raw(&x[0], 3 * sizeof(double)); }
    template <class T>
    void item(std::map<int, T>& x) {
        std::vector<int> keys;
        for (const auto& entry : x) keys.push_back(entry.first);
        resized(keys);
        for (int key : keys) item(x[key]);
    }
    template <class T>
    void item(std::vector<T>& x) {
        same(x.size());
        items(x);
    }
    template <class T>
    std::enable_if_t<std::is_class_v<T>> item(T& x) { fields(*this, x); }

    template <class T>
    void items(std::vector<T>& x) {
        if constexpr (std::is_arithmetic_v<T>) raw(x.data(), x.size() * sizeof(T));
        else for (T& each : x) item(each);
    }
    template <class T>
    void resized(std::vector<T>& x) {
        size_t n = x.size();
        raw(&n, sizeof n);
        if (reads) {
            require(n <= bytes.size() - at);
            x.resize(n);
        }
        items(x);
    }
};

}  // namespace pn
