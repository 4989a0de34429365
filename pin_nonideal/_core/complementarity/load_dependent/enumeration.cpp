#include "complementarity/load_dependent/enumeration.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "complementarity/load_dependent/solver.hpp"
#include "math/decompositions.hpp"

namespace pn {

namespace {

constexpr int max_unknowns = max_searched_forces + 1;  // forces, and tau
using Point = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, max_unknowns, 1>;
using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, max_unknowns, max_unknowns>;
using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, max_unknowns>;  // rows of one element or vector
using Short = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 3, 1>;
using Turned = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3>;

// Interval of a value: middle and radius.
struct Interval {
    double middle, radius;
    double lower() const { return std::max(0.0, middle - radius); }
    double upper() const { return middle + radius; }
};

// Interval of a vector that is linear in the point, and its direction within `turn`. If the vector may vanish, the
// direction is arbitrary.
struct VectorInterval {
    Short middle, along;
    Interval length;
    double turn = 1.0;

    VectorInterval(const Rows& rows, const Point& x, const Point& radius)
        : middle(rows * x), along(Short::Zero(rows.rows())), length{middle.norm(), (rows.cwiseAbs() * radius).norm()} {
        if (length.middle <= length.radius) return;
        along = middle / length.middle;
        const double sine = length.radius / length.middle;
        turn = rows.rows() == 1 ? 0.0 : std::sqrt(2.0 - 2.0 * std::sqrt(1.0 - sine * sine));  // chord of the angle
    }
};

// Intervals of rows of derivatives: middles and radii.
struct Slopes {
    Rows middle, radius;

    void join(const Slopes& o) {
        const Rows low = (middle - radius).cwiseMin(o.middle - o.radius);
        const Rows high = (middle + radius).cwiseMax(o.middle + o.radius);
        middle = 0.5 * (low + high);
        radius = 0.5 * (high - low);
    }
};

struct Limit {
    Interval size;
    Slopes slopes;
};

// Element of the equation in units of its own force, homogeneous in (x, tau).
struct Element {
    bool may_stick;
    int row, dim;
    Short direction;
    Rows force, response, argument;  // x, rho alpha, x - rho alpha
    double constant;
    std::vector<Rows> vectors;

    Limit limit(const Point& x, const Point& radius) const {
        const int tau = static_cast<int>(x.size()) - 1;
        Limit out{{constant * x[tau], constant * radius[tau]}, {Rows::Zero(1, tau + 1), Rows::Zero(1, tau + 1)}};
        out.slopes.middle(0, tau) = constant;
        for (const Rows& vector : vectors) {
            const VectorInterval arrow(vector, x, radius);
            out.size.middle += arrow.length.middle;
            out.size.radius += arrow.length.radius;
            out.slopes.middle += arrow.along.transpose() * vector;
            out.slopes.radius += arrow.turn * vector.colwise().norm();
        }
        return out;
    }

    // Check if the element neither sticks nor begins to slip anywhere in the box.
    bool is_excluded(const Point& x, const Point& radius) const {
        const Interval limit = this->limit(x, radius).size;
        const VectorInterval force_interval(force, x, radius), accelerated(response, x, radius);
        if (may_stick && accelerated.length.lower() == 0.0 && force_interval.length.lower() <= limit.upper()) return false;
        const Short along = may_stick ? accelerated.along : direction;
        const double turn = may_stick ? accelerated.turn : 0.0;
        return (force_interval.middle + limit.middle * along).norm() >
               force_interval.length.radius + limit.radius + turn * limit.upper();
    }

    // Return the residual of the equation in the middle of a box. `slopes` bounds its derivatives anywhere in the box.
    Short residual(const Point& x, const Point& radius, Slopes& slopes) const {
        const Limit limit = this->limit(x, radius);
        if (!may_stick) {
            slopes = {force + direction * limit.slopes.middle, direction.cwiseAbs() * limit.slopes.radius};
            return force * x + limit.size.middle * direction;
        }
        const VectorInterval point(argument, x, radius);
        const bool inside = point.length.lower() <= limit.size.upper(),
                   outside = point.length.upper() >= limit.size.lower();
        if (inside) slopes = {response, Rows::Zero(dim, x.size())};
        if (outside && inside) slopes.join(slope_outside(point, limit));
        else if (outside) slopes = slope_outside(point, limit);
        if (point.length.middle <= limit.size.middle) return response * x;
        return force * x - limit.size.middle / point.length.middle * point.middle;
    }

