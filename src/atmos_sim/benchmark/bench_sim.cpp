// Simulator speed: one robot, random commands, every registered effect switched on; what each of them costs;
// and sixteen such robots that bump into each other.
#include <algorithm>
#include <cstdio>
#include <ctime>
#include <string>
#include <vector>

#include "atmos_model/benchmark_row.h"
#include "atmos_sim/batch.h"
#include "atmos_sim/simulation.h"

namespace {

constexpr double kStart = 1000.0;  // the failures of all_effects.yaml are dated from here

// Time of this core, which nothing else on the machine lengthens much; everything here is one thread.
double seconds_since(std::clock_t start) {
  return static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
}

struct Flight {
  double core_s;
  double steps;
};

Flight fly(const atmos::Scenario& scenario, const std::vector<atmos::ThrusterCommand>& commands) {
  const std::clock_t start = std::clock();
  const atmos::BatchResult result = atmos::run_batch(scenario, commands, kStart);
  return {seconds_since(start), static_cast<double>(result.steps)};
}

atmos::Scenario without(const atmos::Scenario& scenario, const std::string& kind) {
  atmos::Scenario less = scenario;
  const auto is_kind = [&kind](const atmos::Effect& effect) { return atmos::kind_of(effect) == kind; };
  less.effects.erase(std::remove_if(less.effects.begin(), less.effects.end(), is_kind), less.effects.end());
  return less;
}

// Sixteen robots between walls 2 m apart, each under all effects and random commands of its own. The
// tethers, friction and pushes of the effects keep them moving and bumping.
std::vector<atmos::Scenario> crowd(const atmos::Scenario& scenario) {
  std::vector<atmos::Scenario> fleet;
  for (int i = 0; i < 16; ++i) {
    atmos::Scenario robot = scenario;
    robot.world.walls = atmos::Walls{{-1.0, -1.0}, {1.0, 1.0}};
    robot.start = {0.0, 0.45 * (i % 4) - 0.675, 0.45 * (i / 4) - 0.675, 0.3 * i};
    robot.seed = static_cast<std::uint32_t>(i + 1);
    fleet.push_back(robot);
  }
  return fleet;
}

struct Crowded {
  double core_s;
  double contacts_per_s;
};

Crowded fly(const std::vector<atmos::Scenario>& fleet) {
  atmos::Simulation simulation(fleet, kStart);
  for (std::size_t i = 0; i < fleet.size(); ++i) {
    for (const auto& command : atmos::random_commands(fleet[i], kStart, fleet[i].seed))
      simulation.robot(i).command(command);
  }
  const double duration_s = fleet.front().duration_s;
  const std::clock_t start = std::clock();
  for (int k = 1; k <= 100 * duration_s; ++k) simulation.advance_to(kStart + 0.01 * k);
  return {seconds_since(start), static_cast<double>(simulation.contacts()) / duration_s};
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
    steps_per_s.push_back(flight.steps / flight.core_s);
    realtime_factor.push_back(scenario.duration_s / flight.core_s);
    nominal.push_back(scenario.duration_s / fly(bare, commands).core_s);
  }
  atmos::print_row("sim/1_robot/steps_per_s", "1/s", steps_per_s);
  atmos::print_row("sim/1_robot/realtime_factor", "1", realtime_factor);
  atmos::print_row("sim/1_robot_no_effects/realtime_factor", "1", nominal);
  std::vector<double> fleet_factor, fleet_contacts, bare_fleet;
  for (int i = 0; i < kRepetitions; ++i) {
    const Crowded crowded = fly(crowd(scenario));
    fleet_factor.push_back(scenario.duration_s / crowded.core_s);
    fleet_contacts.push_back(crowded.contacts_per_s);
    bare_fleet.push_back(scenario.duration_s / fly(crowd(bare)).core_s);
  }
  atmos::print_row("sim/16_robots/realtime_factor", "1", fleet_factor);
  atmos::print_row("sim/16_robots/contacts_per_s", "1/s", fleet_contacts);
  atmos::print_row("sim/16_robots_no_effects/realtime_factor", "1", bare_fleet);
  // The share of the time that is saved when one kind is left out; each flight beside one with everything.
  for (const atmos::EffectInfo& info : atmos::registered_effects()) {
    const atmos::Scenario less = without(scenario, info.kind);
    std::vector<double> share;
    for (int i = 0; i < kRepetitions; ++i)
      share.push_back(1.0 - fly(less, commands).core_s / fly(scenario, commands).core_s);
    atmos::print_row("sim/effect/" + info.kind + "/share", "1", share);
  }
  return 0;
}
