// What the kinds of constraints are like: their rows, their frames, and what of them can change.
#include "constraints/constraints.hpp"

namespace pn {

namespace {

template <class T, class = void>
struct HasFrames : std::false_type {};
template <class T>
struct HasFrames<T, std::void_t<decltype(std::declval<T>().frame1)>> : std::true_type {};

}  // namespace

bool is_geometric(const Kind& kind) {
    return std::visit([](const auto& k) { return HasFrames<std::decay_t<decltype(k)>>::value; }, kind);
}

const Frame* frame1(const Kind& kind) {
    return std::visit([](const auto& k) -> const Frame* {
        if constexpr (HasFrames<std::decay_t<decltype(k)>>::value) return &k.frame1;
        return nullptr;
    }, kind);
}

const Frame* frame2(const Kind& kind) {
    return std::visit([](const auto& k) -> const Frame* {
        if constexpr (HasFrames<std::decay_t<decltype(k)>>::value) return &k.frame2;
        return nullptr;
    }, kind);
}

bool has_constant_rows(const Kind& kind) {
    return std::holds_alternative<CouplingRows>(kind) || std::holds_alternative<MotionRows>(kind) ||
           std::holds_alternative<DofRows>(kind);
}

bool has_residual(const Kind& kind, int row) {
    struct Has {
        int row;
        bool operator()(const KnifeRows&) const { return false; }
        bool operator()(const RollingRows&) const { return row == 2; }
        bool operator()(const CouplingRows& c) const { return c.position; }
        bool operator()(const UserRows& c) const { return static_cast<bool>(c.residual); }
        bool operator()(const DofRows&) const { return false; }
        bool operator()(const HingeSlipRows&) const { return false; }
        bool operator()(const ContactSlipRows&) const { return false; }
        bool operator()(const UserSlipRow&) const { return false; }
        bool operator()(const PointRows&) const { return true; }
        bool operator()(const ContactRow&) const { return true; }
        bool operator()(const FrameRows&) const { return true; }
        bool operator()(const HingeRows&) const { return true; }
        bool operator()(const DistanceRows&) const { return true; }
        bool operator()(const MotionRows&) const { return true; }
    };
    return std::visit(Has{row}, kind);
}

bool moves_in_time(const Kind& kind) {
    if (const auto* d = std::get_if<DistanceRows>(&kind)) {
        const auto* polynomial = std::get_if<Polynomial>(&d->length);
        return !polynomial || polynomial->coefficients.size() > 1;
    }
    return std::holds_alternative<MotionRows>(kind) || std::holds_alternative<UserRows>(kind);
}

int row_count(const Kind& kind, int user_size) {
    struct Count {
        int user;
        int operator()(const PointRows& c) const { return static_cast<int>(c.axes.size()); }
        int operator()(const ContactRow&) const { return 1; }
        int operator()(const FrameRows&) const { return 6; }
        int operator()(const HingeRows&) const { return 5; }
        int operator()(const RollingRows&) const { return 3; }
        int operator()(const UserRows&) const { return user; }
        int operator()(const DofRows& c) const { return c.count; }
        int operator()(const ContactSlipRows&) const { return 2; }
        int operator()(const DistanceRows&) const { return 1; }
        int operator()(const KnifeRows&) const { return 1; }
        int operator()(const CouplingRows&) const { return 1; }
        int operator()(const MotionRows&) const { return 1; }
        int operator()(const HingeSlipRows&) const { return 1; }
        int operator()(const UserSlipRow&) const { return 1; }
    };
    return std::visit(Count{user_size}, kind);
}

}  // namespace pn
