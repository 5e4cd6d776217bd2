#include "atmos_model/vehicle.h"

#include <cmath>

namespace atmos {

namespace {

// Three bearings on a circle, as every ATMOS is built (docs/effects.md).
std::vector<Eigen::Vector2d> default_bearings() {
  constexpr double kRadius = 0.15;
  std::vector<Eigen::Vector2d> bearings;
  for (const double degrees : {90.0, 210.0, 330.0}) {
    const double angle = degrees * M_PI / 180.0;
    bearings.emplace_back(kRadius * std::cos(angle), kRadius * std::sin(angle));
  }
  return bearings;
}

Thruster read_thruster(const ConfigMap& map) {
  Thruster thruster;
  thruster.position_m = map.vector3("position_m");
  thruster.direction = map.vector3("direction");
  thruster.force_n = map.number("force_n", Bounds::positive());
  const double length = thruster.direction.norm();
  if (length < 1e-6) {
    map.fault("direction", "must not be the zero vector");
    thruster.direction = Eigen::Vector3d::UnitX();
  } else {
    thruster.direction /= length;
  }
  return thruster;
}

}  // namespace

Vehicle read_vehicle(const ConfigMap& root) {
  const ConfigMap map = root.map("vehicle");
  Vehicle vehicle;
  vehicle.name = map.text("name");
  vehicle.mass_kg = map.number("mass_kg", Bounds::positive());
  vehicle.inertia_kg_m2 = map.vector3("inertia_kg_m2", Bounds::positive());

  const ConfigMap pwm = map.map("pwm");
  vehicle.pwm.period_s = pwm.number("period_s", Bounds::between(0.002, 10.0));
  vehicle.pwm.min_on_time_s = pwm.number("min_on_time_s", Bounds::non_negative());
  if (vehicle.pwm.min_on_time_s > vehicle.pwm.period_s)
    pwm.fault("min_on_time_s", "must not be longer than period_s");

  for (const ConfigMap& thruster : map.maps("thrusters"))
    vehicle.thrusters.push_back(read_thruster(thruster));
  if (map.has("thrusters") && vehicle.thrusters.empty())
    map.fault("thrusters", "must name at least one thruster");
  if (vehicle.thrusters.size() > static_cast<std::size_t>(kMaxThrusters))
    map.fault("thrusters", "must not name more than " + std::to_string(kMaxThrusters) + " thrusters");

  vehicle.bearings_m = default_bearings();
  if (map.has("bearings_m")) {
    vehicle.bearings_m.clear();
    for (const std::vector<double>& row : map.rows("bearings_m")) {
      if (row.size() == 2) vehicle.bearings_m.emplace_back(row[0], row[1]);
    }
    if (vehicle.bearings_m.size() != 3) map.fault("bearings_m", "must be three rows [x, y]");
  }
  vehicle.radius_m = map.number("radius_m", Bounds::positive(), 0.2);
  vehicle.height_m = map.number("height_m", Bounds::positive(), 0.5);
  return vehicle;
}

Vehicle load_vehicle(const std::string& path) {
  const ConfigFile file(path);
  const Vehicle vehicle = read_vehicle(file.root());
  file.check();
  return vehicle;
}

}  // namespace atmos