    // Return the derivatives of x - limit p / |p|, with p = x - rho alpha beyond the limit.
    Slopes slope_outside(const VectorInterval& p, const Limit& limit) const {
        const double upper = std::min(1.0, limit.size.upper() / std::max(p.length.lower(), 1e-300));
        const double lower = std::min(upper, limit.size.lower() / p.length.upper());
        const double part = 0.5 * (upper + lower), part_radius = 0.5 * (upper - lower);
        const Rows steep = limit.slopes.middle, steep_radius = limit.slopes.radius;
        Slopes out{force - p.along * steep,
                   p.along.cwiseAbs() * steep_radius +
                       p.turn * Short::Ones(dim) * (steep.cwiseAbs() + steep_radius)};
        if (dim == 1) return out;
        const Turned across = Turned::Identity(dim, dim) - p.along * p.along.transpose();
        const Turned across_radius =
            part_radius * across.cwiseAbs() + 2.0 * upper * p.turn * Turned::Ones(dim, dim);
        out.middle -= part * across * argument;
        out.radius += across_radius * argument.cwiseAbs();
        return out;
    }
};

struct Box {
    Point middle, radius;
    int face;  // index of the fixed coordinate

    double widest() const { return radius.maxCoeff(); }
};

struct Search {
    const RestEquation& equation;
    const int n;
    VecX unit;  // unit of each force
    std::vector<Element> elements;
    std::vector<Box> open;
    AllMotions found;
    int undecided = 0;

    explicit Search(const RestEquation& e) : equation(e), n(e.n), unit(e.n) {
        VecX alpha;
        FrictionLimits limits;
        e.respond(VecX::Zero(n), alpha, limits);
        for (size_t i = 0; i < e.elements.size(); ++i) {
            const RestElement& from = e.elements[i];
            const double size = limits[i] + from.rho * alpha.segment(from.row, from.dim).norm();
            unit.segment(from.row, from.dim).setConstant(size > 0.0 ? size : 1.0);
        }
        for (const RestElement& from : e.elements) elements.push_back(homogeneous(from));
        for (int face = 0; face <= n; ++face)
            for (double side : {1.0, -1.0}) open_face(face, side);
    }

    Rows homogeneous(const MatX& linear, const VecX& constant, double factor) const {
        Rows out(linear.rows(), n + 1);
        out.leftCols(n) = factor * linear * unit.asDiagonal();
        out.col(n) = factor * constant;
        return out;
    }

    Element homogeneous(const RestElement& from) const {
        const double inverse_unit = 1.0 / unit[from.row];
        Element e{from.may_stick, from.row, from.dim, Short(from.direction), Rows::Zero(from.dim, n + 1), {}, {},
                  inverse_unit * from.factor * from.constant, {}};
        e.force.middleCols(from.row, from.dim).setIdentity();
        e.response = homogeneous(equation.W.middleRows(from.row, from.dim), equation.alpha0.segment(from.row, from.dim),
                                 inverse_unit * from.rho);
        e.argument = e.force - e.response;
        for (int k = from.vector; k < from.vector + from.vectors; ++k)
            e.vectors.push_back(homogeneous(equation.loads.middleRows(3 * k, 3), equation.still.segment(3 * k, 3),
                                            inverse_unit * from.factor));
        return e;
    }

    // Add a face of the cube of (x, tau), with tau >= 0, to the boxes of the search.
    void open_face(int face, double side) {
        if (face == n && side < 0.0) return;
        Box box{Point::Zero(n + 1), Point::Ones(n + 1), face};
        box.middle[n] = box.radius[n] = 0.5;
        box.middle[face] = side;
        box.radius[face] = 0.0;
        open.push_back(box);
    }

    // Return the free coordinates of a point on a face.
    Point free(const Point& x, int face) const {
        Point out(n);
        for (int k = 0, column = 0; k <= n; ++k)
            if (k != face) out[column++] = x[k];
        return out;
    }

    void keep(const VecX& x) {
        for (const VecX& y : found.forces)
            if ((x - y).cwiseQuotient(unit).norm() <=
                enumeration_parameters.same_motion * (1.0 + y.cwiseQuotient(unit).norm()))
                return;
        found.forces.push_back(x);
    }

