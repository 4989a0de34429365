// Polynomials through the seven Radau points of a step and its start. The last point is the end of the step. The values
// at the points integrate a polynomial of degree 12 exactly.
#pragma once

#include <array>

namespace pn::radau {

// [Hairer, Wanner, "Solving Ordinary Differential Equations II", sec. IV.5]
constexpr int n_points = 7;

// Roots of P_7(2x - 1) - P_6(2x - 1), with Legendre polynomials P_n.
constexpr double points[n_points] = {
    0.02931642715978489197, 0.14807859966848429185, 0.33698469028115429910, 0.55867151877155013208,
    0.76923386203005450092, 0.92694567131974111485, 1.0,
};

// Coefficients derived from the points. a_ij = int_0^c_i l_j are integrals of the Lagrange polynomials l_j through the
// points. at_start holds l_j(0), and barycentric the weights of the points together with 0.
struct Coefficients {
    double a[n_points][n_points], at_start[n_points], barycentric[n_points + 1];

    Coefficients() {
        for (int j = 0; j < n_points; ++j) {
            std::array<long double, n_points> l{1.0L};  // coefficients by powers
            int degree = 0;
            for (int k = 0; k < n_points; ++k) {
                if (k == j) continue;
                const long double scale = 1.0L / (static_cast<long double>(points[j]) - points[k]);
                ++degree;
                for (int p = degree; p >= 0; --p) l[p] = ((p > 0 ? l[p - 1] : 0.0L) - points[k] * l[p]) * scale;
            }
            at_start[j] = static_cast<double>(l[0]);
            for (int i = 0; i < n_points; ++i) {
                long double sum = 0.0L;
                for (int p = n_points - 1; p >= 0; --p) sum = (sum + l[p] / (p + 1)) * points[i];
                a[i][j] = static_cast<double>(sum);
            }
        }
        for (int j = 0; j <= n_points; ++j) {
            long double product = 1.0L;
            for (int k = 0; k <= n_points; ++k)
                if (k != j) product *= node(j) - node(k);
            barycentric[j] = static_cast<double>(1.0L / product);
        }
    }
    static double node(int k) { return k == 0 ? 0.0 : points[k - 1]; }
};
inline const Coefficients table;

// Call use(k, weight) with the weight at x of each node in the polynomial through all nodes. Node 0 is the step's start.
template <class Use>
void with_weights(double x, const Use& use) {
    double sum = 0.0, weight[n_points + 1];
    for (int k = 0; k <= n_points; ++k) {
        if (x == table.node(k)) return use(k, 1.0);
        sum += weight[k] = table.barycentric[k] / (x - table.node(k));
    }
    for (int k = 0; k <= n_points; ++k) use(k, weight[k] / sum);
}

}  // namespace pn::radau
