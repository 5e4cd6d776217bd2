#include "atmos_sim/run_grid.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "atmos_sim/pilot.h"

namespace atmos {

namespace {

constexpr double kStart = 1000.0;  // t0, as in the simulator node

// The node that a key of an axis names; undefined when there is none.
YAML::Node find(const YAML::Node& root, const std::string& key) {
  YAML::Node at = root;
  std::stringstream steps(key);
  std::string step;
  while (std::getline(steps, step, '.')) {
    YAML::Node next;
    if (at.IsSequence()) {
      for (const YAML::Node& effect : at) {
        if (effect["kind"] && effect["kind"].Scalar() == step) next.reset(effect["parameters"]);
      }
    } else if (at.IsMap() && at[step]) {
      next.reset(at[step]);
    }
    if (!next.IsDefined() || next.IsNull()) return YAML::Node(YAML::NodeType::Undefined);
    at.reset(next);
  }
  return at;
}

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", value);
  return text;
}

}  // namespace

int RunGrid::size() const {
  int count = repetitions;
  for (const GridAxis& axis : axes) count *= static_cast<int>(axis.values.size());
  return count;
}

std::vector<double> RunGrid::values(int run) const {
  std::vector<double> values(axes.size());
  int rest = run / repetitions;
  for (std::size_t i = axes.size(); i-- > 0;) {
    const auto count = static_cast<int>(axes[i].values.size());
    values[i] = axes[i].values[static_cast<std::size_t>(rest % count)];
    rest /= count;
  }
  return values;
}

Scenario RunGrid::scenario(int run) const {
  const YAML::Node root = YAML::LoadFile(scenario_path);
  const std::vector<double> chosen = values(run);
  for (std::size_t i = 0; i < axes.size(); ++i) find(root, axes[i].key) = chosen[i];
  find(root, "seed") = seed + run;
  YAML::Emitter text;
  text.SetDoublePrecision(17);
  text << root;
  const ConfigFile file = ConfigFile::from_text(text.c_str(), scenario_path);
  const std::vector<Scenario> fleet = read_fleet(file);
  if (fleet.size() != 1) throw ConfigError({{scenario_path, 0, "robots", "must be one robot in a grid"}});
  return fleet.front();
}

RunGrid load_grid(const std::string& path) {
  const ConfigFile file(path);
  const ConfigMap root = file.root();
  RunGrid grid;
  grid.path = path;
  grid.scenario_path = file.resolve(root.text("scenario"));
  grid.repetitions = root.integer("repetitions", 1, 1000000);
  grid.seed = root.integer("seed", 0, 1000000000);
  for (const ConfigMap& axis : root.maps("axes", false)) {
    grid.axes.push_back({axis.text("key"), axis.numbers("values")});
    if (axis.has("values") && grid.axes.back().values.empty()) axis.fault("values", "must not be empty");
  }
  file.check();
  const Scenario plain = load_scenario(grid.scenario_path);
  const YAML::Node scenario = YAML::LoadFile(plain.path);
  for (std::size_t i = 0; i < grid.axes.size(); ++i) {
    const YAML::Node node = find(scenario, grid.axes[i].key);
    if (!node.IsDefined() || !node.IsScalar())
      root.maps("axes")[i].fault("key", "must name a number of the scenario");
  }
  file.check();
  for (int run = 0; run < grid.size(); run += grid.repetitions) grid.scenario(run);
  return grid;
}

std::string table_header(const RunGrid& grid) {
  std::string header = "run,seed";
  for (const GridAxis& axis : grid.axes) header += "," + axis.key;
  return header +
         ",final_error_m,final_error_rad,steady_error_m,greatest_speed_m_s,path_m,open_s,frames_lost";
}

std::string fly_run(const RunGrid& grid, int run, const std::string& bag_path, const BagWriter& write_bag) {
  const Scenario scenario = grid.scenario(run);
  const PilotedFlight flight = fly_piloted(scenario, {}, kStart);
  if (!bag_path.empty()) write_bag(bag_path, scenario, flight, kStart);

  const SetPoint& goal = scenario.set_points.back();
  const Vec2<double> target(goal.x_m, goal.y_m);
  const PlanarState<double>& last = flight.rows.back().row.truth;
  double fastest = 0.0, path = 0.0, open = 0.0;
  int lost = 0, steady_count = 0;
  Vec2<double> steady = Vec2<double>::Zero(), before = flight.rows.front().row.truth.p_WC;
  for (const PilotedRow& row : flight.rows) {
    const PlanarState<double>& s = row.row.truth;
    fastest = std::max(fastest, s.v_WC.norm());
    path += (s.p_WC - before).norm();
    before = s.p_WC;
    lost += row.row.frame.pose.p_W.allFinite() ? 0 : 1;
    if (row.row.time_s < flight.rows.back().row.time_s - 5.0) continue;
    steady += s.p_WC - target;
    ++steady_count;
  }
  for (const ThrusterCommand& command : flight.commands) {
    for (const double duty : command.duty) open += std::abs(duty) * command.period_s;
  }
  std::string row = std::to_string(run) + "," + std::to_string(scenario.seed);
  for (const double value : grid.values(run)) row += "," + number(value);
  for (const double value : {(last.p_WC - target).norm(), std::abs(wrap_angle(last.yaw - goal.yaw_rad)),
                             steady.norm() / steady_count, fastest, path, open})
    row += "," + number(value);
  return row + "," + std::to_string(lost);
}

std::set<int> finished_runs(const std::string& journal, const RunGrid& grid) {
  std::set<int> finished;
  std::ifstream in(journal, std::ios::binary);
  if (!in) return finished;
  std::stringstream content;
  content << in.rdbuf();
  std::string text = content.str();
  const std::size_t end = text.rfind('\n') == std::string::npos ? 0 : text.rfind('\n') + 1;
  if (end != text.size()) {
    std::filesystem::resize_file(journal, end);
    text.resize(end);
  }
  std::istringstream lines(text);
  std::string line;
  if (!std::getline(lines, line)) return finished;
  if (line != table_header(grid))
    throw std::runtime_error(journal + " belongs to another grid: choose another --out folder");
  while (std::getline(lines, line)) {
    const int run = std::stoi(line);
    if (run < 0 || run >= grid.size() || !finished.insert(run).second)
      throw std::runtime_error(journal + ": run " + std::to_string(run) +
                               " stands there twice or not in the grid");
  }
  return finished;
}

}  // namespace atmos
