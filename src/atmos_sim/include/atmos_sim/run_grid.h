// Many seeded runs of a scenario with changed values, done once each however often the work is interrupted.
#pragma once

#include <functional>
#include <set>
#include <string>
#include <vector>

#include "atmos_model/scenario.h"

namespace atmos {

// One key of the scenario and the values it takes. Effects are named by their kind:
// "effects.floor_tilt.slope_x"; anything else by its place: "mocap.noise_m".
struct GridAxis {
  std::string key;
  std::vector<double> values;
};

// A grid file: every combination of the axes' values, each flown `repetitions` times with seeds of their own.
struct RunGrid {
  std::string path;
  std::string scenario_path;
  int repetitions = 1;
  int seed = 1;  // of run 0; run k has seed + k
  std::vector<GridAxis> axes;

  int size() const;
  // Values of run k, one per axis; the last axis changes fastest, after the repetitions.
  std::vector<double> values(int run) const;
  // The scenario of run k. Throws ConfigError when a changed value breaks a rule of the scenario.
  Scenario scenario(int run) const;
};

// Reads a grid file and checks every value in the scenario. Throws ConfigError with every fault.
RunGrid load_grid(const std::string& path);

// Header and row of the table that all runs fill: run, seed, the axes, then what came of the flight.
std::string table_header(const RunGrid& grid);
// Flies run k in closed loop by the plain set-point pilot and returns its row. `bag_path` is given to
// `write_bag` unless it is empty.
struct PilotedFlight;
using BagWriter =
    std::function<void(const std::string& path, const Scenario&, const PilotedFlight&, double start_s)>;
std::string fly_run(const RunGrid& grid, int run, const std::string& bag_path, const BagWriter& write_bag);

// The runs whose rows stand in a journal. A last line without its end, left by a kill, is cut off from the
// file. Throws std::runtime_error when the journal belongs to another grid.
std::set<int> finished_runs(const std::string& journal, const RunGrid& grid);

}  // namespace atmos
