#include "atmos_stl_planner/specification.h"

#include <algorithm>
#include <fstream>
#include <functional>
#include <map>
#include <set>
#include <sstream>

#include "atmos_model/strict_yaml.h"

namespace atmos::stl {

namespace {

constexpr double kDegree = M_PI / 180.0;
constexpr double kMaxHorizon_s = 3600.0;
constexpr double kMaxCoordinate_m = 1000.0;
constexpr std::size_t kMaxPathPoints = 1000;

Bounds coordinate() { return Bounds::between(-kMaxCoordinate_m, kMaxCoordinate_m); }

std::string name_fault(const std::string& name) {
  if (name.empty()) return "must not be empty";
  if (is_reserved(name)) return "\"" + name + "\" is a word of the formula language";
  const bool first = std::isalpha(static_cast<unsigned char>(name[0])) != 0;
  const bool rest = std::all_of(name.begin(), name.end(), [](char c) {
    return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_';
  });
  return first && rest ? "" : "must be made of letters, digits and _, a letter first";
}

// Where formulas stand in the file. YAML gives no column, so the text is looked up in the lines; the same
// text for the nth time is the nth place.
class Places {
 public:
  explicit Places(const std::string& text) {
    std::istringstream in(text);
    for (std::string line; std::getline(in, line);) lines_.push_back(line);
  }

  // 1-based line and column; {0, 0} for a text that is folded over several lines.
  std::pair<int, int> next(const std::string& formula) {
    int skip = seen_[formula]++;
    for (std::size_t i = 0; i < lines_.size(); ++i) {
      const std::size_t comment = lines_[i].find_first_not_of(" \t");
      if (comment != std::string::npos && lines_[i][comment] == '#') continue;
      const std::size_t at = lines_[i].find(formula);
      if (at != std::string::npos && !formula.empty() && skip-- == 0)
        return {static_cast<int>(i) + 1, static_cast<int>(at) + 1};
    }
    return {0, 0};
  }

 private:
  std::vector<std::string> lines_;
  std::map<std::string, int> seen_;
};

std::string caret_text(const std::string& formula, const FormulaError& error) {
  std::string shown = formula;
  std::replace_if(
      shown.begin(), shown.end(), [](char c) { return static_cast<unsigned char>(c) < ' '; }, ' ');
  std::string text = error.what();
  if (!error.suggestion.empty()) text += "; " + error.suggestion;
  return text + "\n    " + shown + "\n    " + std::string(error.position, ' ') + "^";
}

class Reader {
 public:
  Reader(const ConfigFile& file, const std::string& text, const std::string& name)
      : file_(file), places_(text) {
    spec_.path = name;
  }

  Specification read() {
    const ConfigMap root = file_.root();
    spec_.name = root.text("name");
    spec_.horizon_s = root.number("horizon_s", {0.0, kMaxHorizon_s, true});
    read_workspace(root.map("workspace"));
    for (const ConfigMap& region : root.maps("regions", false)) spec_.regions.push_back(read_region(region));
    for (const ConfigMap& region : root.maps("obstacles", false))
      spec_.obstacles.push_back(read_region(region));
    const std::vector<ConfigMap> robots = root.maps("robots");
    if (robots.empty() && !root.faulty("robots")) root.fault("robots", "must have at least one");
    for (const ConfigMap& robot : robots) spec_.robots.push_back(read_robot(robot));
    spec_.separation_margin_m = root.number("separation_margin_m", {0.0, 100.0, false}, 0.0);
    read_settings(root);
    for (std::size_t i = 0; i < robots.size(); ++i) read_formulas(robots[i], static_cast<int>(i));
    read_formulas(root, robots.size() == 1 ? 0 : -1);
    check_starts(robots);

    std::vector<ConfigFault> faults;
    try {
      file_.check();
    } catch (const ConfigError& error) {
      faults = error.faults();
    }
    faults.insert(faults.end(), formula_faults_.begin(), formula_faults_.end());
    if (!faults.empty()) throw ConfigError(faults);
    return std::move(spec_);
  }

