// Programs of batch runs that differ in parameters.
#pragma once

#include <string>
#include <tuple>
#include <vector>

#include "dynamics/parameters.hpp"
#include "python/arrays.hpp"

namespace pn {

using NumberTuple = std::tuple<std::string, int, std::string>;  // a NumberName

// Programs of batch runs that differ in parameters: one program per thread, with the parameters of its current run. The
// thread that holds the GIL copies and destroys the programs, because they hold Python functions.
class RunPrograms {
   public:
    RunPrograms(const Program& p, const std::vector<NumberTuple>& names, const Array2& values, int threads)
        : common(p), values(map(values)) {
        if (names.empty()) return;
        own.assign(threads, p);
        places.resize(threads);
        for (int k = 0; k < threads; ++k)
            for (const auto& [call, index, argument] : names)
                places[k].push_back(find_number(own[k], {call, index, argument}));
    }
    const Program& of(size_t i, int thread) {
        if (own.empty()) return common;
        int column = 0;
        for (const NumberLocation& place : places[thread])
            for (int j = 0; j < place.size; ++j) place.at[j] = values(i, column++);
        return own[thread];
    }

   private:
    const Program& common;
    Eigen::Map<const RowMajor> values;
    std::vector<Program> own;
    std::vector<std::vector<NumberLocation>> places;
};

}  // namespace pn
