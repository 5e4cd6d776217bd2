// Air and battery on board.
#include <gtest/gtest.h>

#include <cmath>

#include "test_scenario.h"

namespace atmos {
namespace {

constexpr double kPascal = 1e-9;

// What load_scenario() makes of a scenario with these lines added.
Scenario with_lines(const std::string& lines, const std::string& vehicle = "atmos") {
  const std::string text = "name: supply\nvehicle: " ATMOS_CONFIG_DIR "/vehicle/" + vehicle +
                           ".yaml\ncontroller: none.yaml\nduration_s: 600\nseed: 1\n"
                           "start: {x_m: 0.0, y_m: 0.0, yaw_deg: 0.0}\n"
                           "setpoints: [{time_s: 0.0, x_m: 0.0, y_m: 0.0, yaw_deg: 0.0}]\n"
                           "mocap: {rate_hz: 100.0, noise_m: 0.0, noise_rad: 0.0}\n" +
                           lines;
  const ConfigFile file = ConfigFile::from_text(text, "supply.yaml");
  return read_fleet(file).at(0);
}

// Opens one thruster without a pause until it gives no force any more; how long that took, s.
double seconds_until_empty(const Scenario& scenario, Simulation& simulation) {
  for (int k = 0; k < 10 * scenario.duration_s; ++k) {
    simulation.robot().command(open_thrusters(kTestStart + 0.1 * k, 1.0, {1}));
    simulation.advance_to(kTestStart + 0.1 * k + 0.05);
    if (simulation.robot().thrust().sum() == 0.0) return 0.1 * k + 0.05;
    simulation.advance_to(kTestStart + 0.1 * (k + 1));
  }
  return scenario.duration_s;
}

TEST(AirSupply, OneOpenThrusterEmptiesThreeBottlesIn456Seconds) {
  const Scenario scenario = with_lines(
      "pneumatics: {open_bottles: 3}\neffects: [{kind: viscous_drag, parameters: "
      "{linear_n_s_m: 40.0, angular_n_m_s: 1.0}}]\n");
  Simulation simulation(scenario, kTestStart);
  const double empty = seconds_until_empty(scenario, simulation);
  EXPECT_NEAR(empty, 456.0, 0.02 * 456.0);
  std::printf("one thruster open: empty after %.1f s\n", empty);
  const Robot& robot = simulation.robot();
  // 1.65 kg down to 10 of 300 bar.
  EXPECT_NEAR(robot.mass_kg(), 16.8 - 1.65 * 290.0 / 300.0, 1e-3);
  EXPECT_NEAR(robot.air()->bottle_bar, 10.0, 0.01);
  EXPECT_EQ(robot.air()->thruster_bar, 0.0);
  EXPECT_EQ(robot.air()->gas_remaining_kg, 0.0);
  EXPECT_EQ(robot.air_flow_kg_s(), 0.0);
  // The bearings are down: it stands, and no command opens a valve.
  simulation.advance_to(kTestStart + empty + 3.0);
  EXPECT_LT(robot.truth().v_WC.norm(), 1e-6);
  simulation.robot().command(open_thrusters(std::ceil(simulation.time_s() * 10.0) / 10.0, 1.0, {1, 3}));
  const double gas = robot.hidden()[0];
  simulation.advance_to(simulation.time_s() + 0.2);
  EXPECT_LT(robot.truth().v_WC.norm(), 1e-6);
  EXPECT_EQ(robot.hidden()[0], gas);
}

TEST(AirSupply, FewerBottlesAndFlowThroughTheBearingsEndItSooner) {
  const auto lasts = [](Scenario scenario) {
    Simulation simulation(scenario, kTestStart);
    return seconds_until_empty(scenario, simulation);
  };
  EXPECT_NEAR(lasts(with_lines("pneumatics: {open_bottles: 1}\n")), 151.9, 0.2);
  Scenario leaky = with_lines("pneumatics: {open_bottles: 3}\n");
  leaky.vehicle.pneumatics->bearing_flow_kg_s = 0.0035;
  EXPECT_NEAR(lasts(leaky), 227.9, 0.2);
  // Without the key the supply has no end.
  EXPECT_EQ(lasts(with_lines("")), 600.0);
}

// Only the bearings use air; once they are down, a propeller pulls against them in vain, but pulls.
TEST(AirSupply, PropellersTakeNoneAndTurnOnWithout) {
  Scenario scenario = with_lines("pneumatics: {open_bottles: 1}\n", "atmos_propeller");
  scenario.vehicle.pneumatics->bearing_flow_kg_s = 0.1;
  Simulation simulation(scenario, kTestStart);
  const Robot& robot = simulation.robot();
  for (const double after_s : {0.0, 10.0}) {
    simulation.advance_to(kTestStart + after_s);
    simulation.robot().command({kTestStart + after_s, 0.5, {1.0, 1.0, 0.0, 0.0}});
    const double gas = robot.hidden()[0];
    simulation.advance_to(kTestStart + after_s + 0.4);
    EXPECT_EQ(robot.air()->operable, after_s == 0.0);
    EXPECT_NEAR(robot.hidden()[0] - gas, after_s == 0.0 ? 0.04 : 0.0, 1e-9);
    EXPECT_NEAR(robot.thrust().sum(), 3.92, 0.01);
    EXPECT_EQ(robot.truth().v_WC.norm() > 0.05, after_s == 0.0);
  }
}

TEST(AirSupply, PressuresFollowTheGas) {
  const Pneumatics air = *with_lines("").vehicle.pneumatics;
  const AirReading full = read_air(air, {3, false}, 0.0);
  EXPECT_NEAR(full.bottle_bar, 300.0, kPascal);
  EXPECT_NEAR(full.gas_remaining_kg, 1.595, 1e-9);
  EXPECT_EQ(full.thruster_bar, 6.0);
  EXPECT_EQ(full.bearing_bar, 5.0);
  EXPECT_TRUE(full.operable);
  EXPECT_NEAR(read_air(air, {3, false}, 0.825).bottle_bar, 150.0, kPascal);
  EXPECT_FALSE(read_air(air, {2, false}, 1.1).operable);
  EXPECT_TRUE(read_air(air, {2, true}, 1.1).operable);
}

TEST(AirSupply, AHoseFeedsForEverAndPulls) {
  const std::string tether =
      "effects: [{kind: tether, parameters: {anchor_x_m: -1.0, anchor_y_m: 0.0, slack_m: 0.5, "
      "stiffness_n_m: 2.0, damping_n_s_m: 0.0}}]\n";
  const Scenario scenario = with_lines("pneumatics: {open_bottles: 1, tethered: true}\n" + tether);
  Simulation simulation(scenario, kTestStart);
  simulation.advance_to(kTestStart + 0.1);
  // 1 N towards the anchor.
  EXPECT_NEAR(simulation.robot().truth().v_WC.x(), -0.1 / 16.8, 1e-4);
  Simulation fed(scenario, kTestStart);
  EXPECT_EQ(seconds_until_empty(scenario, fed), 600.0);
  EXPECT_EQ(fed.robot().mass_kg(), 16.8);
  EXPECT_EQ(fed.robot().air()->bottle_bar, 300.0);
  fed.robot().command(open_thrusters(kTestStart + 600.0, 1.0, {1, 2}));
  EXPECT_NEAR(fed.robot().air_flow_kg_s(), 0.007, 1e-12);
  EXPECT_THROW(with_lines("pneumatics: {open_bottles: 1, tethered: true}\n"), ConfigError);
  EXPECT_THROW(with_lines("pneumatics: {open_bottles: 4}\n"), ConfigError);
}

TEST(Battery, DrainsWithTheLoad) {
  Scenario scenario = with_lines("");
  Battery& battery = *scenario.vehicle.battery;
  Simulation idle(scenario, kTestStart);
  idle.advance_to(kTestStart + 600.0);
  const BatteryReading at_rest = *idle.robot().battery();
  // Terminals deliver the load; the charge that is gone is its current over time.
  EXPECT_NEAR(at_rest.voltage_v * at_rest.current_a, battery.idle_w, 1e-9);
  EXPECT_NEAR(at_rest.charge_ah, 9.5 - battery.idle_w / 25.1 * 600.0 / 3600.0, 2e-3);
  EXPECT_LT(at_rest.voltage_v, 25.2);
  Simulation busy(scenario, kTestStart);
  seconds_until_empty(scenario, busy);
  EXPECT_NEAR(busy.robot().battery()->voltage_v * busy.robot().battery()->current_a,
              battery.idle_w + battery.actuator_w, 1e-6);
  EXPECT_LT(busy.robot().battery()->share, at_rest.share);
  scenario.vehicle.battery.reset();
  EXPECT_FALSE(Simulation(scenario, kTestStart).robot().battery().has_value());
}

}  // namespace
}  // namespace atmos
