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

Pneumatics read_pneumatics(const ConfigMap& map) {
  Pneumatics air;
  air.bottles = map.integer("bottles", 1, 100);
  air.bottle_kg = map.number("bottle_kg", Bounds::positive());
  air.fill_bar = map.number("fill_bar", Bounds::positive());
  air.inoperable_below_bar = map.number("inoperable_below_bar", Bounds::positive());
  air.manifold_bar = map.number("manifold_bar", Bounds::positive());
  air.thruster_bar = map.number("thruster_bar", Bounds::positive());
  air.bearing_bar = map.number("bearing_bar", Bounds::positive());
  air.bearing_flow_kg_s = map.number("bearing_flow_kg_s", Bounds::between(0.0, 0.1), 0.0);
  air.rubbing_friction = map.number("rubbing_friction", Bounds::between(0.0, 1.0));
  if (air.inoperable_below_bar >= air.fill_bar) map.fault("inoperable_below_bar", "must be below fill_bar");
  return air;
}

Battery read_battery(const ConfigMap& map) {
  Battery battery;
  battery.cells = map.integer("cells", 1, 100);
  battery.capacity_ah = map.number("capacity_ah", Bounds::positive());
  battery.full_cell_v = map.number("full_cell_v", Bounds::positive());
  battery.empty_cell_v = map.number("empty_cell_v", Bounds::positive());
  battery.resistance_ohm = map.number("resistance_ohm", Bounds::non_negative());
  battery.idle_w = map.number("idle_w", Bounds::non_negative());
  battery.actuator_w = map.number("actuator_w", Bounds::non_negative());
  if (battery.empty_cell_v >= battery.full_cell_v) map.fault("empty_cell_v", "must be below full_cell_v");
  return battery;
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

  const bool propellers = map.has("propellers");
  const std::string actuators = propellers ? "propellers" : "thrusters";
  if (propellers) {
    vehicle.actuation = Actuation::kContinuous;
    vehicle.motor_time_constant_s = map.number("motor_time_constant_s", Bounds::between(0.0, 0.5));
    if (map.has("thrusters")) {
      map.skip("thrusters");
      map.fault("thrusters", "must not stand beside propellers: one actuation plate is mounted at a time");
    }
  }
  for (const ConfigMap& actuator : map.maps(actuators)) vehicle.thrusters.push_back(read_thruster(actuator));
  if (map.has(actuators) && vehicle.thrusters.empty()) map.fault(actuators, "must name at least one");
  if (vehicle.thrusters.size() > static_cast<std::size_t>(kMaxThrusters))
    map.fault(actuators, "must not name more than " + std::to_string(kMaxThrusters));

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
  if (const auto air = map.optional_map("pneumatics")) vehicle.pneumatics = read_pneumatics(*air);
  if (const auto battery = map.optional_map("battery")) vehicle.battery = read_battery(*battery);
  return vehicle;
}

Vehicle load_vehicle(const std::string& path) {
  const ConfigFile file(path);
  const Vehicle vehicle = read_vehicle(file.root());
  file.check();
  return vehicle;
}

}  // namespace atmos
