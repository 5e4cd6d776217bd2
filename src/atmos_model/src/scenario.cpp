#include "atmos_model/scenario.h"

#include <cmath>

namespace atmos {

namespace {

constexpr double kRadiansPerDegree = M_PI / 180.0;

SetPoint read_pose(const ConfigMap& map) {
  SetPoint pose{};
  pose.x_m = map.number("x_m");
  pose.y_m = map.number("y_m");
  pose.yaw_rad = map.number("yaw_deg", Bounds::between(-360.0, 360.0)) * kRadiansPerDegree;
  return pose;
}

MocapSettings read_mocap(const ConfigMap& map) {
  MocapSettings mocap;
  mocap.rate_hz = map.number("rate_hz", Bounds::between(1.0, 1000.0));
  mocap.noise_m = map.number("noise_m", Bounds::non_negative());
  mocap.noise_rad = map.number("noise_rad", Bounds::non_negative());
  mocap.publish_delay_s = map.number("publish_delay_s", Bounds::between(0.0, 1.0), 0.0);
  mocap.dropout_probability = map.number("dropout_probability", Bounds::between(0.0, 1.0), 0.0);
  for (const ConfigMap& dropout : map.maps("dropouts", false)) {
    mocap.dropouts.push_back({dropout.number("start_s", Bounds::non_negative()),
                              dropout.number("duration_s", Bounds::positive())});
  }
  mocap.distortion_m = map.number("distortion_m", Bounds::non_negative(), 0.0);
  mocap.stamp_jitter_s = map.number("stamp_jitter_s", Bounds::between(0.0, 0.01), 0.0);
  return mocap;
}

LabSettings read_lab(const ConfigMap& map) {
  LabSettings lab;
  lab.thrust_scatter = map.number("thrust_scatter", Bounds::between(0.0, 0.5), 0.0);
  lab.slow_force_n = map.number("slow_force_n", Bounds::non_negative(), 0.0);
  lab.slow_torque_n_m = map.number("slow_torque_n_m", Bounds::non_negative(), 0.0);
  lab.slow_time_s = map.number("slow_time_s", Bounds::positive(), 4.0);
  return lab;
}

// A fit may find a negative delay, where clocks disagree; a simulation knows no future.
void check_causality(const ConfigMap& root) {
  for (const ConfigMap& item : root.maps("effects", false)) {
    if (item.faulty("kind") || item.faulty("parameters")) continue;
    const std::string kind = item.text("kind");
    if (kind != CommandDelay::kKind && kind != MocapLatency::kKind) continue;
    const ConfigMap parameters = item.map("parameters");
    if (parameters.number("delay_s") < 0.0)
      parameters.fault("delay_s", "must not be negative in a scenario: a simulation knows no future");
  }
}

}  // namespace

std::vector<SetPoint> read_set_points(const ConfigMap& root, double latest_s) {
  std::vector<SetPoint> set_points;
  double previous_s = -1.0;
  for (const ConfigMap& map : root.maps("setpoints")) {
    SetPoint point = read_pose(map);
    point.time_s = map.number("time_s", Bounds::between(0.0, latest_s));
    if (set_points.empty() && point.time_s != 0.0) map.fault("time_s", "must be 0 for the first set-point");
    if (point.time_s <= previous_s) map.fault("time_s", "must be later than that of the set-point before it");
    if (!map.faulty("time_s")) previous_s = point.time_s;
    set_points.push_back(point);
  }
  if (set_points.empty()) root.fault("setpoints", "must name at least one set-point");
  return set_points;
}

Scenario load_scenario(const std::string& path) {
  const ConfigFile file(path);
  const ConfigMap root = file.root();
  Scenario scenario;
  scenario.path = path;
  scenario.name = root.text("name");
  scenario.vehicle_path = file.resolve(root.text("vehicle"));
  scenario.controller_path = file.resolve(root.text("controller"));
  scenario.duration_s = root.number("duration_s", Bounds::positive());
  scenario.seed = static_cast<std::uint32_t>(root.integer("seed", 0, 2147483647));
  scenario.step_s = root.number("step_s", Bounds{0.0, 0.001, true}, 0.001);
  scenario.start = read_pose(root.map("start"));
  const double latest_s =
      root.faulty("duration_s") ? std::numeric_limits<double>::infinity() : scenario.duration_s;
  scenario.set_points = read_set_points(root, latest_s);
  scenario.mocap = read_mocap(root.map("mocap"));
  if (const std::optional<ConfigMap> lab = root.optional_map("lab")) scenario.lab = read_lab(*lab);

  const auto faults_of = [](const auto& read) {
    try {
      read();
    } catch (const ConfigError& error) {
      return error.faults();
    }
    return std::vector<ConfigFault>{};
  };
  std::vector<ConfigFault> vehicle_faults;
  if (!root.faulty("vehicle"))
    vehicle_faults = faults_of([&] { scenario.vehicle = load_vehicle(scenario.vehicle_path); });
  const bool vehicle_known = !root.faulty("vehicle") && vehicle_faults.empty();
  scenario.effects = read_effects(root, vehicle_known ? &scenario.vehicle : nullptr);
  check_causality(root);

  std::vector<ConfigFault> faults = faults_of([&] { file.check(); });
  faults.insert(faults.end(), vehicle_faults.begin(), vehicle_faults.end());
  if (!faults.empty()) throw ConfigError(faults);
  return scenario;
}

}  // namespace atmos
