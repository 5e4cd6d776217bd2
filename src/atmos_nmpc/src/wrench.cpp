#include "atmos_nmpc/wrench.h"

namespace atmos {

WrenchProblem make_wrench(const Vehicle& vehicle, const ControllerConfig& config) {
  Eigen::Matrix3d D = Eigen::Matrix3d::Zero(), L = Eigen::Matrix3d::Zero();
  D(0, 0) = D(1, 1) = 1.0;
  L(2, 2) = 1.0;
  const Eigen::Vector3d limit(config.force_n, config.force_n, config.torque_n_m);
  return WrenchProblem(RigidBodyStep<3>(D, L, vehicle.mass_kg, vehicle.inertia_kg_m2, config.step_s),
                       TrackingCost(config.attitude_error, config.weights, config.bounds), config.stages,
                       {config.force_weight, config.force_weight, config.torque_weight}, -limit, limit,
                       config.objective_scale);
}

}  // namespace atmos
