// What the tests fly.
#pragma once

#include "atmos_sim/batch.h"
#include "atmos_sim/simulation.h"

namespace atmos {

// As in the simulator node: the failures of all_effects.yaml are dated from here.
inline constexpr double kTestStart = 1000.0;

// The nominal vehicle at rest at the origin, no effects, noise-free mocap.
inline Scenario test_scenario() {
  Scenario scenario = load_scenario(ATMOS_CONFIG_DIR "/scenario/paper_sequence.yaml");
  scenario.duration_s = 20.0;
  scenario.mocap = MocapSettings{};
  return scenario;
}

inline Scenario all_effects_scenario() {
  return load_scenario(ATMOS_CONFIG_DIR "/scenario/all_effects.yaml");
}

// A command for the nominal eight thrusters that opens those numbered (from 1) for `duty`.
inline ThrusterCommand open_thrusters(double stamp_s, double duty, const std::vector<int>& numbers) {
  ThrusterCommand command{stamp_s, 0.1, std::vector<double>(8, 0.0)};
  for (const int number : numbers) command.duty[static_cast<std::size_t>(number - 1)] = duty;
  return command;
}

inline std::vector<ThrusterCommand> repeated(ThrusterCommand command, int periods) {
  std::vector<ThrusterCommand> commands;
  const double first = command.stamp_s;
  for (int k = 0; k < periods; ++k) {
    command.stamp_s = first + 0.1 * k;
    commands.push_back(command);
  }
  return commands;
}

}  // namespace atmos
