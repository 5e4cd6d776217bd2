// The controller file (config/controller/*.yaml), read strictly.
#pragma once

#include <string>

#include "atmos_model/vehicle.h"
#include "atmos_nmpc/solver.h"
#include "atmos_nmpc/tracking_cost.h"

namespace atmos {

// Ages and times of the loss rules (docs/architecture.md), s.
struct LossLimits {
  double odometry_fresh_s;  // older odometry is marked as predicted
  double odometry_lost_s;   // older odometry: valves closed
  double plan_reuse_s;      // a failing solver: the last plan at most this long
  double braking_s;         // then braking at most this long
  double rest_speed_m_s;    // slower than both: braking ends, valves closed
  double rest_rate_rad_s;
  double braking_time_constant_s;  // braking asks for -m v / this, within the thrusters' limits
};

struct ControllerConfig {
  int stages;     // N
  double step_s;  // the PWM period
  AttitudeError attitude_error;
  TrackingWeights weights;
  double force_weight;  // R per thruster pair, 1/N^2
  double pair_force_n;  // |u_j| <= this and the thrusters' own force
  SoftBounds bounds;
  double objective_scale;
  SolverOptions solver;
  double lead_s;  // odometry of this long before a period triggers its solve; 0 in lockstep
  LossLimits limits;
};

// Reads a controller file for a vehicle. Throws ConfigError with every fault.
ControllerConfig load_controller(const std::string& path, const Vehicle& vehicle);

}  // namespace atmos
