#include "atmos_nmpc/config.h"

#include <cmath>
#include <limits>
#include <stdexcept>

#include "atmos_model/allocation.h"
#include "atmos_model/allocator.h"
#include "atmos_model/strict_yaml.h"
#include "atmos_nmpc/direct_allocation.h"
#include "atmos_nmpc/flight_model.h"
#include "atmos_nmpc/linear_law.h"
#include "atmos_nmpc/rate.h"
#include "atmos_nmpc/terminal_weight.h"
#include "atmos_nmpc/wrench.h"

namespace atmos {

namespace {

// `rate_is_state`: not where the rate is an input.
TrackingWeights read_weights(const ConfigMap& map, bool rate_is_state) {
  TrackingWeights weights;
  weights.position = map.vector3("position", Bounds::positive());
  weights.velocity = map.vector3("velocity", Bounds::non_negative());
  weights.attitude = map.vector3("attitude", Bounds::positive());
  weights.rate.setZero();
  if (rate_is_state) weights.rate = map.vector3("rate", Bounds::non_negative());
  weights.terminal_factor = map.number("terminal_factor", Bounds::non_negative());
  return weights;
}

SoftBounds read_bounds(const ConfigMap& map, bool rate_is_state) {
  SoftBounds bounds;
  bounds.position = map.vector3("position_m", Bounds::positive());
  bounds.velocity = map.vector3("velocity_m_s", Bounds::positive());
  bounds.rate.setConstant(std::numeric_limits<double>::max());
  if (rate_is_state) bounds.rate = map.vector3("rate_rad_s", Bounds::positive());
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

// `keep_in_m`: corners of a convex area, counter-clockwise.
Places read_places(const ConfigMap& map) {
  Places places;
  if (map.has("keep_in_m")) {
    const std::vector<std::vector<double>> corners = map.rows("keep_in_m");
    const std::size_t n = corners.size();
    bool convex = n >= 3;
    for (std::size_t i = 0; convex && i < n; ++i) convex = corners[i].size() == 2;
    for (std::size_t i = 0; convex && i < n; ++i) {
      const Eigen::Vector2d a(corners[i][0], corners[i][1]);
      const Eigen::Vector2d b(corners[(i + 1) % n][0], corners[(i + 1) % n][1]);
      const Eigen::Vector2d outward(b.y() - a.y(), a.x() - b.x());
      const double length = outward.norm();
      if (length > 0.0) places.walls.push_back({outward / length, outward.dot(a) / length});
      for (const std::vector<double>& corner : corners)
        convex = convex && length > 0.0 && outward.dot(Eigen::Vector2d(corner[0], corner[1]) - a) < 1e-9;
    }
    if (!convex) map.fault("keep_in_m", "must be the corners of a convex area, counter-clockwise");
  }
  if (map.has("penalty_quadratic"))
    places.penalty_quadratic = map.number("penalty_quadratic", Bounds::positive());
  for (const ConfigMap& obstacle : map.maps("obstacles", false))
    places.obstacles.push_back(
        {obstacle.vector2("center_m"), obstacle.number("radius_m", Bounds::positive())});
  return places;
}

// What only a controller with a horizon has.
void read_horizon(const ConfigMap& map, double period_s, ControllerConfig& config) {
  const bool wrench = config.formulation == FormulationKind::kWrench;
  const bool rate = config.formulation == FormulationKind::kRate;
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
  config.weights = read_weights(weights, !rate);
  config.force_weight = weights.number("force", Bounds::positive());
  const ConfigMap inputs = map.map("inputs");
  if (wrench) {
    config.torque_weight = weights.number("torque", Bounds::positive());
    config.polytope = inputs.flag("polytope", false);
    config.force_n = inputs.number("force_n", Bounds::positive());
    config.torque_n_m = inputs.number("torque_n_m", Bounds::positive());
  } else if (rate) {
    config.rate_weight = weights.number("rate_input", Bounds::positive());
    config.force_n = inputs.number("force_n", Bounds::positive());
    config.rate_rad_s = inputs.number("rate_rad_s", Bounds::positive());
  } else {
    config.pair_force_n = inputs.number("pair_force_n", Bounds::positive());
  }
  config.bounds = read_bounds(map.map("soft_bounds"), !rate);

  if (const std::optional<ConfigMap> places = map.optional_map("places")) {
    config.places = read_places(*places);
    if (places->has("robots")) {
      config.robots = places->texts("robots");
      config.robot_distance_m = places->number("robot_distance_m", Bounds::positive());
    }
  }

  const ConfigMap solver = map.map("solver");
  config.objective_scale = solver.number("objective_scale", Bounds::positive());
  config.solver = read_solver(solver, period_s);
  config.feedback = solver.choice("feedback", {"advanced_step", "full"}, "advanced_step") == "full"
                        ? FeedbackKind::kFull
                        : FeedbackKind::kAdvancedStep;
}

void read_linear(const ConfigMap& map, double period_s, ControllerConfig& config) {
  const bool lqr = config.formulation == FormulationKind::kLqr;
  const ConfigMap numbers = map.map(lqr ? "weights" : "gains");
  config.linear.position = numbers.number(lqr ? "position" : "position_n_m", Bounds::positive());
  config.linear.velocity = numbers.number(lqr ? "velocity" : "velocity_n_s_m", Bounds::non_negative());
  config.linear.attitude = numbers.number(lqr ? "attitude" : "attitude_n_m", Bounds::positive());
  config.linear.rate = numbers.number(lqr ? "rate" : "rate_n_m_s", Bounds::non_negative());
  if (lqr) {
    config.linear.force = numbers.number("force", Bounds::positive());
    config.linear.torque = numbers.number("torque", Bounds::positive());
  }
  const ConfigMap inputs = map.map("inputs");
  config.force_n = inputs.number("force_n", Bounds::positive());
  config.torque_n_m = inputs.number("torque_n_m", Bounds::positive());
  config.stages = 1;
  config.step_s = period_s;
  config.feedback = FeedbackKind::kFull;
}

template <class Problem>
void check_terminal_weight(const Problem& problem, const ControllerConfig& config) {
  planar_terminal_weight(problem.dynamics(), config.weights, problem.input_weight(), 0.0);
}

}  // namespace

ControllerConfig load_controller(const std::string& path, const Vehicle& nominal) {
  const ConfigFile file(path);
  const ConfigMap map = file.root().map("controller");
  const double period_s = nominal.pwm.period_s;

  ControllerConfig config{};
  if (map.has("model")) {
    const std::string model = map.text("model");
    if (!map.faulty("model")) config.model = load_model(file.resolve(model), nominal);
  }
  const Vehicle vehicle = config.model.empty() ? nominal : FlightModel(nominal, config.model).vehicle();
  const std::string formulation =
      map.choice("formulation", {"direct_allocation", "wrench", "rate", "lqr", "pd"});
  const bool wrench = formulation == "wrench", rate = formulation == "rate";
  const bool linear = formulation == "lqr" || formulation == "pd";
  config.formulation = wrench                 ? FormulationKind::kWrench
                       : rate                 ? FormulationKind::kRate
                       : formulation == "lqr" ? FormulationKind::kLqr
                       : linear               ? FormulationKind::kPd
                                              : FormulationKind::kDirectAllocation;
  if (linear) {
    read_linear(map, period_s, config);
  } else {
    read_horizon(map, period_s, config);
  }

  config.lead_s = map.map("timing").number("lead_s", Bounds::between(0.0, period_s));
  config.limits = read_limits(map.map("limits"));
  if (const std::optional<ConfigMap> observer = map.optional_map("observer"))
    config.observer = read_observer(*observer);

  try {
    if (config.formulation == FormulationKind::kDirectAllocation && thruster_pairs(vehicle).size() != 4)
      map.fault("formulation", "direct_allocation needs a vehicle of four thruster pairs");
    Allocator{vehicle};
  } catch (const std::invalid_argument& error) {
    map.fault("formulation", error.what());
  }
  file.check();
  if (linear || config.attitude_error == AttitudeError::kVector) {
    try {
      if (linear) {
        linear_gain(vehicle, config);
      } else if (wrench) {
        check_terminal_weight(make_wrench(vehicle, config), config);
      } else if (rate) {
        check_terminal_weight(make_rate(vehicle, config), config);
      } else {
        check_terminal_weight(make_direct_allocation(vehicle, config), config);
      }
    } catch (const std::invalid_argument& error) {
      map.fault("weights", error.what());
      file.check();
    }
  }
  return config;
}

}  // namespace atmos
