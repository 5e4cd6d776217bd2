// Simulator speed: one robot, random commands, every registered effect switched on; and what each of them
// costs.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <string>
#include <vector>

#include "atmos_sim/batch.h"

namespace {

constexpr double kStart = 1000.0;

void print_row(const std::string& name, const char* unit, std::vector<double> values) {
  std::sort(values.begin(), values.end());
  std::printf("{\"name\": \"%s\", \"unit\": \"%s\", \"median\": %.6g, \"n\": %zu}\n", name.c_str(), unit,
              values[values.size() / 2], values.size());
}

struct Flight {
  double wall_s;
  double steps;
};

Flight fly(const atmos::Scenario& scenario, const std::vector<atmos::ThrusterCommand>& commands) {
  const auto wall_start = std::chrono::steady_clock::now();
  const atmos::BatchResult result = atmos::run_batch(scenario, commands, kStart);
  const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - wall_start;
  return {wall.count(), static_cast<double>(result.steps)};
}

atmos::Scenario without(const atmos::Scenario& scenario, const std::string& kind) {
  atmos::Scenario less = scenario;
  const auto is_kind = [&kind](const atmos::Effect& effect) { return atmos::kind_of(effect) == kind; };
  less.effects.erase(std::remove_if(less.effects.begin(), less.effects.end(), is_kind), less.effects.end());
  return less;
}

}  // namespace

int main() {
  constexpr int kRepetitions = 7;
  const atmos::Scenario scenario = atmos::load_scenario(ATMOS_CONFIG_DIR "/scenario/all_effects.yaml");
  const auto commands = atmos::random_commands(scenario, kStart, scenario.seed);
  std::vector<double> steps_per_s, realtime_factor, nominal;
  atmos::Scenario bare = scenario;
  bare.effects.clear();
  for (int i = 0; i < kRepetitions; ++i) {
    const Flight flight = fly(scenario, commands);
    steps_per_s.push_back(flight.steps / flight.wall_s);
    realtime_factor.push_back(scenario.duration_s / flight.wall_s);
    nominal.push_back(scenario.duration_s / fly(bare, commands).wall_s);
  }
  print_row("sim/1_robot/steps_per_s", "1/s", steps_per_s);
  print_row("sim/1_robot/realtime_factor", "1", realtime_factor);
  print_row("sim/1_robot_no_effects/realtime_factor", "1", nominal);
  // The share of the time that is saved when one kind is left out; each flight beside one with everything.
  for (const atmos::EffectInfo& info : atmos::registered_effects()) {
    const atmos::Scenario less = without(scenario, info.kind);
    std::vector<double> share;
    for (int i = 0; i < kRepetitions; ++i)
      share.push_back(1.0 - fly(less, commands).wall_s / fly(scenario, commands).wall_s);
    print_row("sim/effect/" + info.kind + "/share", "1", share);
  }
  return 0;
}