 private:
  void read_workspace(const ConfigMap& map) {
    if (map.has("corners_m")) {
      spec_.workspace = read_polygon(map);
    } else {
      const Eigen::Vector2d min = map.vector2("min_m", coordinate()),
                            max = map.vector2("max_m", coordinate());
      if (!(max - min).isZero() && !(min.array() < max.array()).all())
        map.fault("max_m", "must exceed min_m");
      spec_.workspace = box(min, max);
    }
  }

  static Polytope read_polygon(const ConfigMap& map) {
    std::vector<Eigen::Vector2d> corners;
    for (const std::vector<double>& row : map.rows("corners_m", coordinate())) {
      if (row.size() == 2) corners.emplace_back(row[0], row[1]);
    }
    const std::optional<Polytope> result = corners.size() <= 32 ? polygon(corners) : std::nullopt;
    if (!result) map.fault("corners_m", "must be 3 to 32 corners [x, y] of a convex polygon, in order");
    return result.value_or(box({0, 0}, {1, 1}));
  }

  Region read_region(const ConfigMap& map) {
    Region region;
    region.name = map.text("name");
    check_name(map, region.name, names_of_regions_);
    if (map.has("corners_m")) {
      region.polytope = read_polygon(map);
    } else {
      const Eigen::Vector2d center = map.vector2("center_m", coordinate());
      const Eigen::Vector2d size = map.vector2("size_m", {0.0, kMaxCoordinate_m, true});
      region.polytope = box(center - 0.5 * size, center + 0.5 * size);
    }
    for (const ConfigMap& point : map.maps("path", false)) {
      const double time = point.number("time_s", {0.0, kMaxHorizon_s, false});
      const Eigen::Vector2d displacement = point.vector2("displacement_m", coordinate());
      if (!region.path.empty() && !(time > region.path.back().time_s + 1e-3))
        point.fault("time_s", "must be at least 1 ms later than the point before");
      region.path.push_back({time, displacement});
    }
    if (region.path.size() > kMaxPathPoints) map.fault("path", "must have at most 1000 points");
    return region;
  }

  static void check_name(const ConfigMap& map, const std::string& name, std::set<std::string>& taken) {
    const std::string fault = name_fault(name);
    if (!fault.empty()) {
      map.fault("name", fault);
    } else if (!taken.insert(name).second) {
      map.fault("name", "\"" + name + "\" is taken");
    }
  }

  static RobotPose read_pose(const ConfigMap& map) {
    RobotPose pose;
    pose.p_WB.x() = map.number("x_m", coordinate());
    pose.p_WB.y() = map.number("y_m", coordinate());
    pose.yaw_rad = kDegree * map.number("yaw_deg", Bounds::between(-360.0, 360.0), 0.0);
    return pose;
  }

  Robot read_robot(const ConfigMap& map) {
    Robot robot;
    robot.name = map.text("name");
    check_name(map, robot.name, names_of_robots_);
    robot.start = read_pose(map.map("start"));
    if (const auto end = map.optional_map("end")) robot.end = read_pose(*end);
    robot.radius_m = map.number("radius_m", {0.0, 10.0, false});
    robot.max_velocity_m_s = map.number("max_velocity_m_s", {0.0, 100.0, true});
    robot.max_acceleration_m_s2 = map.number("max_acceleration_m_s2", {0.0, 100.0, true});
    return robot;
  }

