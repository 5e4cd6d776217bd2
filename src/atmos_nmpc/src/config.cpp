#include "atmos_nmpc/config.h"

#include <cmath>
#include <stdexcept>

#include "atmos_model/allocation.h"
#include "atmos_model/allocator.h"
#include "atmos_model/strict_yaml.h"
#include "atmos_nmpc/direct_allocation.h"
#include "atmos_nmpc/terminal_weight.h"
#include "atmos_nmpc/wrench.h"

namespace atmos {

namespace {

TrackingWeights read_weights(const ConfigMap& map) {
  TrackingWeights weights;
  weights.position = map.vector3("position", Bounds::positive());
  weights.velocity = map.vector3("velocity", Bounds::non_negative());
  weights.attitude = map.vector3("attitude", Bounds::positive());
  weights.rate = map.vector3("rate", Bounds::non_negative());
  weights.terminal_factor = map.number("terminal_factor", Bounds::non_negative());
  return weights;
}

SoftBounds read_bounds(const ConfigMap& map) {
  SoftBounds bounds;
  bounds.position = map.vector3("position_m", Bounds::positive());
  bounds.velocity = map.vector3("velocity_m_s", Bounds::positive());
  bounds.rate = map.vector3("rate_rad_s", Bounds::positive());
  bounds.linear = map.number("penalty_linear", Bounds::non_negative());
  bounds.quadratic = map.number("penalty_quadratic", Bounds::non_negative());
  bounds.width = map.number("penalty_width", Bounds::positive());
  return bounds;
}

SolverOptions read_solver(const ConfigMap& map, double period_s) {
  SolverOptions options;
  options.max_iterations = map.integer("max_iterations", 1, 3000);
  options.time_limit_s = map.number("time_limit_s", {0.0, period_s, true});
  if (const std::optional<ConfigMap> ipopt = map.optional_map("ipopt")) {
    for (const std::string& name : ipopt->keys()) {
      const std::string value = ipopt->text(name);
      const std::string fault = ipopt_option_fault(name, value);
      if (!fault.empty()) ipopt->fault(name, fault);
      options.ipopt[name] = value;
    }
  }
  return options;
}

LossLimits read_limits(const ConfigMap& map) {
  LossLimits limits;
  limits.odometry_fresh_s = map.number("odometry_fresh_s", Bounds::positive());
  limits.odometry_lost_s = map.number("odometry_lost_s", Bounds::positive());
  limits.plan_reuse_s = map.number("plan_reuse_s", Bounds::non_negative());
  limits.braking_s = map.number("braking_s", Bounds::non_negative());
  limits.rest_speed_m_s = map.number("rest_speed_m_s", Bounds::positive());
  limits.rest_rate_rad_s = map.number("rest_rate_rad_s", Bounds::positive());
  limits.braking_time_constant_s = map.number("braking_time_constant_s", Bounds::positive());
  if (limits.odometry_lost_s < limits.odometry_fresh_s)
    map.fault("odometry_lost_s", "must not be shorter than odometry_fresh_s");
  return limits;
}

ObserverConfig read_observer(const ConfigMap& map) {
  ObserverConfig observer;
  observer.position_noise_m = map.number("position_noise_m", Bounds::positive());
  observer.attitude_noise_rad = map.number("attitude_noise_rad", Bounds::positive());
  observer.acceleration_m_s2 = map.number("acceleration_m_s2", Bounds::positive());
  observer.angular_acceleration_rad_s2 = map.number("angular_acceleration_rad_s2", Bounds::positive());
  observer.thrust_error = map.number("thrust_error", Bounds::non_negative());
  observer.disturbance_drift_m_s2 = map.number("disturbance_drift_m_s2", Bounds::positive());
  observer.disturbance_drift_rad_s2 = map.number("disturbance_drift_rad_s2", Bounds::positive());
  observer.initial_disturbance_m_s2 = map.number("initial_disturbance_m_s2", Bounds::positive());
  observer.initial_disturbance_rad_s2 = map.number("initial_disturbance_rad_s2", Bounds::positive());
  observer.initial_velocity_m_s = map.number("initial_velocity_m_s", Bounds::positive());
  observer.initial_rate_rad_s = map.number("initial_rate_rad_s", Bounds::positive());
  observer.nis_gate = map.number("nis_gate", Bounds::positive());
  observer.reset_after = map.integer("reset_after", 1, 1000);
  return observer;
}

template <class Problem>
void check_terminal_weight(const Problem& problem, const ControllerConfig& config) {
  planar_terminal_weight(problem.dynamics(), config.weights, problem.input_weight(), 0.0);
}

}  // namespace

ControllerConfig load_controller(const std::string& path, const Vehicle& vehicle) {
  const ConfigFile file(path);
  const ConfigMap map = file.root().map("controller");
  const double period_s = vehicle.pwm.period_s;

  ControllerConfig config{};
  const bool wrench = map.choice("formulation", {"direct_allocation", "wrench"}) == "wrench";
  config.formulation = wrench ? FormulationKind::kWrench : FormulationKind::kDirectAllocation;
  config.attitude_error = map.choice("attitude_error", {"vector", "paper"}, "vector") == "paper"
                              ? AttitudeError::kPaper
                              : AttitudeError::kVector;

  const ConfigMap horizon = map.map("horizon");
  config.stages = horizon.integer("steps", 1, 500);
  config.step_s = horizon.number("step_s", Bounds::positive());
  // A plan is shifted by one stage a period; the first input is held for one period.
  if (std::abs(config.step_s - period_s) > 1e-9)
    horizon.fault("step_s", "must equal the vehicle's pwm.period_s, " + std::to_string(period_s));

  const ConfigMap weights = map.map("weights");
  config.weights = read_weights(weights);
  config.force_weight = weights.number("force", Bounds::positive());
  const ConfigMap inputs = map.map("inputs");
  if (wrench) {
    config.torque_weight = weights.number("torque", Bounds::positive());
    config.force_n = inputs.number("force_n", Bounds::positive());
    config.torque_n_m = inputs.number("torque_n_m", Bounds::positive());
  } else {
    config.pair_force_n = inputs.number("pair_force_n", Bounds::positive());
  }
  config.bounds = read_bounds(map.map("soft_bounds"));

  const ConfigMap solver = map.map("solver");
  config.objective_scale = solver.number("objective_scale", Bounds::positive());
  config.solver = read_solver(solver, period_s);
  config.feedback = solver.choice("feedback", {"advanced_step", "full"}, "advanced_step") == "full"
                        ? FeedbackKind::kFull
                        : FeedbackKind::kAdvancedStep;

  config.lead_s = map.map("timing").number("lead_s", Bounds::between(0.0, period_s));
  config.limits = read_limits(map.map("limits"));
  if (const std::optional<ConfigMap> observer = map.optional_map("observer"))
    config.observer = read_observer(*observer);

  try {
    if (!wrench && thruster_pairs(vehicle).size() != 4)
      map.fault("formulation", "direct_allocation needs a vehicle of four thruster pairs");
    if (wrench) Allocator{vehicle};
  } catch (const std::invalid_argument& error) {
    map.fault("formulation", error.what());
  }
  file.check();
  if (config.attitude_error == AttitudeError::kVector) {
    try {
      if (wrench) {
        check_terminal_weight(make_wrench(vehicle, config), config);
      } else {
        check_terminal_weight(make_direct_allocation(vehicle, config), config);
      }
    } catch (const std::invalid_argument& error) {
      weights.fault(error.what());
      file.check();
    }
  }
  return config;
}

}  // namespace atmos
