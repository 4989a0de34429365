// Coefficients of the methods.
//
// dop853: method of order 8 of Dormand and Prince, with embedded orders 5 and 3 and dense output of order 7. [Hairer,
// Norsett, Wanner, "Solving Ordinary Differential Equations I", 2nd ed.]
// dopri5: Dormand and Prince (1980), with Shampine's dense output of order 4.
// Rows of A are stored below the diagonal, in sequence.
#include "run/integrators/method.hpp"

#include <cstddef>
#include <stdexcept>

namespace pn {

namespace {

constexpr double dop853_A[] = {
    0.05260015195876773, 0.0197250569845379, 0.0591751709536137, 0.02958758547680685,
    0.0, 0.08876275643042054, 0.2413651341592667, 0.0,
    -0.8845494793282861, 0.924834003261792, 0.037037037037037035, 0.0,
    0.0, 0.17082860872947386, 0.12546768756682242, 0.037109375,
    0.0, 0.0, 0.17025221101954405, 0.06021653898045596,
    -0.017578125, 0.03709200011850479, 0.0, 0.0,
    0.17038392571223998, 0.10726203044637328, -0.015319437748624402, 0.008273789163814023,
    0.6241109587160757, 0.0, 0.0, -3.3608926294469414,
    -0.868219346841726, 27.59209969944671, 20.154067550477894, -43.48988418106996,
    0.47766253643826434, 0.0, 0.0, -2.4881146199716677,
    -0.590290826836843, 21.230051448181193, 15.279233632882423, -33.28821096898486,
    -0.020331201708508627, -0.9371424300859873, 0.0, 0.0,
    5.186372428844064, 1.0914373489967295, -8.149787010746927, -18.52006565999696,
    22.739487099350505, 2.4936055526796523, -3.0467644718982196, 2.273310147516538,
    0.0, 0.0, -10.53449546673725, -2.0008720582248625,
    -17.9589318631188, 27.94888452941996, -2.8589982771350235, -8.87285693353063,
    12.360567175794303, 0.6433927460157636,
};
constexpr double dop853_B[] = {
    0.054293734116568765, 0.0, 0.0, 0.0,
    0.0, 4.450312892752409, 1.8915178993145003, -5.801203960010585,
    0.3111643669578199, -0.1521609496625161, 0.20136540080403034, 0.04471061572777259,
};
constexpr double dop853_C[] = {
    0.0, 0.05260015195876773, 0.0789002279381516, 0.1183503419072274,
    0.2816496580927726, 0.3333333333333333, 0.25, 0.3076923076923077,
    0.6512820512820513, 0.6, 0.8571428571428571, 1.0,
};
constexpr double dop853_E5[] = {
    0.01312004499419488, 0.0, 0.0, 0.0,
    0.0, -1.2251564463762044, -0.4957589496572502, 1.6643771824549864,
    -0.35032884874997366, 0.3341791187130175, 0.08192320648511571, -0.022355307863886294,
};
constexpr double dop853_E3[] = {
    -0.18980075407240762, 0.0, 0.0, 0.0,
    0.0, 4.450312892752409, 1.8915178993145003, -5.801203960010585,
    -0.4226823213237919, -0.1521609496625161, 0.20136540080403034, 0.02265179219836082,
};
constexpr double dop853_A_dense[] = {
    0.056167502283047954, 0.0, 0.0, 0.0,
    0.0, 0.0, 0.25350021021662483, -0.2462390374708025,
    -0.12419142326381637, 0.15329179827876568, 0.00820105229563469, 0.007567897660545699,
    -0.008298, 0.03183464816350214, 0.0, 0.0,
    0.0, 0.0, 0.028300909672366776, 0.053541988307438566,
    -0.05492374857139099, 0.0, 0.0, -0.00010834732869724932,
    0.0003825710908356584, -0.00034046500868740456, 0.1413124436746325, -0.42889630158379194,
    0.0, 0.0, 0.0, 0.0,
    -4.697621415361164, 7.683421196062599, 4.06898981839711, 0.3567271874552811,
    0.0, 0.0, 0.0, -0.0013990241651590145,
    2.9475147891527724, -9.15095847217987,
};
constexpr double dop853_C_dense[] = {
    0.1, 0.2, 0.7777777777777778,
};
constexpr double dop853_D[] = {
    -8.428938276109013, 0.0, 0.0, 0.0,
    0.0, 0.5667149535193777, -3.0689499459498917, 2.38466765651207,
    2.117034582445028, -0.871391583777973, 2.2404374302607883, 0.6315787787694688,
    -0.08899033645133331, 18.148505520854727, -9.194632392478356, -4.436036387594894,
    10.427508642579134, 0.0, 0.0, 0.0,
    0.0, 242.28349177525817, 165.20045171727028, -374.5467547226902,
    -22.113666853125306, 7.733432668472264, -30.674084731089398, -9.332130526430229,
    15.697238121770845, -31.139403219565178, -9.35292435884448, 35.81684148639408,
    19.985053242002433, 0.0, 0.0, 0.0,
    0.0, -387.0373087493518, -189.17813819516758, 527.8081592054236,
    -11.57390253995963, 6.8812326946963, -1.0006050966910838, 0.7777137798053443,
    -2.778205752353508, -60.19669523126412, 84.32040550667716, 11.99229113618279,
    -25.69393346270375, 0.0, 0.0, 0.0,
    0.0, -154.18974869023643, -231.5293791760455, 357.6391179106141,
    93.40532418362432, -37.45832313645163, 104.0996495089623, 29.8402934266605,
    -43.53345659001114, 96.32455395918828, -39.17726167561544, -149.72683625798564,
};

constexpr double dopri5_A[] = {
    0.2, 0.075, 0.225, 0.9777777777777777,
    -3.7333333333333334, 3.5555555555555554, 2.9525986892242035, -11.595793324188385,
    9.822892851699436, -0.2908093278463649, 2.8462752525252526, -10.757575757575758,
    8.906422717743473, 0.2784090909090909, -0.2735313036020583,
};
constexpr double dopri5_B[] = {
    0.09114583333333333, 0.0, 0.44923629829290207, 0.6510416666666666,
    -0.322376179245283, 0.13095238095238096,
};
constexpr double dopri5_C[] = {
    0.0, 0.2, 0.3, 0.8,
    0.8888888888888888, 1.0,
};
constexpr double dopri5_E[] = {
    -0.0012326388888888888, 0.0, 0.0042527702905061394, -0.03697916666666667,
    0.05086379716981132, -0.0419047619047619, 0.025,
};
constexpr double dopri5_P[] = {
    1.0, -2.8535800653862835, 3.0717434641059005, -1.1270175653862835,
    0.0, 0.0, 0.0, 0.0,
    0.0, 4.023133379230305, -6.249321565289, 2.675424484351598,
    0.0, -3.7324019615885042, 10.068970589843675, -5.685526961588504,
    0.0, 2.5548038301849423, -6.399112377351017, 3.5219323679207912,
    0.0, -1.3744241142186024, 3.272657752246729, -1.7672812570757455,
    0.0, 1.3824689317781436, -3.764937863556287, 2.382468931778144,
};

constexpr double rk4_A[] = {
    0.5, 0.0, 0.5, 0.0,
    0.0, 1.0,
};
constexpr double rk4_B[] = {
    0.16666666666666666, 0.3333333333333333, 0.3333333333333333, 0.16666666666666666,
};
constexpr double rk4_C[] = {
    0.0, 0.5, 0.5, 1.0,
};

// Stop the compilation if the lengths of a table do not fit.
constexpr void require(bool fits) {
    if (!fits) throw std::logic_error("lengths of a table");
}

template <size_t a, size_t s>
constexpr Method runge_kutta(const char* name, int order, const double (&A)[a], const double (&B)[s],
                             const double (&C)[s]) {
    require(s < max_rates && 2 * a == s * (s - 1));
    Method m;
    m.name = name;
    m.order = order;
    m.stages = static_cast<int>(s);
    m.A = A;
    m.B = B;
    m.C = C;
    return m;
}

template <size_t n>
constexpr Method with_error(Method m, const double (&E)[n], const double* coarse = nullptr) {
    require(static_cast<int>(n) == m.stages || static_cast<int>(n) == m.stages + 1);
    m.first_same_as_last = static_cast<int>(n) > m.stages;
    m.E = E;
    m.E_coarse = coarse;
    return m;
}

template <size_t a, size_t s, size_t d>
constexpr Method with_terms(Method m, const double (&A)[a], const double (&C)[s], const double (&D)[d]) {
    m.further_stages = static_cast<int>(s);
    const int rates = m.stages + 1 + m.further_stages;
    require(rates <= max_rates && d % rates == 0);
    require(static_cast<int>(2 * a) == m.further_stages * (2 * m.stages + 1 + m.further_stages));
    m.terms = static_cast<int>(d) / rates;
    m.A_further = A;
    m.C_further = C;
    m.D = D;
    return m;
}

template <size_t n>
constexpr Method with_powers(Method m, const double (&P)[n]) {
    require(n % (m.stages + 1) == 0);
    m.powers = static_cast<int>(n) / (m.stages + 1);
    m.P = P;
    return m;
}

constexpr Method scheme(const char* name, Method::Scheme scheme) {
    Method m;
    m.name = name;
    m.scheme = scheme;
    return m;
}

// Methods of SciPy, sampled in the middle of a step.
constexpr double outside_C[] = {0.0, 0.5};
constexpr Method outside(const char* name, bool one_step) {
    Method m = scheme(name, Method::Scheme::outside);
    m.order = 5;
    m.stages = 2;
    m.C = outside_C;
    m.one_step = one_step;
    return m;
}

constexpr Method stable_to(double length, Method m) {
    m.stability = length;
    return m;
}

constexpr Method list[] = {
    stable_to(6.1, with_terms(with_error(runge_kutta("dop853", 8, dop853_A, dop853_B, dop853_C), dop853_E5, dop853_E3),
                              dop853_A_dense, dop853_C_dense, dop853_D)),
    stable_to(3.25, with_powers(with_error(runge_kutta("dopri5", 5, dopri5_A, dopri5_B, dopri5_C), dopri5_E),
                                dopri5_P)),
    runge_kutta("rk4", 4, rk4_A, rk4_B, rk4_C),
    scheme("semi_implicit_euler", Method::Scheme::semi_implicit_euler),
    scheme("moreau", Method::Scheme::moreau),
    outside("Radau", true),
    outside("BDF", false),
    outside("LSODA", false),
};

}  // namespace

const std::vector<Method>& methods() {
    static const std::vector<Method> all(std::begin(list), std::end(list));
    return all;
}

const Method& method_named(const std::string& name) {
    for (const Method& method : methods())
        if (name == method.name) return method;
    throw std::invalid_argument("unknown method " + name);
}

}  // namespace pn