  void read_settings(const ConfigMap& root) {
    const std::optional<ConfigMap> map = root.optional_map("planner");
    PlannerSettings& to = spec_.planner;
    if (!map) return;
    if (map->choice("encoding", {"time_grid", "free_time"}, "time_grid") == "free_time")
      to.encoding = Encoding::kFreeTime;
    to.segment_s = map->number("segment_s", {0.1, kMaxHorizon_s, false}, to.segment_s);
    to.min_segment_s =
        map->number("min_segment_s", {0.1, kMaxHorizon_s, false}, std::min(to.min_segment_s, to.segment_s));
    if (to.min_segment_s > to.segment_s) map->fault("min_segment_s", "must not exceed segment_s");
    to.min_robustness_m =
        map->number("min_robustness_m", Bounds::between(0.0, kMaxCoordinate_m), to.min_robustness_m);
    to.time_limit_s = map->number("time_limit_s", {0.0, 3600.0, true}, to.time_limit_s);
    to.time_robustness = map->flag("time_robustness", to.time_robustness);
    to.prioritised = map->flag("prioritised", to.prioritised);
    if (spec_.horizon_s / to.min_segment_s > 1000.0)
      map->fault("min_segment_s", "must give at most 1000 segments");
  }

  void read_formulas(const ConfigMap& map, int default_robot) {
    if (!map.has("formulas")) return;
    Vocabulary names = spec_.vocabulary();
    names.default_robot = default_robot;
    for (const std::string& text : map.texts("formulas")) {
      const auto [line, column] = places_.next(text);
      try {
        const FormulaPtr formula = parse_formula(text, names);
        const double ahead = horizon(*formula);
        if (ahead > spec_.horizon_s * (1.0 + 1e-12)) {
          std::ostringstream rule;
          rule << "the formula looks " << ahead << " s ahead, the horizon ends after " << spec_.horizon_s
               << " s";
          throw FormulaError(0, rule.str(), "");
        }
        for (const FormulaPtr& part : conjuncts(formula))
          spec_.clauses.push_back({to_text(*part, names), part, line});
      } catch (const FormulaError& error) {
        add_fault(text, line, column, error);
      }
    }
  }

  void add_fault(const std::string& text, int line, int column, const FormulaError& error) {
    std::string where = spec_.path;
    if (line > 0)
      where += ":" + std::to_string(line) + ":" + std::to_string(column + static_cast<int>(error.position));
    formula_faults_.push_back({where, 0, "formulas", caret_text(text, error)});
  }

  // What no plan can mend is a fault of the file.
  void check_starts(const std::vector<ConfigMap>& robots) {
    const auto inside = [this](const Eigen::Vector2d& p) {
      return (spec_.workspace.normals * p - spec_.workspace.offsets).maxCoeff() <= 1e-9;
    };
    for (std::size_t i = 0; i < robots.size(); ++i) {
      const Robot& robot = spec_.robots[i];
      if (!inside(robot.start.p_WB)) robots[i].fault("start", "must lie in the workspace");
      if (robot.end && !inside(robot.end->p_WB)) robots[i].fault("end", "must lie in the workspace");
      for (std::size_t j = 0; j < i; ++j) {
        const Robot& other = spec_.robots[j];
        if ((robot.start.p_WB - other.start.p_WB).norm() < spec_.min_distance(i, j))
          robots[i].fault("start", "is too near that of " + other.name);
        if (robot.end && other.end && (robot.end->p_WB - other.end->p_WB).norm() < spec_.min_distance(i, j))
          robots[i].fault("end", "is too near that of " + other.name);
      }
    }
  }

  const ConfigFile& file_;
  Places places_;
  Specification spec_;
  std::set<std::string> names_of_regions_, names_of_robots_;
  std::vector<ConfigFault> formula_faults_;
};

}  // namespace

Vocabulary Specification::vocabulary() const {
  Vocabulary names;
  for (const Robot& robot : robots) names.robots.push_back(robot.name);
  for (const Region& region : regions) names.regions.push_back(region.name);
  names.default_robot = robots.size() == 1 ? 0 : -1;
  return names;
}

Specification parse_specification(const std::string& text, const std::string& name) {
  const ConfigFile file = ConfigFile::from_text(text, name);
  return Reader(file, text, name).read();
}

Specification load_specification(const std::string& path) {
  const ConfigFile file(path);  // says what is wrong with a path
  std::ifstream in(path);
  std::ostringstream text;
  text << in.rdbuf();
  return Reader(file, text.str(), path).read();
}

}  // namespace atmos::stl
