#include "atmos_nmpc/direct_allocation.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "atmos_nmpc/nmpc_law.h"

namespace atmos {

template class MultipleShooting<RigidBodyStep<4>>;

namespace {

constexpr double kIdleForce = 0.1;  // N

}  // namespace

DirectAllocation make_direct_allocation(const Vehicle& vehicle, const ControllerConfig& config) {
  const std::vector<ThrusterPair> pairs = thruster_pairs(vehicle);
  AllocationMatrices matrices = pair_matrices(vehicle, pairs);
  Eigen::Vector4d lower, upper;
  for (int j = 0; j < 4; ++j) {
    const auto& pair = pairs[static_cast<std::size_t>(j)];
    upper[j] =
        std::min(config.pair_force_n, vehicle.thrusters[static_cast<std::size_t>(pair.positive)].force_n);
    lower[j] =
        -std::min(config.pair_force_n, vehicle.thrusters[static_cast<std::size_t>(pair.negative)].force_n);
    if (lower[j] < upper[j]) continue;
    // Both thrusters are dead. The solver must not take the input out of the problem, whose stages are alike:
    // it stays, without effect.
    lower[j] = -kIdleForce;
    upper[j] = kIdleForce;
    matrices.D.col(j).setZero();
    matrices.L.col(j).setZero();
  }
  DirectAllocation problem(
      RigidBodyStep<4>(matrices.D, matrices.L, vehicle.mass_kg, vehicle.inertia_kg_m2, config.step_s),
      TrackingCost(config.attitude_error, config.weights, config.bounds), config.stages,
      Eigen::Vector4d::Constant(config.force_weight), lower, upper, config.objective_scale);
  problem.cost().set_places(config.places);
  return problem;
}

void duties_from_pairs(const Vehicle& vehicle, const std::vector<ThrusterPair>& pairs,
                       const Eigen::Vector4d& u, std::vector<double>& duty) {
  duty.assign(vehicle.thrusters.size(), 0.0);
  for (int j = 0; j < 4; ++j) {
    const auto& pair = pairs[static_cast<std::size_t>(j)];
    const auto thruster = static_cast<std::size_t>(u[j] > 0.0 ? pair.positive : pair.negative);
    if (vehicle.thrusters[thruster].force_n <= 0.0) continue;
    const double share = std::min(1.0, std::abs(u[j]) / vehicle.thrusters[thruster].force_n);
    if (vehicle.actuation == Actuation::kContinuous)
      duty[thruster] = std::copysign(share, u[j]);
    else if (share * vehicle.pwm.period_s >= vehicle.pwm.min_on_time_s)
      duty[thruster] = share;
  }
}

std::unique_ptr<ControlLaw> make_direct_allocation_law(const Vehicle& vehicle, const ControllerConfig& config,
                                                       Stopwatch stopwatch) {
  const auto actuate = [vehicle, pairs = thruster_pairs(vehicle)](const Eigen::Vector4d& u,
                                                                  ActuatorInput& result) {
    result.wrench.setZero();
    duties_from_pairs(vehicle, pairs, u, result.duty);
  };
  return std::make_unique<NmpcLaw<DirectAllocation>>(CommandLevel::kThrusters,
                                                     make_direct_allocation(vehicle, config), config,
                                                     config.solver, actuate, std::move(stopwatch));
}

}  // namespace atmos
