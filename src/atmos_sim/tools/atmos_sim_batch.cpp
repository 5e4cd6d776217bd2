// atmos_sim_batch: flies a scenario's plant open loop, without ROS, and writes the state table.
#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <fstream>

#include "atmos_sim/batch.h"

namespace {

// Writes a table; false with a message when that fails.
template <class Write>
bool write_file(const std::string& path, const Write& write) {
  std::ofstream out(path);
  if (out) write(out);
  if (out.flush()) return true;
  std::fprintf(stderr, "%s: cannot be written\n", path.c_str());
  return false;
}

}  // namespace

int main(int argc, char** argv) {
  std::string scenario_path, commands_path, states_path, commands_out_path;
  std::uint64_t seed = 1;
  double start_s = 1000.0;
  CLI::App app("Flies the plant of a scenario open loop and writes one row per mocap frame.");
  app.add_option("scenario", scenario_path, "scenario file")->required();
  auto* table = app.add_option("--commands", commands_path, "CSV: stamp_s,period_s,duty1,...,dutyN");
  app.add_option("--random", seed, "seed of random commands (without --commands; default 1)")
      ->excludes(table);
  app.add_option("--out", states_path, "CSV of states to write")->required();
  app.add_option("--commands-out", commands_out_path, "CSV of the commands flown");
  app.add_option("--start", start_s, "ROS time of the start [s]")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    const atmos::Scenario scenario = atmos::load_scenario(scenario_path);
    const auto commands =
        commands_path.empty()
            ? atmos::random_commands(scenario, start_s, seed)
            : atmos::read_commands(commands_path, static_cast<int>(scenario.vehicle.thrusters.size()));
    const auto wall_start = std::chrono::steady_clock::now();
    const atmos::BatchResult result = atmos::run_batch(scenario, commands, start_s);
    const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - wall_start;

    if (!write_file(states_path, [&](std::ostream& out) { atmos::write_states(result, out); })) return 1;
    if (!commands_out_path.empty() &&
        !write_file(commands_out_path, [&](std::ostream& out) { atmos::write_commands(commands, out); }))
      return 1;
    std::printf(
        "%zu rows, %zu commands (%lu not usable), %lu steps in %.3f s: %.0f steps/s, %.0f x real time\n",
        result.rows.size(), commands.size(), result.unused_commands, result.steps, wall.count(),
        static_cast<double>(result.steps) / wall.count(), scenario.duration_s / wall.count());
    return 0;
  } catch (const atmos::ConfigError& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  } catch (const std::runtime_error& error) {
    std::fprintf(stderr, "atmos_sim_batch: %s\n", error.what());
    return 1;
  }
}
