#include "atmos_sim/replay.h"

#include <gtest/gtest.h>

#include <fstream>

#include "atmos_sim/pilot.h"
#include "test_scenario.h"

namespace atmos {
namespace {

Scenario flown_scenario(const std::vector<Effect>& effects) {
  Scenario scenario = test_scenario();
  scenario.duration_s = 30.0;
  scenario.set_points = {{0.0, 0.0, 0.0, 0.0}, {3.0, 0.6, -0.4, 1.0}, {15.0, -0.2, 0.5, -0.5}};
  scenario.effects = effects;
  return scenario;
}

// A frame of a flight as a window's start.
ReplayStart start_at(const PilotedFlight& flight, std::size_t row) {
  return {flight.rows[row].row.frame.stamp_s, flight.rows[row].shown};
}

// Largest distance of replayed rows from what was shown in flight; frames are 10 ms apart, rows 100 ms.
double largest_error(const PilotedFlight& flight, const std::vector<ReplayedPose>& rows) {
  double largest = 0.0;
  for (const ReplayedPose& row : rows) {
    const auto frame =
        std::min_element(flight.rows.begin(), flight.rows.end(), [&](const auto& a, const auto& b) {
          return std::abs(a.row.frame.stamp_s - row.stamp_s) < std::abs(b.row.frame.stamp_s - row.stamp_s);
        });
    largest = std::max(largest, (frame->shown.p_WC - row.shown.p_W).norm());
    largest = std::max(largest, std::abs(frame->shown.yaw - row.shown.yaw));
  }
  return largest;
}

TEST(Replay, TheTrueModelFliesTheRecordingAgain) {
  SupplyDroop droop;
  droop.loss_per_s = 0.3;
  droop.recovery_s = 1.0;
  MocapLatency latency;
  latency.delay_s = 0.04;
  MarkerOffset marker;
  marker.x_m = 0.02;
  CommandDelay delay;
  delay.delay_s = 0.02;
  const Scenario scenario = flown_scenario({droop, latency, marker, delay});
  const PilotedFlight flight = fly_piloted(scenario, {}, kTestStart);
  std::vector<ReplayStart> starts;
  for (const std::size_t row : {100U, 600U, 850U, 1600U})
    starts.push_back(start_at(flight, row));  // two overlap
  const auto same = replay(scenario.vehicle, scenario.effects, flight.commands, starts, 5.0);
  ASSERT_EQ(same.size(), 200U);
  EXPECT_DOUBLE_EQ(same[50].window_start_s, starts[1].stamp_s);
  EXPECT_NEAR(same[50].stamp_s, starts[1].stamp_s + 0.1, 1e-9);
  EXPECT_LT(largest_error(flight, same), 1e-4);
  const auto nominal = replay(scenario.vehicle, {}, flight.commands, starts, 5.0);
  EXPECT_GT(largest_error(flight, nominal), 0.02);
}

TEST(Replay, AFailureInFlightHappensAtItsTime) {
  ThrusterDead dead;
  dead.thruster = 2;
  dead.since_s = kTestStart + 12.0;
  const Scenario scenario = flown_scenario({dead});
  const PilotedFlight flight = fly_piloted(scenario, {}, kTestStart);
  const std::vector<ReplayStart> starts = {start_at(flight, 1000)};
  EXPECT_LT(largest_error(flight, replay(scenario.vehicle, {dead}, flight.commands, starts, 10.0)), 1e-4);
}

TEST(Replay, RefusesWhatItCannotFly) {
  const Scenario scenario = flown_scenario({});
  EXPECT_THROW(replay(scenario.vehicle, {}, {}, {}, 5.0), std::invalid_argument);
  const std::vector<ThrusterCommand> commands = repeated(open_thrusters(kTestStart, 0.0, {}), 10);
  EXPECT_THROW(replay(scenario.vehicle, {}, commands, {{kTestStart - 1.0, {}}}, 5.0), std::invalid_argument);
  const std::string path = testing::TempDir() + "/sim_replay_starts.csv";
  std::ofstream(path) << "stamp,x,y,yaw,vx,vy,yaw_rate\n1,2,3,4,5,6\n";
  EXPECT_THROW(read_replay_starts(path), std::invalid_argument);
  std::ofstream(path) << "stamp,x,y,yaw,vx,vy,yaw_rate\n1,2,3,4,5,6,nan\n";
  EXPECT_THROW(read_replay_starts(path), std::invalid_argument);
  EXPECT_THROW(read_replay_starts("/nowhere.csv"), std::invalid_argument);
}

}  // namespace
}  // namespace atmos
