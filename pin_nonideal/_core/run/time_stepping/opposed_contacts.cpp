#include "run/time_stepping/opposed_contacts.hpp"

#include <algorithm>

#include "contact/bounds/distance.hpp"
#include "contact/queries.hpp"

namespace pn {

OpposedContacts::OpposedContacts(const Program& p) {
    for (const Gap& gap : p.gaps) between_lines_.push_back(is_between_lines(p.blocks[gap.block].kind));
}

void OpposedContacts::drop(const Program& p, const Workspace& w, const std::vector<char>& was_closed,
                           std::vector<int>& touching) {
    const auto normal = [&](int gap) {
        const Block& block = p.blocks[p.gaps[gap].block];
        const Vec3& n = w.now.values[p.gaps[gap].block].wrench[block.kept[0]].force;
        return block.joint1 < block.joint2 ? n : -n;
    };
    const auto precedes = [&](int other, int gap) {
        if (between_lines_[other] != between_lines_[gap]) return !between_lines_[other];
        if (was_closed[other] != was_closed[gap]) return was_closed[other] != 0;
        const double rate = gap_rate(p, w, gap), its = gap_rate(p, w, other);
        return its < rate || (its == rate && other < gap);
    };
    all_ = touching;
    touching.clear();
    for (size_t begin = 0, end = 0; begin < all_.size(); begin = end) {  // contacts of a pair follow each other
        const int first = all_[begin], pair = p.gaps[first].pair;
        while (end < all_.size() && p.gaps[all_[end]].pair == pair) ++end;
        std::vector<int>& list = of_pair_;
        list.assign(all_.begin() + begin, all_.begin() + end);
        const auto differs = [&](int gap) {
            return is_bare(p, first) || is_bare(p, gap) || normal(first).dot(normal(gap)) < parameters.alike;
        };
        if (pair >= 0 && std::any_of(list.begin(), list.end(), differs)) {
            std::sort(list.begin(), list.end(), precedes);
            const auto opposes = [&](int one, int other) {
                return !is_bare(p, one) && !is_bare(p, other) && normal(one).dot(normal(other)) < parameters.opposed;
            };
            size_t kept = 0;
            for (size_t i = 0; i < list.size(); ++i) {
                const auto against = [&](int other) { return opposes(list[i], other); };
                if (std::none_of(list.begin(), list.begin() + kept, against)) list[kept++] = list[i];
            }
            list.resize(kept);
            std::sort(list.begin(), list.end());
        }
        touching.insert(touching.end(), list.begin(), list.end());
    }
}

}  // namespace pn
