// Simulator speed: one robot, random commands, every registered effect switched on.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <vector>

#include "atmos_sim/batch.h"

namespace {

void print_row(const char* name, const char* unit, std::vector<double> values) {
  std::sort(values.begin(), values.end());
  std::printf("{\"name\": \"%s\", \"unit\": \"%s\", \"median\": %.6g, \"n\": %zu}\n", name, unit,
              values[values.size() / 2], values.size());
}

}  // namespace

int main() {
  constexpr double kStart = 1000.0;
  constexpr int kRepetitions = 7;
  const atmos::Scenario scenario = atmos::load_scenario(ATMOS_CONFIG_DIR "/scenario/all_effects.yaml");
  const auto commands = atmos::random_commands(scenario, kStart, scenario.seed);
  std::vector<double> steps_per_s, realtime_factor;
  for (int i = 0; i < kRepetitions; ++i) {
    const auto wall_start = std::chrono::steady_clock::now();
    const atmos::BatchResult result = atmos::run_batch(scenario, commands, kStart);
    const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - wall_start;
    steps_per_s.push_back(static_cast<double>(result.steps) / wall.count());
    realtime_factor.push_back(scenario.duration_s / wall.count());
  }
  print_row("sim/1_robot/steps_per_s", "1/s", steps_per_s);
  print_row("sim/1_robot/realtime_factor", "1", realtime_factor);
  return 0;
}
