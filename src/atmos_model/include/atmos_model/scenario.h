// A scenario: what is flown, with which vehicles and controllers, on which floor, between which walls, seen
// by which mocap.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "atmos_model/effects.h"
#include "atmos_model/vehicle.h"

namespace atmos {

struct SetPoint {
  double time_s;  // after the start of the flight, ascending, first at 0
  double x_m, y_m;
  double yaw_rad;  // written as yaw_deg
};

// A closed curve to follow, from rest to rest: laps of a circle (clockwise: negative) or of a figure eight.
struct TrajectorySettings {
  enum class Shape { kCircle, kFigureEight };
  double time_s;  // start, after the start of the flight
  double duration_s;
  Shape shape;
  double center_x_m, center_y_m;
  double size_x_m, size_y_m;  // half the extent along world x and y
  double laps;
  double yaw_rad;    // at the start, written as yaw_deg
  double yaw_turns;  // how often the robot turns about itself on the way
};

// Frames are lost in this stretch of the flight.
struct Dropout {
  double start_s;  // after the start of the flight
  double duration_s;
};

struct MocapSettings {
  double rate_hz = 100.0;
  double noise_m = 0.0;  // standard deviation per axis
  double noise_rad = 0.0;
  double publish_delay_s = 0.0;      // from exposure (the stamp) to publication; real time only
  double dropout_probability = 0.0;  // of each frame by itself
  std::vector<Dropout> dropouts;
  double distortion_m = 0.0;    // standard deviation over the floor of a smooth, steady error of position
  double stamp_jitter_s = 0.0;  // standard deviation of a stamp about the exposure
};

// What every lab has and no model describes. It makes no effect: a diagnosis has to live with it.
struct LabSettings {
  double thrust_scatter = 0.0;   // relative standard deviation from pulse to pulse, each valve by itself
  double slow_force_n = 0.0;     // standard deviation per axis (world) of a random force that drifts
  double slow_torque_n_m = 0.0;  // the same of a torque
  double slow_time_s = 4.0;      // correlation time of both
};

// Air supply of a flight. Without it the supply has no end.
struct SupplySettings {
  int open_bottles = 1;   // selected at the manifold
  bool tethered = false;  // fed through a hose: the bottles stay full; the effects say how the hose pulls
};

// Fixed things that robots bump into; upright, higher than a robot. World frame.
struct Walls {
  Eigen::Vector2d min_m, max_m;  // inner faces
};
struct Box {
  Eigen::Vector2d center_m, size_m;
  double yaw_rad;  // written as yaw_deg
};
struct Cylinder {
  Eigen::Vector2d center_m;
  double radius_m;
};

struct WorldSettings {
  std::optional<Walls> walls;
  std::vector<Box> boxes;
  std::vector<Cylinder> cylinders;
  double restitution = 0.47;  // of every contact, as the public two-robot planner of the lab assumes
  double friction = 0.0;      // Coulomb, of every contact
};

// The flight of one robot.
struct Scenario {
  std::string name;
  std::string robot;         // its namespace where the file lists robots; else empty
  std::string path;          // the file it was read from
  std::string vehicle_path;  // absolute or relative to the working directory
  std::string controller_path;
  double duration_s;
  std::uint32_t seed;
  double step_s;   // simulator step
  SetPoint start;  // time_s unused
  std::vector<SetPoint> set_points;
  std::vector<TrajectorySettings> trajectories;  // each holds from its start on, until a later set-point
  MocapSettings mocap;
  LabSettings lab;
  std::vector<Effect> effects;
  Vehicle vehicle;
  std::optional<SupplySettings> pneumatics;
  WorldSettings world;  // shared by all robots of the file
};

// Reads the list `setpoints` of `root`; faults are recorded there. No set-point may be later than latest_s.
std::vector<SetPoint> read_set_points(const ConfigMap& root,
                                      double latest_s = std::numeric_limits<double>::infinity());

// Reads a scenario and the vehicles it names; controller files are left to the controllers. One entry per
// robot, in the order of the list `robots`, or the only one. An entry of `robots` has its name, start and
// set-points, and may have a vehicle, controller, effects and pneumatics of its own in place of the file's.
// Throws ConfigError with every fault.
std::vector<Scenario> load_fleet(const std::string& path);
// The same from an open file.
std::vector<Scenario> read_fleet(const ConfigFile& file);
// The flight of the robot with that name; where the file lists no robots, of the only one, whatever its name.
Scenario load_scenario(const std::string& path, const std::string& robot = "");

}  // namespace atmos
