// Polynomials on [0, 1] by their Bernstein coefficients, which bound them: the arithmetic of Bezier curves.
#pragma once

#include <Eigen/Core>
#include <utility>

#include "atmos_stl_planner/interval_set.h"

namespace atmos::stl::bernstein {

using Coefficients = Eigen::VectorXd;  // degree + 1 of them, at least one

double value(const Coefficients& c, double s);
Coefficients derivative(const Coefficients& c);
// The same polynomial with a higher degree.
Coefficients elevated(const Coefficients& c, Eigen::Index degree);
// Sum and product of polynomials of any degrees.
Coefficients sum(const Coefficients& a, const Coefficients& b);
Coefficients product(const Coefficients& a, const Coefficients& b);
// The parts before and after s, each on [0, 1] again (de Casteljau).
std::pair<Coefficients, Coefficients> split(const Coefficients& c, double s);

// Where c(s) >= 0. Never too large by more than rounding: where no decision is possible down to a width of
// 1e-10 (a double root), s counts as outside.
IntervalSet nonnegative(const Coefficients& c);

// A lower bound of c on [0, 1], at most `tolerance` below the minimum.
double lower_bound(const Coefficients& c, double tolerance);

// The s with c(s) = target, for an increasing polynomial; clamped to [0, 1].
double inverse(const Coefficients& c, double target);

}  // namespace atmos::stl::bernstein
