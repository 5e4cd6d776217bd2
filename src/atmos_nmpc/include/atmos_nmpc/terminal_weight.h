// Terminal weight: what an infinite horizon without bounds would cost in the plane.
#pragma once

#include <Eigen/Core>
#include <cmath>

#include "atmos_nmpc/riccati.h"
#include "atmos_nmpc/tracking_cost.h"

namespace atmos {

// Riccati solution over the errors (x, y, yaw, vx, vy, yaw rate) of the motion about rest at yaw `yaw`, all
// stages alike. Throws std::invalid_argument where there is none (a direction without weight or without
// thruster).
template <class Dynamics>
TrackingCost::PlanarWeight planar_terminal_weight(const Dynamics& dynamics, const TrackingWeights& weights,
                                                  const typename Dynamics::Input& input_weight, double yaw) {
  using namespace state13;
  State13<double> rest = State13<double>::Zero();
  const double half_cos = std::cos(0.5 * yaw), half_sin = std::sin(0.5 * yaw);
  rest[kQuaternion] = half_cos;
  rest[kQuaternion + 3] = half_sin;
  typename Dynamics::Jacobian J;
  dynamics.jacobian(rest, Dynamics::Input::Zero(), J);

  // Planar rows of a column of the step's Jacobian; the yaw error is that of 2 vec(q_ref^-1 q), linear in q.
  const auto planar = [&](const State13<double>& column) {
    Eigen::Matrix<double, 6, 1> rows;
    rows << column[kPosition], column[kPosition + 1],
        2.0 * (half_cos * column[kQuaternion + 3] - half_sin * column[kQuaternion]), column[kVelocity],
        column[kVelocity + 1], column[kAngularVelocity + 2];
    return rows;
  };
  Eigen::Matrix<double, 6, 6> A = Eigen::Matrix<double, 6, 6>::Identity();
  A(0, 3) = A(1, 4) = dynamics.step_s();
  A.col(2) = planar(0.5 * (half_cos * J.col(3) - half_sin * J.col(0)));
  A.col(5) = planar(J.col(6));
  Eigen::Matrix<double, 6, Dynamics::kInputs> B;
  for (int j = 0; j < Dynamics::kInputs; ++j) B.col(j) = planar(J.col(7 + j));

  Eigen::Matrix<double, 6, 1> Q;
  Q << weights.position.head<2>(), weights.attitude[2], weights.velocity.head<2>(), weights.rate[2];
  return solve_dare(A, B, Q.asDiagonal().toDenseMatrix(), input_weight.asDiagonal().toDenseMatrix());
}

}  // namespace atmos
