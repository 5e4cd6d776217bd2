#include "atmos_model/scenario.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <variant>

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

TrajectorySettings read_trajectory(const ConfigMap& map, double latest_s) {
  using Shape = TrajectorySettings::Shape;
  TrajectorySettings settings{};
  // Who flies it must have it before it starts.
  settings.time_s = map.number("time_s", Bounds::between(1.0, latest_s));
  settings.duration_s = map.number("duration_s", Bounds::between(1.0, 3600.0));
  settings.shape =
      map.choice("shape", {"circle", "figure_eight"}) == "circle" ? Shape::kCircle : Shape::kFigureEight;
  const Eigen::Vector2d center = map.vector2("center_m"), size = map.vector2("size_m", Bounds::positive());
  settings.center_x_m = center.x();
  settings.center_y_m = center.y();
  settings.size_x_m = size.x();
  settings.size_y_m = size.y();
  settings.laps = map.number("laps", Bounds::between(-100.0, 100.0));
  settings.yaw_rad = map.number("yaw_deg", Bounds::between(-360.0, 360.0)) * kRadiansPerDegree;
  settings.yaw_turns = map.number("yaw_turns", Bounds::between(-100.0, 100.0), 0.0);
  return settings;
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

namespace {

SupplySettings read_supply(const ConfigMap& map) {
  SupplySettings supply;
  supply.open_bottles = map.integer("open_bottles", 1, 100);
  supply.tethered = map.flag("tethered", false);
  return supply;
}

WorldSettings read_world(const ConfigMap& map) {
  WorldSettings world;
  if (const auto walls = map.optional_map("walls")) {
    world.walls = Walls{walls->vector2("min_m"), walls->vector2("max_m")};
    if (!walls->faulty("min_m") && !walls->faulty("max_m") &&
        (world.walls->min_m.array() >= world.walls->max_m.array()).any())
      walls->fault("max_m", "must be greater than min_m on both axes");
  }
  for (const ConfigMap& box : map.maps("boxes", false)) {
    world.boxes.push_back({box.vector2("center_m"), box.vector2("size_m", Bounds::positive()),
                           box.number("yaw_deg", Bounds::between(-360.0, 360.0), 0.0) * kRadiansPerDegree});
  }
  for (const ConfigMap& cylinder : map.maps("cylinders", false))
    world.cylinders.push_back(
        {cylinder.vector2("center_m"), cylinder.number("radius_m", Bounds::positive())});
  world.restitution = map.number("restitution", Bounds::between(0.0, 1.0), world.restitution);
  world.friction = map.number("friction", Bounds::between(0.0, 10.0), world.friction);
  return world;
}

// The gas that leaves bottles makes the robot lighter; what comes through a hose does not.
void apply_supply(const ConfigMap& map, Scenario& scenario) {
  if (!scenario.pneumatics || !scenario.vehicle.pneumatics) return;
  std::vector<Effect>& effects = scenario.effects;
  const auto depletion = std::find_if(effects.begin(), effects.end(), [](const Effect& effect) {
    return std::holds_alternative<MassDepletion>(effect);
  });
  if (scenario.pneumatics->tethered) {
    if (depletion != effects.end()) map.fault("pneumatics", "tethered does not go with mass_depletion");
    const bool pulled = std::any_of(effects.begin(), effects.end(), [](const Effect& effect) {
      return std::holds_alternative<Tether>(effect);
    });
    if (!pulled) map.fault("pneumatics", "tethered needs an effect of the kind tether: its hose pulls");
    scenario.vehicle.pneumatics->bearing_flow_kg_s = 0.0;
    effects.push_back(MassDepletion{{}, 0.0});
  } else if (depletion == effects.end()) {
    effects.push_back(MassDepletion{});
  }
  std::stable_sort(effects.begin(), effects.end(),
                   [](const Effect& a, const Effect& b) { return a.index() < b.index(); });
}

// Reads scenarios and the vehicles they name, each vehicle file once, with the faults of them all.
class FleetReader {
 public:
  explicit FleetReader(const ConfigFile& file) : file_(file) {}

  std::vector<Scenario> read() {
    const ConfigMap root = file_.root();
    Scenario common;
    common.path = file_.path();
    common.name = root.text("name");
    common.duration_s = root.number("duration_s", Bounds::positive());
    common.seed = static_cast<std::uint32_t>(root.integer("seed", 0, 2147483647));
    common.step_s = root.number("step_s", Bounds{0.0, 0.001, true}, 0.001);
    common.mocap = read_mocap(root.map("mocap"));
    if (const auto lab = root.optional_map("lab")) common.lab = read_lab(*lab);
    if (const auto world = root.optional_map("world")) common.world = read_world(*world);
    latest_s_ = root.faulty("duration_s") ? std::numeric_limits<double>::infinity() : common.duration_s;

    std::vector<Scenario> fleet;
    if (root.has("robots")) {
      for (const ConfigMap& robot : root.maps("robots")) {
        fleet.push_back(common);
        read_robot(robot, root, fleet.back());
        fleet.back().seed += static_cast<std::uint32_t>(fleet.size() - 1);
        read_name(robot, fleet);
      }
      if (fleet.empty()) root.fault("robots", "must name at least one robot");
      for (const char* key : {"vehicle", "controller"}) {
        if (root.has(key)) root.text(key);  // every robot may have its own
      }
      read_effects(root, nullptr);
      if (const auto supply = root.optional_map("pneumatics")) read_supply(*supply);
    } else {
      fleet.push_back(common);
      read_robot(root, root, fleet.back());
    }
    finish();
    return fleet;
  }

 private:
  void read_robot(const ConfigMap& map, const ConfigMap& root, Scenario& scenario) {
    const auto owner = [&](const char* key) -> const ConfigMap& { return map.has(key) ? map : root; };
    scenario.vehicle_path = file_.resolve(owner("vehicle").text("vehicle"));
    scenario.controller_path = file_.resolve(owner("controller").text("controller"));
    scenario.start = read_pose(map.map("start"));
    scenario.set_points = read_set_points(map, latest_s_);
    for (const ConfigMap& trajectory : map.maps("trajectories", false))
      scenario.trajectories.push_back(read_trajectory(trajectory, latest_s_));
    const bool vehicle_known = !owner("vehicle").faulty("vehicle") && read_vehicle_file(scenario);
    scenario.effects = read_effects(owner("effects"), vehicle_known ? &scenario.vehicle : nullptr);
    check_causality(owner("effects"));
    const ConfigMap& air = owner("pneumatics");
    const auto supply = air.optional_map("pneumatics");
    if (!supply) return;
    scenario.pneumatics = read_supply(*supply);
    if (!vehicle_known || supply->faulty("open_bottles")) return;
    if (!scenario.vehicle.pneumatics)
      air.fault("pneumatics", "needs a vehicle that has pneumatics");
    else if (scenario.pneumatics->open_bottles > scenario.vehicle.pneumatics->bottles)
      supply->fault("open_bottles", "must not be more than the vehicle has");
    apply_supply(air, scenario);
  }

  // Names are namespaces of nodes and topics.
  void read_name(const ConfigMap& robot, std::vector<Scenario>& fleet) {
    std::string& name = fleet.back().robot;
    name = robot.text("name");
    if (robot.faulty("name")) return;
    const bool valid =
        std::isalpha(static_cast<unsigned char>(name[0])) &&
        std::all_of(name.begin(), name.end(), [](unsigned char c) { return std::isalnum(c) || c == '_'; });
    if (!valid) robot.fault("name", "must be a letter followed by letters, digits and underscores");
    if (std::any_of(fleet.begin(), fleet.end() - 1, [&](const Scenario& s) { return s.robot == name; }))
      robot.fault("name", "is the name of another robot");
  }

  bool read_vehicle_file(Scenario& scenario) {
    try {
      scenario.vehicle = load_vehicle(scenario.vehicle_path);
      return true;
    } catch (const ConfigError& error) {
      for (const ConfigFault& fault : error.faults()) {
        const auto same = [&](const ConfigFault& f) {
          return f.file == fault.file && f.line == fault.line && f.key == fault.key;
        };
        if (std::none_of(vehicle_faults_.begin(), vehicle_faults_.end(), same))
          vehicle_faults_.push_back(fault);
      }
      return false;
    }
  }

  void finish() const {
    std::vector<ConfigFault> faults;
    try {
      file_.check();
    } catch (const ConfigError& error) {
      faults = error.faults();
    }
    faults.insert(faults.end(), vehicle_faults_.begin(), vehicle_faults_.end());
    if (!faults.empty()) throw ConfigError(faults);
  }

  const ConfigFile& file_;
  double latest_s_ = std::numeric_limits<double>::infinity();
  std::vector<ConfigFault> vehicle_faults_;
};

}  // namespace

std::vector<Scenario> read_fleet(const ConfigFile& file) { return FleetReader(file).read(); }

std::vector<Scenario> load_fleet(const std::string& path) { return read_fleet(ConfigFile(path)); }

Scenario load_scenario(const std::string& path, const std::string& robot) {
  const std::vector<Scenario> fleet = load_fleet(path);
  if (fleet.front().robot.empty()) return fleet.front();
  for (const Scenario& scenario : fleet) {
    if (scenario.robot == robot) return scenario;
  }
  throw ConfigError({{path, 0, "robots", "has no robot named '" + robot + "'"}});
}

}  // namespace atmos
