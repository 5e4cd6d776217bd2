// What a diagnosis costs: wall time and memory of the program on 150 s that the simulator flies in closed
// loop, seeds fixed. Nothing wrong, one effect, and an uneven floor beside it (maps are what costs most).
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "../tools/child.h"
#include "atmos_model/benchmark_row.h"
#include "atmos_model/steady_clock.h"

namespace {

namespace fs = std::filesystem;
using nlohmann::json;

const std::string kVehicle = ATMOS_CONFIG_DIR "/vehicle/atmos.yaml";

// Heights of 4 x 4 m of floor with three bumps of 1 to 2 mm.
json uneven_floor() {
  const double bumps[3][4] = {{-0.6, 0.5, 1.6e-3, 0.5}, {0.7, -0.4, -1.2e-3, 0.6}, {0.5, 0.9, 1.0e-3, 0.4}};
  json rows = json::array();
  for (double y = -2.0; y < 2.01; y += 0.2) {
    json row = json::array();
    for (double x = -2.0; x < 2.01; x += 0.2) {
      double height = 0.0;
      for (const auto& [at_x, at_y, top, width] : bumps)
        height += top * std::exp(-0.5 * (std::pow(x - at_x, 2) + std::pow(y - at_y, 2)) / (width * width));
      row.push_back(height);
    }
    rows.push_back(row);
  }
  return {{"kind", "floor_unevenness"},
          {"parameters", {{"origin_m", {-2.0, -2.0}}, {"spacing_m", 0.2}, {"height_m", rows}}}};
}

// Up and down an area of 2.4 x 2.4 m, turning now and then, with the errors of a good laboratory.
json scenario(int seed, const json& effects) {
  json setpoints = json::array();
  for (int k = 0; k < 15; ++k) {
    const double along = k % 6 < 3 ? k % 3 : 2 - k % 3;
    setpoints.push_back({{"time_s", 10.0 * k},
                         {"x_m", -1.2 + 1.2 * along},
                         {"y_m", -1.2 + 0.6 * (k / 3)},
                         {"yaw_deg", 45.0 * (k / 2 % 4)}});
  }
  return {
      {"name", "diagnosed"},
      {"vehicle", kVehicle},
      {"controller", ATMOS_CONFIG_DIR "/controller/wrench.yaml"},
      {"duration_s", 150.0},
      {"seed", seed},
      {"start", {{"x_m", -1.2}, {"y_m", -1.2}, {"yaw_deg", 0.0}}},
      {"setpoints", setpoints},
      {"mocap", {{"rate_hz", 100.0}, {"noise_m", 1e-4}, {"noise_rad", 5e-4}}},
      {"lab",
       {{"thrust_scatter", 0.01}, {"slow_force_n", 2e-3}, {"slow_torque_n_m", 2e-4}, {"slow_time_s", 4.0}}},
      {"effects", effects}};
}

struct Cost {
  double wall_ms, memory_mib;
};

// Of a program that is to end well; its output goes to `log`.
Cost run_measured(const std::vector<std::string>& command, const std::string& log) {
  const double begin_s = atmos::steady_seconds();
  const pid_t child = atmos::start_child(command, log);
  int status = 0;
  rusage usage{};
  if (child <= 0 || wait4(child, &status, 0, &usage) != child || !WIFEXITED(status) ||
      WEXITSTATUS(status) != 0)
    throw std::runtime_error(command.front() + " failed: see " + log);
  return {1e3 * (atmos::steady_seconds() - begin_s), static_cast<double>(usage.ru_maxrss) / 1024.0};
}

void bench(const std::string& name, const json& effects) {
  const std::string folder = fs::temp_directory_path() / ("bench_diagnosis_" + std::to_string(getpid()));
  fs::create_directories(folder);
  const std::string path = folder + "/scenario.yaml", bag = folder + "/flight.bag",
                    out = folder + "/diagnosis";
  std::ofstream(path) << scenario(7, effects).dump(1);
  atmos::run_child({atmos::simulator_tool("atmos_sim_flight"), path, "--bag", bag}, folder + "/fly.log");
  const std::string diagnose = fs::read_symlink("/proc/self/exe").parent_path() / "diagnose";
  const Cost cost =
      run_measured({diagnose, "--vehicle", kVehicle, "--out", out, bag}, folder + "/diagnose.log");
  const json report = json::parse(std::ifstream(out + "/report.json"));
  std::string found;
  for (const json& effect : report["effects"]) found += " " + effect["kind"].get<std::string>();
  std::fprintf(stderr, "%s: %s%s\n", name.c_str(), report["verdict"].get<std::string>().c_str(),
               found.c_str());
  atmos::print_row(name + "/wall", "ms", {cost.wall_ms});
  atmos::print_row(name + "/memory", "MiB", {cost.memory_mib});
  fs::remove_all(folder);
}

}  // namespace

int main(int argc, char** argv) {
  const std::string prefix = argc > 1 ? argv[1] : "";
  const json coupling = {{"kind", "supply_coupling"}, {"parameters", {{"fraction_per_open_thruster", 0.08}}}};
  const std::pair<std::string, json> cases[] = {
      {"diagnosis/150s", json::array({coupling})},
      {"diagnosis/150s_consistent", json::array()},
      {"diagnosis/150s_map", json::array({coupling, uneven_floor()})}};
  try {
    for (const auto& [name, effects] : cases) {
      const std::string shared = name.substr(0, prefix.size());
      if (shared == prefix.substr(0, shared.size())) bench(name, effects);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "error: %s\n", error.what());
    return 1;
  }
  return 0;
}
