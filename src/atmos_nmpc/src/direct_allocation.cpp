#include "atmos_nmpc/direct_allocation.h"

#include <algorithm>
#include <cmath>

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

void duties_from_pairs(const Vehicle& vehicle, const std::vector<ThrusterPair>& pairs,
                       const Eigen::Vector4d& u, std::vector<double>& duty) {
  duty.assign(vehicle.thrusters.size(), 0.0);
  for (int j = 0; j < 4; ++j) {
    const auto& pair = pairs[static_cast<std::size_t>(j)];
    const auto thruster = static_cast<std::size_t>(u[j] > 0.0 ? pair.positive : pair.negative);
    const double share = std::min(1.0, std::abs(u[j]) / vehicle.thrusters[thruster].force_n);
    if (vehicle.actuation == Actuation::kContinuous)
      duty[thruster] = std::copysign(share, u[j]);
    else if (share * vehicle.pwm.period_s >= vehicle.pwm.min_on_time_s)
      duty[thruster] = share;
  }
}

}  // namespace atmos
