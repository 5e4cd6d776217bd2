// Central differences and random attitudes for derivative tests.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "atmos_model/rigid_body.h"

namespace atmos::testing {

// Jacobian of f at x, one column per component of x.
template <class F>
Eigen::MatrixXd numeric_jacobian(const F& f, const Eigen::VectorXd& x, double step = 1e-5) {
  const Eigen::VectorXd at = f(x);
  Eigen::MatrixXd J(at.size(), x.size());
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    Eigen::VectorXd above = x, below = x;
    above[i] += step;
    below[i] -= step;
    J.col(i) = (f(above) - f(below)) / (2.0 * step);
  }
  return J;
}

inline Quaternion4<double> about_axis(const Eigen::Vector3d& axis, double angle) {
  Quaternion4<double> q;
  q << std::cos(0.5 * angle), std::sin(0.5 * angle) * axis.normalized();
  return q;
}

// Attitudes at which formulas break first: identity, tiny angles, half turns (scalar part 0), and random
// ones.
inline std::vector<std::pair<std::string, Quaternion4<double>>> attitudes(std::uint32_t seed) {
  std::vector<std::pair<std::string, Quaternion4<double>>> list = {
      {"identity", about_axis({0, 0, 1}, 0.0)},
      {"tiny", about_axis({1, -2, 3}, 1e-9)},
      {"half turn", about_axis({0, 0, 1}, M_PI)},
      {"almost a half turn", about_axis({1, 1, 0.5}, M_PI - 1e-8)},
      {"negative identity", -about_axis({0, 0, 1}, 0.0)},
  };
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 5; ++i) {
    Quaternion4<double> q(normal(random), normal(random), normal(random), normal(random));
    list.emplace_back("random " + std::to_string(i), q.normalized());
  }
  return list;
}

// A state with everything in motion.
inline State13<double> moving_state(const Quaternion4<double>& q, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  State13<double> x;
  for (int i = 0; i < 13; ++i) x[i] = normal(random);
  x.segment<4>(state13::kQuaternion) = q;
  return x;
}

}  // namespace atmos::testing
