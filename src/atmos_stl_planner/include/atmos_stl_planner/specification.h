// What is asked for: workspace, regions, robots and formulas, read from a file that a person writes
// (docs/stl_planner.md describes the format).
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "atmos_stl_planner/formula.h"

namespace atmos::stl {

// Half-planes normal' p <= offset with unit normals (one row each), so that offset - normal' p is the
// distance of an inner point to that side, m.
struct Polytope {
  Eigen::Matrix<double, Eigen::Dynamic, 2> normals;
  Eigen::VectorXd offsets;
};

Polytope box(const Eigen::Vector2d& min, const Eigen::Vector2d& max);
// Corners of a convex polygon in either order. Nothing if they are not convex or enclose no area.
std::optional<Polytope> polygon(std::vector<Eigen::Vector2d> corners);
// Radius of the largest disc inside and its centre, m.
struct InscribedDisc {
  Eigen::Vector2d center;
  double radius;
};
InscribedDisc inscribed_disc(const Polytope& polytope);
// Corners in order, for displays.
std::vector<Eigen::Vector2d> corners_of(const Polytope& polytope);

// A place in world coordinates. A moving one is displaced by its path: linear between the points, which
// ascend in time; it rests before the first and after the last.
struct Region {
  struct PathPoint {
    double time_s;  // since the start of the plan
    Eigen::Vector2d displacement_m;
  };
  std::string name;
  Polytope polytope;
  std::vector<PathPoint> path;
  int line = 0;

  Eigen::Vector2d displacement(double time_s) const;
};

struct RobotPose {
  Eigen::Vector2d p_WB;  // m
  double yaw_rad = 0.0;  // written as yaw_deg
};

struct Robot {
  std::string name;  // the namespace of its topics
  RobotPose start;
  std::optional<RobotPose> end;   // where it rests at the horizon; free, but at rest, without
  double radius_m = 0.0;          // of its body, for separation and obstacles
  double max_velocity_m_s = 0.0;  // bound of each world axis
  double max_acceleration_m_s2 = 0.0;
};

// One conjunct of the specification, the unit of certificates and diagnoses.
struct Clause {
  std::string text;
  FormulaPtr formula;
  int line = 0;  // of the file
};

enum class Encoding {
  kTimeGrid,  // fixed time grid aligned with the windows, bounded acceleration
  kFreeTime,  // the paper's: Bezier curves in space and time, penalised acceleration
};

struct PlannerSettings {
  Encoding encoding = Encoding::kTimeGrid;
  double segment_s = 5.0;  // longest segment of the first, coarsest grid
  double min_segment_s = 2.5;
  double min_robustness_m = 0.01;  // a plan with less is none
  double time_limit_s = 30.0;      // wall clock, of the whole planning
  bool time_robustness = false;    // maximised after space
  bool prioritised = false;        // one robot after the other from the start, instead of as a fallback
};

struct Specification {
  std::string name;
  std::string path;
  double horizon_s = 0.0;
  Polytope workspace;             // of the robots' centres
  std::vector<Region> regions;    // what formulas speak of
  std::vector<Region> obstacles;  // kept away from by a robot's radius, always
  std::vector<Robot> robots;
  double separation_margin_m = 0.0;  // between the bodies of two robots
  std::vector<Clause> clauses;
  PlannerSettings planner;

  Vocabulary vocabulary() const;
  double min_distance(std::size_t robot, std::size_t other) const {
    return robots[robot].radius_m + robots[other].radius_m + separation_margin_m;
  }
};

// Reads a specification file. Throws ConfigError with every fault; those inside a formula name
// file:line:column and show the formula with a caret under the place.
Specification load_specification(const std::string& path);
// The same for text that is not on disk; `name` stands for the path in messages.
Specification parse_specification(const std::string& text, const std::string& name);

}  // namespace atmos::stl
