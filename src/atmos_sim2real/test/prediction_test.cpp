#include "atmos_sim2real/prediction.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "synthetic.h"

namespace atmos {
namespace {

constexpr double kStart = 1.7e9;

WindowStart start_at(const SyntheticFlight& flight, const Plant& plant, std::size_t frame) {
  return {flight.truth[frame].time_s, plant.measured(flight.truth[frame].body)};
}

// Largest error of the rows against what the plant really did.
double largest_error(const SyntheticFlight& flight, const Plant& plant,
                     const std::vector<PredictedPose>& rows) {
  double error = 0.0;
  for (const PredictedPose& row : rows) {
    const auto frame = static_cast<std::size_t>(std::lround((row.stamp_s - kStart) / 0.01));
    const PlanarState<double> shown = plant.measured(flight.truth.at(frame).body);
    error = std::max({error, std::abs(shown.p_WC.x() - row.x_m), std::abs(shown.p_WC.y() - row.y_m),
                      std::abs(shown.yaw - row.yaw_rad)});
  }
  return error;
}

TEST(Predict, ReproducesThePredictorFromTheTruth) {
  const Vehicle vehicle = nominal_vehicle();
  const std::vector<Effect> effects = {SupplyCoupling{{}, 0.1}, CommandDelay{{}, 0.03},
                                       ComOffset{{}, 0.01, 0.0}, FloorTilt{{}, 5e-4, 2e-4},
                                       MarkerOffset{{}, 0.02, -0.01}};
  const SyntheticFlight flight = fly_ideal(vehicle, effects, pulse_commands(kStart, 40.0, 31));
  const Plant plant(vehicle, effects, kStart);
  // One start lies inside a pulse, where commands of before still act.
  const std::vector<WindowStart> starts = {start_at(flight, plant, 500), start_at(flight, plant, 1613)};
  const std::vector<PredictedPose> rows = OpenLoop(flight.recording, vehicle, effects).predict(starts, 5.0);
  ASSERT_EQ(rows.size(), 100u);
  EXPECT_NEAR(rows.front().stamp_s, rows.front().window_start_s + 0.1, 1e-6);
  EXPECT_LT(largest_error(flight, plant, rows), 1e-6);
  EXPECT_GT(largest_error(flight, plant, OpenLoop(flight.recording, vehicle, {}).predict(starts, 5.0)), 1e-3);
}

TEST(Predict, CarriesHiddenStates) {
  const Vehicle vehicle = nominal_vehicle();
  SupplyDroop droop;
  droop.loss_per_s = 0.5;
  droop.recovery_s = 8.0;
  const SyntheticFlight flight = fly_ideal(vehicle, {droop}, pulse_commands(kStart, 40.0, 33));
  const Plant plant(vehicle, {droop}, kStart);
  const std::vector<WindowStart> starts = {start_at(flight, plant, 3000)};
  const std::vector<PredictedPose> rows = OpenLoop(flight.recording, vehicle, {droop}).predict(starts, 5.0);
  EXPECT_LT(largest_error(flight, plant, rows), 1e-4);
  // The same window with a supply that is full at its start.
  SyntheticFlight late = flight;
  auto& commands = late.recording.commands;
  commands.erase(commands.begin() + 1, commands.begin() + 299);
  EXPECT_GT(largest_error(flight, plant, OpenLoop(late.recording, vehicle, {droop}).predict(starts, 5.0)),
            1e-3);
}

TEST(Predict, ReadsNoPoseAfterItsStart) {
  const Vehicle vehicle = nominal_vehicle();
  Slosh slosh;
  slosh.mass_kg = 0.5;
  const SyntheticFlight flight = fly(vehicle, {slosh}, pulse_commands(kStart, 30.0, 35), 36);
  const Plant plant(vehicle, {slosh}, kStart);
  const std::vector<WindowStart> starts = {start_at(flight, plant, 1500)};
  Recording moved = flight.recording;
  for (std::size_t i = 1501; i < moved.poses.size(); ++i) moved.poses[i].x_m += 0.5;
  const auto rows = OpenLoop(flight.recording, vehicle, {slosh}).predict(starts, 5.0);
  const auto again = OpenLoop(moved, vehicle, {slosh}).predict(starts, 5.0);
  for (std::size_t i = 0; i < rows.size(); ++i) EXPECT_DOUBLE_EQ(rows[i].x_m, again[i].x_m);
}

TEST(Predict, FindsThePhaseThatAVibrationHasInThisRecording) {
  const Vehicle vehicle = nominal_vehicle();
  FloorVibration swing;
  swing.amplitude_n = 0.3;
  swing.frequency_hz = 0.7;
  swing.phase_rad = 2.0;
  const SyntheticFlight flight = fly(vehicle, {swing}, pulse_commands(kStart, 40.0, 39), 40);
  const Plant plant(vehicle, {swing}, kStart);
  std::vector<WindowStart> starts;  // over a period
  for (std::size_t frame = 2000; frame < 2140; frame += 10) starts.push_back(start_at(flight, plant, frame));
  const auto predicted = [&](const std::vector<Effect>& effects) {
    return OpenLoop(flight.recording, vehicle, effects).predict(starts, 5.0);
  };
  const auto right = predicted({swing});
  const auto strays = [&](const std::vector<Effect>& effects) {
    const auto rows = predicted(effects);
    double squares = 0.0;
    for (std::size_t i = 0; i < rows.size(); ++i) squares += std::pow(rows[i].x_m - right[i].x_m, 2);
    return std::sqrt(squares);
  };
  FloorVibration fitted = swing;
  fitted.phase_rad = -1.0;  // half a turn and 8 degrees away: a seventh of the force is left
  EXPECT_LT(strays({fitted}), 0.2 * strays({}));
}

TEST(EstimateWindowStarts, AreCausalAndNearTheTruth) {
  const Vehicle vehicle = nominal_vehicle();
  const SyntheticFlight flight = fly(vehicle, {}, pulse_commands(kStart, 30.0, 37), 38);
  const auto starts = OpenLoop(flight.recording, vehicle, {}).window_starts(5.0);
  ASSERT_EQ(starts.size(), 5u);
  for (const WindowStart& start : starts) {
    const auto frame = static_cast<std::size_t>(std::lround((start.stamp_s - kStart) / 0.01));
    EXPECT_LT((start.shown.p_WC - flight.truth[frame].body.p_WC).norm(), 3e-4);
    EXPECT_LT((start.shown.v_WC - flight.truth[frame].body.v_WC).norm(), 3e-3);
  }
  Recording cut = flight.recording;
  const auto last = static_cast<std::size_t>(std::lround((starts[2].stamp_s - kStart) / 0.01));
  for (std::size_t i = last + 1; i < cut.poses.size(); ++i) cut.poses[i].y_m += 1.0;
  const auto again = OpenLoop(cut, vehicle, {}).window_starts(5.0);
  EXPECT_DOUBLE_EQ(again[2].shown.p_WC.y(), starts[2].shown.p_WC.y());
  EXPECT_DOUBLE_EQ(again[2].shown.v_WC.x(), starts[2].shown.v_WC.x());
}

std::string fault_of(const std::string& text) {
  const std::string path = (std::filesystem::temp_directory_path() / "atmos_window_starts.csv").string();
  std::ofstream(path) << text;
  std::string fault;
  try {
    read_window_starts(path);
  } catch (const std::invalid_argument& error) {
    fault = error.what();
  }
  std::filesystem::remove(path);
  return fault;
}

TEST(ReadWindowStarts, NamesFileLineAndRule) {
  const std::string header = "stamp,x,y,yaw,vx,vy,yaw_rate\n";
  EXPECT_EQ(fault_of(header + "1700000000.123456,1,2,3,4,5,6\n"), "");
  EXPECT_EQ(fault_of(header + "1700000000.123456,1,2,3,4,5,6\r\n\n"), "");
  EXPECT_NE(fault_of("stamp,x,y\n1,2,3\n").find(":1: the header"), std::string::npos);
  EXPECT_NE(fault_of(header + "1,2,3,4,5,6,7\n1,2,3\n").find(":3: must be seven numbers"), std::string::npos);
  EXPECT_NE(fault_of(header + "1,2,3,4,5,6,7,8\n").find(":2: must be seven numbers"), std::string::npos);
  EXPECT_NE(fault_of(header + "1,2,three,4,5,6,7\n").find(":2:"), std::string::npos);
  EXPECT_NE(fault_of(header).find("no rows"), std::string::npos);
  EXPECT_THROW(read_window_starts("/nowhere/starts.csv"), std::invalid_argument);
}

}  // namespace
}  // namespace atmos
