#include "atmos_operator/robot_report.h"

#include <gtest/gtest.h>

#include <limits>

namespace atmos {
namespace {

constexpr double kNow = 1234.5;

PanelRow row(const RobotReport& report, const std::string& name, double now_s = kNow) {
  for (const PanelRow& row : panel_rows(report, now_s)) {
    if (row.name == name) return row;
  }
  ADD_FAILURE() << "no row " << name;
  return {};
}

RobotReport flying() {
  RobotReport report;
  report.autopilot = {{true, true, "offboard", 0.004}, kNow};
  report.supervisor = {{SupervisorReport::State::kFlying, false, "", ""}, kNow};
  report.controller = {{ControllerReport::Mode::kSolved, 0.003, 2}, kNow};
  report.battery = {{0.8, 15.9}, kNow};
  report.gas = {{0.5, 200e5, false}, kNow};
  report.mission = {"running", kNow};
  report.tracked = {true, kNow};
  report.distance = {{0.8, false, ""}, kNow};
  return report;
}

TEST(RobotReport, NothingHeardIsNothingShown) {
  for (const PanelRow& row : panel_rows({}, kNow)) {
    EXPECT_EQ(row.text, "–") << row.name;
    EXPECT_EQ(row.health, Health::kUnknown) << row.name;
  }
  const PanelButtons buttons = panel_buttons({}, kNow);
  EXPECT_FALSE(buttons.arm || buttons.disarm || buttons.kill || buttons.mode || buttons.start_mission ||
               buttons.stop_mission || buttons.release_kill || buttons.release_hold);
}

TEST(RobotReport, AFlightIsAllGood) {
  for (const PanelRow& row : panel_rows(flying(), kNow)) EXPECT_EQ(row.health, Health::kGood) << row.name;
  EXPECT_EQ(row(flying(), "Link").text, "armed, offboard, 4.0 ms");
  EXPECT_EQ(row(flying(), "Controller").text, "flying, solve 3.0 ms, 2 late");
  EXPECT_EQ(row(flying(), "Battery").text, "80 %, 15.9 V");
  EXPECT_EQ(row(flying(), "Gas").text, "500 g, bottles at 200 bar");
  EXPECT_EQ(row(flying(), "Distance").text, "0.80 m to the nearest");
}

TEST(RobotReport, SilenceIsBadButKeepsDisarmAndKill) {
  const double later = kNow + kSilence_s + 5.0;
  EXPECT_EQ(row(flying(), "Link", later).health, Health::kBad);
  EXPECT_EQ(row(flying(), "Link", later).text, "silent for 7 s");
  EXPECT_EQ(row(flying(), "Mission", later).text, "running") << "said once, when it changes";
  const PanelButtons buttons = panel_buttons(flying(), later);
  EXPECT_TRUE(buttons.kill && buttons.disarm);
  EXPECT_FALSE(buttons.arm || buttons.mode);
}

TEST(RobotReport, AKilledRobotIsReleasedBeforeItIsArmed) {
  RobotReport report = flying();
  report.supervisor->value = {SupervisorReport::State::kClosed, true, "killed", ""};
  EXPECT_EQ(row(report, "Supervisor").health, Health::kBad);
  EXPECT_EQ(row(report, "Supervisor").text, "valves closed: killed");
  const PanelButtons buttons = panel_buttons(report, kNow);
  EXPECT_TRUE(buttons.release_kill && buttons.kill);
  EXPECT_FALSE(buttons.arm);
}

TEST(RobotReport, ARefusalIsShown) {
  RobotReport report = flying();
  report.supervisor->value = {SupervisorReport::State::kPreparing, false, "", "arm: denied"};
  EXPECT_EQ(row(report, "Supervisor").text, "preparing; refused: arm: denied");
  EXPECT_EQ(row(report, "Supervisor").health, Health::kWarning);
  report.supervisor->value.state = SupervisorReport::State::kFlying;
  EXPECT_EQ(row(report, "Supervisor").text, "flying");
}

TEST(RobotReport, WithoutAnAutopilotTheFlightControllerIsShown) {
  RobotReport report;
  report.flight_controller = {{false, "odometry is old"}, kNow};
  EXPECT_EQ(row(report, "Flight controller").text, "valves closed: odometry is old");
  EXPECT_FALSE(panel_buttons(report, kNow).kill);
}

TEST(RobotReport, SuppliesRunLow) {
  RobotReport report = flying();
  report.battery->value.charge = 0.2;
  EXPECT_EQ(row(report, "Battery").health, Health::kWarning);
  report.battery->value.charge = 0.1;
  EXPECT_EQ(row(report, "Battery").health, Health::kBad);
  report.gas->value.remaining_kg = 0.03;
  EXPECT_EQ(row(report, "Gas").health, Health::kWarning);
  report.gas->value.remaining_kg = std::numeric_limits<double>::infinity();
  EXPECT_EQ(row(report, "Gas").health, Health::kUnknown);
  report.gas->value.tethered = true;
  EXPECT_EQ(row(report, "Gas").health, Health::kGood);
}

TEST(RobotReport, AHeldRobotSaysWhyAndCanBeReleased) {
  RobotReport report = flying();
  report.distance->value = {0.1, true, "0.10 m to crackle"};
  EXPECT_EQ(row(report, "Distance").text, "held: 0.10 m to crackle");
  EXPECT_TRUE(panel_buttons(report, kNow).release_hold);
  EXPECT_FALSE(panel_buttons(flying(), kNow).release_hold);
}

TEST(RobotReport, MissionButtonsFollowItsState) {
  RobotReport report = flying();
  EXPECT_TRUE(panel_buttons(report, kNow).stop_mission);
  for (const char* state : {"idle", "stopped"}) {
    report.mission->value = state;
    EXPECT_TRUE(panel_buttons(report, kNow).start_mission);
    EXPECT_FALSE(panel_buttons(report, kNow).stop_mission);
  }
}

TEST(RobotReport, RobotsAreFoundByTheirCommands) {
  EXPECT_EQ(robots_among({{"/snap/thruster_command", "atmos_msgs/ThrusterCommand"},
                          {"/snap/nmpc/thrusters", "atmos_msgs/ThrusterCommand"},
                          {"/lab/crackle/thruster_command", "atmos_msgs/ThrusterCommand"},
                          {"/other/thruster_command", "std_msgs/String"},
                          {"/thruster_command", "atmos_msgs/ThrusterCommand"},
                          {"/rosout", "rosgraph_msgs/Log"}}),
            (std::vector<std::string>{"/lab/crackle", "/snap"}));
}

}  // namespace
}  // namespace atmos
