#include "atmos_nmpc/wrench.h"

#include <utility>

#include "atmos_model/allocator.h"
#include "atmos_nmpc/nmpc_law.h"

namespace atmos {

template class MultipleShooting<RigidBodyStep<3>>;

WrenchProblem make_wrench(const Vehicle& vehicle, const ControllerConfig& config) {
  Eigen::Matrix3d D = Eigen::Matrix3d::Zero(), L = Eigen::Matrix3d::Zero();
  D(0, 0) = D(1, 1) = 1.0;
  L(2, 2) = 1.0;
  const Eigen::Vector3d limit(config.force_n, config.force_n, config.torque_n_m);
  WrenchProblem problem(RigidBodyStep<3>(D, L, vehicle.mass_kg, vehicle.inertia_kg_m2, config.step_s),
                        TrackingCost(config.attitude_error, config.weights, config.bounds), config.stages,
                        {config.force_weight, config.force_weight, config.torque_weight}, -limit, limit,
                        config.objective_scale);
  problem.cost().set_places(config.places);
  if (config.polytope) {
    const Allocator allocator(vehicle);
    problem.set_input_polytope(allocator.facet_normals(), allocator.facet_limits(), config.bounds);
  }
  return problem;
}

std::unique_ptr<ControlLaw> make_wrench_law(const Vehicle& vehicle, const ControllerConfig& config,
                                            Stopwatch stopwatch) {
  const auto actuate = [allocator = Allocator(vehicle), allocation = Allocation()](
                           const Eigen::Vector3d& wrench, ActuatorInput& result) mutable {
    allocator.allocate_into(wrench, allocation);
    result.wrench = wrench;
    result.duty = allocation.duty;
  };
  return std::make_unique<NmpcLaw<WrenchProblem>>(CommandLevel::kWrench, make_wrench(vehicle, config), config,
                                                  config.solver, actuate, std::move(stopwatch));
}

}  // namespace atmos
