// The vehicle file: the one source of geometry, masses and limits (format: config/vehicle/atmos.yaml, and the
// fields below).
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "atmos_model/strict_yaml.h"
#include "atmos_model/valve_schedule.h"

namespace atmos {

// Most thrusters a vehicle may have: lets the force law work without allocating.
inline constexpr int kMaxThrusters = 32;

inline constexpr double kGravity = 9.81;  // m/s^2, as in every equation of docs/effects.md

struct Thruster {
  Eigen::Vector3d position_m;  // from the geometric centre, body FLU
  Eigen::Vector3d direction;   // unit vector of the force on the vehicle, body FLU
  double force_n;              // > 0, open alone; of a propeller, in both senses
};

struct Pwm {
  double period_s;       // > 0
  double min_on_time_s;  // in [0, period_s]; shorter pulses are sent as 0
};

// Compressed air on board. Mass and pressure of a bottle fall together (isothermal).
struct Pneumatics {
  int bottles;       // alike; a scenario selects how many are open at the manifold
  double bottle_kg;  // air in one of them at fill_bar
  double fill_bar;
  double inoperable_below_bar;  // bottle pressure at which thrusters and bearings fail
  double manifold_bar;          // regulators: bottles to manifold, then to thrusters and to bearings
  double thruster_bar;
  double bearing_bar;
  double bearing_flow_kg_s;  // of all bearings together
  double rubbing_friction;   // coefficient of a bearing without air
};

struct Battery {
  int cells;  // in series
  double capacity_ah;
  double full_cell_v, empty_cell_v;  // open circuit; linear in between
  double resistance_ohm;             // of the pack
  double idle_w;                     // computers, sensors, radio
  double actuator_w;                 // one open valve; a propeller at full thrust (power ~ |thrust|^1.5)
};

struct Vehicle {
  std::string name;
  double mass_kg;                 // > 0
  Eigen::Vector3d inertia_kg_m2;  // principal moments about the centre of mass, body axes, > 0
  Pwm pwm;
  Actuation actuation = Actuation::kOnOff;  // kContinuous: the thrusters are propellers that push both ways
  std::vector<Thruster> thrusters;          // in command order; thruster k of a message is thrusters[k - 1]
  double motor_time_constant_s = 0.0;       // propellers: thrust follows its command as thrust_rise does
  std::vector<Eigen::Vector2d> bearings_m;  // air bearings from the geometric centre, body FLU
  double radius_m;                          // of the upright cylinder that touches walls and other robots
  double height_m;
  std::optional<Pneumatics> pneumatics;
  std::optional<Battery> battery;
};

// Reads a vehicle file. Throws ConfigError with every fault.
Vehicle load_vehicle(const std::string& path);
// The same from an open file whose root has the key `vehicle`; faults are recorded there.
Vehicle read_vehicle(const ConfigMap& root);

}  // namespace atmos
