#include "atmos_nmpc/rate.h"

#include <utility>

#include "atmos_model/allocator.h"
#include "atmos_nmpc/nmpc_law.h"

namespace atmos {

template class MultipleShooting<RateStep>;

RateProblem make_rate(const Vehicle& vehicle, const ControllerConfig& config) {
  const Eigen::Vector3d limit(config.force_n, config.force_n, config.rate_rad_s);
  RateProblem problem(RateStep(vehicle.mass_kg, config.step_s),
                      TrackingCost(config.attitude_error, config.weights, config.bounds), config.stages,
                      {config.force_weight, config.force_weight, config.rate_weight}, -limit, limit,
                      config.objective_scale);
  problem.cost().set_places(config.places);
  return problem;
}

std::unique_ptr<ControlLaw> make_rate_law(const Vehicle& vehicle, const ControllerConfig& config,
                                          Stopwatch stopwatch) {
  const auto actuate = [allocator = Allocator(vehicle), allocation = Allocation()](
                           const Eigen::Vector3d& input, ActuatorInput& result) mutable {
    result.wrench = {input[0], input[1], 0.0};
    result.yaw_rate = input[2];
    allocator.allocate_into(result.wrench, allocation);
    result.duty = allocation.duty;
  };
  return std::make_unique<NmpcLaw<RateProblem>>(CommandLevel::kRate, make_rate(vehicle, config), config,
                                                config.solver, actuate, std::move(stopwatch));
}

}  // namespace atmos
