// The controller file (config/controller/*.yaml), read strictly.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "atmos_model/effects.h"
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

// What the controller decides: the paper's ctl:da, ctl:wrench, ctl:rate; kLqr and kPd are the baselines of
// linear_law.h.
enum class FormulationKind { kDirectAllocation, kWrench, kRate, kLqr, kPd };

// kLqr: weights of e' Q e + u' R u, in 1/m^2, s^2/m^2, 1/rad^2, s^2/rad^2, 1/N^2, 1/(N m)^2. kPd: gains in
// N/m, N s/m, N m/rad, N m s/rad.
struct LinearConfig {
  double position, velocity, attitude, rate;
  double force, torque;  // kLqr only
};

// What a measurement meets: a solution prepared for it, corrected to first order (advanced_step.h), or a
// solve.
enum class FeedbackKind { kAdvancedStep, kFull };

// Noise of the disturbance observer (docs/offset_free.md), standard deviations per axis.
struct ObserverConfig {
  double position_noise_m;  // of odometry's pose, > 0
  double attitude_noise_rad;
  double acceleration_m_s2;            // unknown acceleration that lasts one PWM period
  double angular_acceleration_rad_s2;  // likewise
  double thrust_error;                 // relative, of each open valve's thrust over one PWM period
  double disturbance_drift_m_s2;       // of d_v within one second (random walk)
  double disturbance_drift_rad_s2;     // of d_w
  double initial_disturbance_m_s2;     // before anything is known
  double initial_disturbance_rad_s2;
  double initial_velocity_m_s;
  double initial_rate_rad_s;
  double nis_gate;  // a pose of a greater normalised innovation squared (6 degrees of freedom) is refused
  int reset_after;  // refusals in a row after which the observer starts anew
};

struct ControllerConfig {
  FormulationKind formulation;
  int stages;           // N
  double step_s;        // the PWM period
  LinearConfig linear;  // kLqr, kPd; what belongs to a horizon is not used then
  AttitudeError attitude_error;
  TrackingWeights weights;
  double force_weight;   // R per thruster pair or body axis, 1/N^2
  double torque_weight;  // R of the torque, 1/(N m)^2; kWrench only
  double rate_weight;    // R of the rate, s^2/rad^2; kRate only
  double pair_force_n;   // kDirectAllocation: |u_j| <= this and the thrusters' own force
  double force_n;        // all but kDirectAllocation: |f_x|, |f_y| <= this
  double torque_n_m;     // kWrench, kLqr, kPd: |tau_z| <= this
  double rate_rad_s;     // kRate: |w_z| <= this
  bool polytope;         // kWrench: what the thrusters can give together as soft bounds of the wrench
  SoftBounds bounds;
  Places places;                    // where base_link must not be
  std::vector<std::string> robots;  // namespaces of others to keep away from
  double robot_distance_m;          // between their base_link and ours
  double objective_scale;
  SolverOptions solver;
  FeedbackKind feedback;
  double lead_s;  // odometry of this long before a period triggers its solve; 0 in lockstep
  LossLimits limits;
  std::vector<Effect> model;               // what a model.yaml adds to the vehicle; empty: the nominal one
  std::optional<ObserverConfig> observer;  // offset-free: with the estimated disturbance in the model
};

// Reads a controller file for a vehicle, and the model file it names. Throws ConfigError with every fault.
ControllerConfig load_controller(const std::string& path, const Vehicle& vehicle);

}  // namespace atmos