    // Store the solution near the middle of a box, if it is a motion.
    void take(Point x) {
        if (x[n] < -enumeration_parameters.infinite_solution_tau) return;
        if (x[n] <= enumeration_parameters.infinite_solution_tau) {
            ++undecided;
            return;
        }
        VecX forces = VecX(x.head(n) / x[n]).cwiseProduct(unit);
        if (refine_rest(equation, forces)) keep(forces);
        else ++undecided;
    }

    // Krawczyk's test. Return true if the box is done. Otherwise the box may have shrunk.
    bool decide(Box& box) {
        const Point radius = (enumeration_parameters.box_overlap * box.radius).array() +
                             enumeration_parameters.radius_rounding * (box.radius.array() > 0.0).cast<double>();
        Square J(n, n), J_radius(n, n);
        Point residual(n);
        for (const Element& e : elements) {
            Slopes slopes;
            residual.segment(e.row, e.dim) = e.residual(box.middle, radius, slopes);
            for (int k = 0, column = 0; k <= n; ++k) {
                if (k == box.face) continue;
                J.block(e.row, column, e.dim, 1) = slopes.middle.col(k);
                J_radius.block(e.row, column++, e.dim, 1) = slopes.radius.col(k);
            }
        }
        const Eigen::PartialPivLU<Square> lu(J);
        const Square inverse = lu.inverse();
        if (!inverse.allFinite()) return false;
        const Point shift = -inverse * residual, side = free(radius, box.face);
        const Point reach = (inverse.cwiseAbs() * J_radius + (Square::Identity(n, n) - inverse * J).cwiseAbs()) * side;
        if ((shift.cwiseAbs().array() > (side + reach).array()).any()) return true;
        if ((shift.cwiseAbs() + reach).cwiseQuotient(side).maxCoeff() < 1.0) {
            for (int k = 0, column = 0; k <= n; ++k)
                if (k != box.face) box.middle[k] += shift[column++];
            take(box.middle);
            return true;
        }
        const double before = box.widest();
        for (int k = 0, column = 0; k <= n; ++k) {
            if (k == box.face) continue;
            const double low = std::max(-radius[k], shift[column] - reach[column]);
            const double high = std::min(radius[k], shift[column] + reach[column]);
            ++column;
            box.middle[k] += 0.5 * (low + high);
            box.radius[k] = std::min(box.radius[k], 0.5 * (high - low));
        }
        if (box.widest() < enumeration_parameters.max_shrink_ratio * before) {
            open.push_back(box);
            return true;
        }
        return false;
    }

    void halve(Box box) {
        if (box.widest() < enumeration_parameters.min_box_part) {
            if (undecided++ < 3) take(box.middle);
            return;
        }
        Eigen::Index k;
        box.radius.maxCoeff(&k);
        box.radius[k] *= 0.5;
        const double middle = box.middle[k];
        for (double side : {-1.0, 1.0}) {
            box.middle[k] = middle + side * box.radius[k];
            open.push_back(box);
        }
    }

    void run() {
        for (int count = 0; !open.empty() && undecided < enumeration_parameters.max_undecided; ++count) {
            if (count >= enumeration_parameters.max_boxes) return;
            Box box = open.back();
            open.pop_back();
            const bool excluded = std::any_of(elements.begin(), elements.end(), [&](const Element& e) {
                return e.is_excluded(box.middle, box.radius);
            });
            if (!excluded && !decide(box)) halve(box);
        }
        found.complete = undecided == 0;
    }
};

}  // namespace

bool is_searched(const RestEquation& equation) {
    if (equation.evaluate_laws || equation.n > max_searched_forces) return false;
    for (const RestElement& e : equation.elements)
        if (e.middle != 0.0) return false;
    Cholesky cholesky;
    if (!cholesky.compute(equation.W)) return false;  // redundant elements have infinitely many shares
    const auto pivots = cholesky.factor().diagonal().array().square();
    return (pivots > enumeration_parameters.min_pivot * equation.W.diagonal().array()).all();
}

AllMotions all_motions(const RestEquation& equation) {
    if (!is_searched(equation)) return {};
    Search search(equation);
    search.run();
    return std::move(search.found);
}

}  // namespace pn
