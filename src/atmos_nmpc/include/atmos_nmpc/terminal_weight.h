// Terminal weight: what an infinite horizon without bounds would cost in the plane.
#pragma once

#include <Eigen/Core>
#include <cmath>

#include "atmos_nmpc/riccati.h"
#include "atmos_nmpc/tracking_cost.h"

namespace atmos {

// Riccati solution over the errors (x, y, yaw, vx, vy, yaw rate) of the motion about rest at yaw `yaw`, all
// stages alike; without rows of the yaw rate where that is an input. Throws std::invalid_argument where there
// is none (a direction without weight or without thruster).
template <class Dynamics>
TrackingCost::PlanarWeight planar_terminal_weight(const Dynamics& dynamics, const TrackingWeights& weights,
                                                  const typename Dynamics::Input& input_weight, double yaw) {
  using namespace state13;
  constexpr bool kRateIsState = Dynamics::kStates == kSize;
  constexpr int kErrors = kRateIsState ? 6 : 5;
  using State = typename Dynamics::State;
  State rest = State::Zero();
  const double half_cos = std::cos(0.5 * yaw), half_sin = std::sin(0.5 * yaw);
  rest[kQuaternion] = half_cos;
  rest[kQuaternion + 3] = half_sin;
  typename Dynamics::Jacobian J;
  dynamics.jacobian(rest, Dynamics::Input::Zero(), J);

  // Planar rows of a column of the step's Jacobian; the yaw error is that of 2 vec(q_ref^-1 q), linear in q.
  const auto planar = [&](const State& column) {
    Eigen::Matrix<double, kErrors, 1> rows;
    rows.template head<5>() << column[kPosition], column[kPosition + 1],
        2.0 * (half_cos * column[kQuaternion + 3] - half_sin * column[kQuaternion]), column[kVelocity],
        column[kVelocity + 1];
    if constexpr (kRateIsState) rows[5] = column[kAngularVelocity + 2];
    return rows;
  };
  Eigen::Matrix<double, kErrors, kErrors> A = Eigen::Matrix<double, kErrors, kErrors>::Identity();
  A(0, 3) = A(1, 4) = dynamics.step_s();
  A.col(2) = planar(0.5 * (half_cos * J.col(3) - half_sin * J.col(0)));
  if constexpr (kRateIsState) A.col(5) = planar(J.col(6));
  Eigen::Matrix<double, kErrors, Dynamics::kInputs> B;
  for (int j = 0; j < Dynamics::kInputs; ++j) B.col(j) = planar(J.col(Dynamics::kCoupled + j));

  Eigen::Matrix<double, 6, 1> Q;
  Q << weights.position.head<2>(), weights.attitude[2], weights.velocity.head<2>(), weights.rate[2];
  TrackingCost::PlanarWeight P = TrackingCost::PlanarWeight::Zero();
  P.template topLeftCorner<kErrors, kErrors>() =
      solve_dare(A, B, Q.template head<kErrors>().asDiagonal().toDenseMatrix(),
                 input_weight.asDiagonal().toDenseMatrix());
  return P;
}

}  // namespace atmos
