#include "atmos_nmpc/direct_allocation.h"

#include <algorithm>
#include <cmath>

#include "atmos_nmpc/riccati.h"

namespace atmos {

DirectAllocation make_direct_allocation(const Vehicle& vehicle, const ControllerConfig& config) {
  const std::vector<ThrusterPair> pairs = thruster_pairs(vehicle);
  const AllocationMatrices matrices = pair_matrices(vehicle, pairs);
  Eigen::Vector4d lower, upper;
  for (int j = 0; j < 4; ++j) {
    const auto& pair = pairs[static_cast<std::size_t>(j)];
    upper[j] =
        std::min(config.pair_force_n, vehicle.thrusters[static_cast<std::size_t>(pair.positive)].force_n);
    lower[j] =
        -std::min(config.pair_force_n, vehicle.thrusters[static_cast<std::size_t>(pair.negative)].force_n);
  }
  return DirectAllocation(
      RigidBodyStep<4>(matrices.D, matrices.L, vehicle.mass_kg, vehicle.inertia_kg_m2, config.step_s),
      TrackingCost(config.attitude_error, config.weights, config.bounds), config.stages,
      Eigen::Vector4d::Constant(config.force_weight), lower, upper, config.objective_scale);
}

TrackingCost::PlanarWeight planar_terminal_weight(const RigidBodyStep<4>& dynamics,
                                                  const TrackingWeights& weights, double force_weight,
                                                  double yaw) {
  State13<double> rest = State13<double>::Zero();
  rest[state13::kQuaternion] = std::cos(0.5 * yaw);
  rest[state13::kQuaternion + 3] = std::sin(0.5 * yaw);
  RigidBodyStep<4>::Jacobian J;
  dynamics.jacobian(rest, Eigen::Vector4d::Zero(), J);

  // At rest without force the attitude moves nothing else, and yaw is the integral of the yaw rate; the
  // inputs' columns are those of the step, the yaw error's being 2 vec(q_ref^-1 q), linear in q.
  Eigen::Matrix<double, 6, 6> A = Eigen::Matrix<double, 6, 6>::Identity();
  for (int i = 0; i < 3; ++i) A(i, i + 3) = dynamics.step_s();
  const double half_cos = rest[state13::kQuaternion], half_sin = rest[state13::kQuaternion + 3];
  const auto inputs = J.rightCols<4>();
  Eigen::Matrix<double, 6, 4> B;
  B.row(0) = inputs.row(state13::kPosition);
  B.row(1) = inputs.row(state13::kPosition + 1);
  B.row(2) =
      2.0 * (half_cos * inputs.row(state13::kQuaternion + 3) - half_sin * inputs.row(state13::kQuaternion));
  B.row(3) = inputs.row(state13::kVelocity);
  B.row(4) = inputs.row(state13::kVelocity + 1);
  B.row(5) = inputs.row(state13::kAngularVelocity + 2);

  Eigen::Matrix<double, 6, 1> Q;
  Q << weights.position.head<2>(), weights.attitude[2], weights.velocity.head<2>(), weights.rate[2];
  return solve_dare(A, B, Q.asDiagonal().toDenseMatrix(), force_weight * Eigen::Matrix4d::Identity());
}

std::vector<double> duties_from_pairs(const Vehicle& vehicle, const std::vector<ThrusterPair>& pairs,
                                      const Eigen::Vector4d& u) {
  std::vector<double> duty(vehicle.thrusters.size(), 0.0);
  for (int j = 0; j < 4; ++j) {
    const auto& pair = pairs[static_cast<std::size_t>(j)];
    const auto thruster = static_cast<std::size_t>(u[j] > 0.0 ? pair.positive : pair.negative);
    const double share = std::min(1.0, std::abs(u[j]) / vehicle.thrusters[thruster].force_n);
    if (share * vehicle.pwm.period_s >= vehicle.pwm.min_on_time_s) duty[thruster] = share;
  }
  return duty;
}

}  // namespace atmos
