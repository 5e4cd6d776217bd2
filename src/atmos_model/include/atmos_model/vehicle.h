// The vehicle file: the one source of geometry, masses and limits (format: config/vehicle/atmos.yaml, and the
// fields below).
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "atmos_model/strict_yaml.h"

namespace atmos {

// Most thrusters a vehicle may have: lets the force law work without allocating.
inline constexpr int kMaxThrusters = 32;

inline constexpr double kGravity = 9.81;  // m/s^2, as in every equation of docs/effects.md

struct Thruster {
  Eigen::Vector3d position_m;  // from the geometric centre, body FLU
  Eigen::Vector3d direction;   // unit vector of the force on the vehicle, body FLU
  double force_n;              // > 0, open alone
};

struct Pwm {
  double period_s;       // > 0
  double min_on_time_s;  // in [0, period_s]; shorter pulses are sent as 0
};

struct Vehicle {
  std::string name;
  double mass_kg;                 // > 0
  Eigen::Vector3d inertia_kg_m2;  // principal moments about the centre of mass, body axes, > 0
  Pwm pwm;
  std::vector<Thruster> thrusters;          // in command order; thruster k of a message is thrusters[k - 1]
  std::vector<Eigen::Vector2d> bearings_m;  // air bearings from the geometric centre, body FLU
  double radius_m;                          // of the upright cylinder that touches walls and other robots
  double height_m;
};

// Reads a vehicle file. Throws ConfigError with every fault.
Vehicle load_vehicle(const std::string& path);
// The same from an open file whose root has the key `vehicle`; faults are recorded there.
Vehicle read_vehicle(const ConfigMap& root);

}  // namespace atmos
