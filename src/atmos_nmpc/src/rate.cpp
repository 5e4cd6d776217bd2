#include "atmos_nmpc/rate.h"

namespace atmos {

RateProblem make_rate(const Vehicle& vehicle, const ControllerConfig& config) {
  const Eigen::Vector3d limit(config.force_n, config.force_n, config.rate_rad_s);
  return RateProblem(RateStep(vehicle.mass_kg, config.step_s),
                     TrackingCost(config.attitude_error, config.weights, config.bounds), config.stages,
                     {config.force_weight, config.force_weight, config.rate_weight}, -limit, limit,
                     config.objective_scale);
}

}  // namespace atmos
