// What a diagnosis (atmos_sim2real) found, as things that have a place on the floor.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "atmos_model/grid.h"
#include "atmos_model/vehicle.h"

namespace atmos {

struct FloorMap {
  Grid grid;
  GridRows height_m;  // rows [j][i], mean 0 over the grid
  double highest_m;   // largest absolute value
};

struct RubbingPatch {
  Eigen::Vector2d center_m;
  double radius_m, coefficient;
};

struct TetherPlace {
  Eigen::Vector2d anchor_m;
  double slack_m;
};

// A force that the claimed effects put on a robot at rest there, closed valves. World axes.
struct PlacedForce {
  Eigen::Vector2d p_W;      // m
  Eigen::Vector2d force_W;  // N
};

// A recording's path. Mismatch: size of the innovation over its own noise, 1 is noise alone, per point.
struct FlownPath {
  std::string name;
  std::vector<Eigen::Vector2d> p_W;     // m
  std::vector<double> nominal, fitted;  // as long as p_W
};

struct DiagnosisScene {
  std::string verdict;                  // empty without a report
  std::vector<std::string> statements;  // one per claimed effect; kinds where there is no report
  std::optional<FloorMap> floor;        // floor_unevenness and floor_tilt together
  std::vector<RubbingPatch> patches;
  std::optional<TetherPlace> tether;
  std::vector<FlownPath> paths;     // empty without a report's plots.json
  std::vector<PlacedForce> forces;  // along the paths, or over the map where there is none
};

// Reads a model.yaml for a vehicle and, unless empty, the report.json of the same diagnosis with its
// plots.json beside it. Throws ConfigError, or std::invalid_argument that names the report and its fault.
DiagnosisScene load_diagnosis_scene(const Vehicle& vehicle, const std::string& model_path,
                                    const std::string& report_path);

// Diverging colours from blue (-1) over white (0) to red (1); red, green, blue in [0, 1]. Outside, the ends.
Eigen::Vector3f diverging_color(double share);
// Colour of a mismatch: grey-green at 1 (noise) and below, to red at 4 and above.
Eigen::Vector3f mismatch_color(double mismatch);

}  // namespace atmos
