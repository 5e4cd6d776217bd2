#include "atmos_operator/teleop.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <sstream>

#include "atmos_model/strict_yaml.h"

namespace atmos {
namespace {

constexpr double kStart = 1234.5, kNan = std::numeric_limits<double>::quiet_NaN();
const std::vector<int> kHeld = {1}, kReleased = {0};
const std::vector<double> kRest = {0.0, 0.0, 0.0};

const Vehicle& vehicle() {
  static const Vehicle loaded = load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml");
  return loaded;
}

TeleopConfig config() { return {0, 0.1, {0, false}, {1, false}, {2, true}, 0.5, 0.5, 0.2, 0.5, 0.2, 0.3}; }

Teleop ready(TeleopMode mode, const TeleopConfig& with = config()) {
  Teleop teleop(with, vehicle(), mode);
  teleop.see({1.0, 2.0, 3.1}, kStart);
  teleop.take(kRest, kReleased, kStart);
  return teleop;
}

TEST(Teleop, LimitsAreThoseOfTheVehicle) {
  const TeleopLimits limits = teleop_limits(vehicle());
  EXPECT_NEAR(limits.force_n, 3.4, 1e-9);
  EXPECT_NEAR(limits.torque_n_m, 0.816, 1e-9);
  EXPECT_NEAR(limits.speed_m_s, 3.4 / 16.8, 1e-9);
  EXPECT_NEAR(limits.yaw_rate_rad_s, 0.816 / 0.297, 1e-9);
}

TEST(Teleop, CommandsNothingUnlessTheDeadManIsHeld) {
  Teleop teleop = ready(TeleopMode::kWrench);
  teleop.take({1.0, 1.0, 1.0}, kReleased, kStart + 0.1);
  EXPECT_FALSE(teleop.due(kStart + 0.1));
  teleop.take({1.0, 0.0, 0.0}, kHeld, kStart + 0.2);
  const auto command = teleop.due(kStart + 0.2);
  ASSERT_TRUE(command);
  EXPECT_FALSE(command->closed);
  EXPECT_NEAR(command->wrench[0], 1.7, 1e-9);
}

TEST(Teleop, ADeadManHeldFromTheStartDoesNotCount) {
  Teleop teleop(config(), vehicle(), TeleopMode::kWrench);
  for (double t = 0.0; t < 1.0; t += 0.05) {
    teleop.take({1.0, 0.0, 0.0}, kHeld, kStart + t);
    EXPECT_FALSE(teleop.due(kStart + t));
  }
}

TEST(Teleop, ReleaseClosesOnceAndThenSaysNothing) {
  for (const TeleopMode mode : {TeleopMode::kWrench, TeleopMode::kRate}) {
    Teleop teleop = ready(mode);
    teleop.take({1.0, 0.0, 1.0}, kHeld, kStart + 0.05);
    ASSERT_TRUE(teleop.due(kStart + 0.05));
    teleop.take({1.0, 0.0, 1.0}, kReleased, kStart + 0.1);
    const auto command = teleop.due(kStart + 0.1);
    ASSERT_TRUE(command);
    EXPECT_TRUE(command->closed);
    EXPECT_EQ(command->wrench.norm() + std::abs(command->yaw_rate), 0.0);
    EXPECT_FALSE(teleop.due(kStart + 0.11));
  }
}

TEST(Teleop, SilenceClosesAndWantsTheDeadManAnew) {
  Teleop teleop = ready(TeleopMode::kWrench);
  teleop.take({1.0, 0.0, 0.0}, kHeld, kStart + 0.1);
  EXPECT_FALSE(teleop.due(kStart + 0.1 + Teleop::kSilence_s - 0.01)->closed);
  EXPECT_TRUE(teleop.due(kStart + 0.1 + Teleop::kSilence_s + 0.01)->closed);
  EXPECT_FALSE(teleop.due(kStart + 0.5));
  teleop.take({1.0, 0.0, 0.0}, kHeld, kStart + 0.6);  // the line is back, the button still down
  EXPECT_FALSE(teleop.due(kStart + 0.6));
  teleop.take({1.0, 0.0, 0.0}, kReleased, kStart + 0.7);
  teleop.take({1.0, 0.0, 0.0}, kHeld, kStart + 0.8);
  EXPECT_TRUE(teleop.due(kStart + 0.8));
}

TEST(Teleop, BadReadingsAreCountedAndClose) {
  const double infinity = std::numeric_limits<double>::infinity();
  const std::vector<std::pair<std::vector<double>, std::vector<int>>> bad = {{{kNan, 0.0, 0.0}, kHeld},
                                                                             {{0.0, infinity, 0.0}, kHeld},
                                                                             {{0.0, 0.0, -1.1}, kHeld},
                                                                             {{0.0, 0.0}, kHeld},
                                                                             {kRest, {}},
                                                                             {{}, {}}};
  for (const auto& [axes, buttons] : bad) {
    Teleop teleop = ready(TeleopMode::kWrench);
    teleop.take({1.0, 0.0, 0.0}, kHeld, kStart + 0.05);
    ASSERT_TRUE(teleop.due(kStart + 0.05));
    teleop.take(axes, buttons, kStart + 0.1);
    EXPECT_EQ(teleop.refused(), 1u);
    EXPECT_FALSE(teleop.fault().empty());
    EXPECT_TRUE(teleop.due(kStart + 0.1)->closed);
    teleop.take({1.0, 0.0, 0.0}, kHeld, kStart + 0.15);  // good again, but never released
    EXPECT_TRUE(teleop.fault().empty());
    EXPECT_FALSE(teleop.due(kStart + 0.15));
  }
}

TEST(Teleop, AxesThatAreNotUsedMayBeAnything) {
  Teleop teleop = ready(TeleopMode::kWrench);
  teleop.take({0.0, 0.0, 0.0, kNan, 7.0}, kHeld, kStart + 0.1);
  EXPECT_EQ(teleop.refused(), 0u);
  EXPECT_TRUE(teleop.due(kStart + 0.1));
}

TEST(Teleop, DeadZoneAndSign) {
  Teleop teleop = ready(TeleopMode::kWrench);
  teleop.take({0.09, -0.55, 0.55}, kHeld, kStart + 0.1);
  const BodyWrench wrench = teleop.due(kStart + 0.1)->wrench;
  EXPECT_EQ(wrench[0], 0.0);
  EXPECT_NEAR(wrench[1], -0.5 * 1.7, 1e-9);          // half of the way outside the dead zone
  EXPECT_NEAR(wrench[2], -0.5 * 0.5 * 0.816, 1e-9);  // inverted
}

TEST(Teleop, NeverAsksForMoreThanTheVehicleCan) {
  TeleopConfig all = config();
  all.force_share = all.torque_share = all.yaw_rate_share = 1.0;
  const Allocator allocator(vehicle());
  for (const TeleopMode mode : {TeleopMode::kWrench, TeleopMode::kRate}) {
    Teleop teleop = ready(mode, all);
    double t = kStart;
    for (const double x : {-1.0, -0.4, 0.0, 1.0}) {
      for (const double y : {-1.0, 0.3, 1.0}) {
        for (const double turn : {-1.0, 0.0, 1.0}) {
          teleop.take({x, y, turn}, kHeld, t += 0.01);
          const auto command = teleop.due(t);
          ASSERT_TRUE(command);
          EXPECT_GE(allocator.attainable_scale(command->wrench), 1.0 - 1e-9);
          EXPECT_LE(command->wrench.head<2>().norm(), 3.4 + 1e-9);
          EXPECT_LE(std::abs(command->yaw_rate), 0.816 / 0.297 + 1e-9);
        }
      }
    }
  }
}

TEST(Teleop, RateModeAsksForAYawRateAndNoTorque) {
  Teleop teleop = ready(TeleopMode::kRate);
  teleop.take({0.0, 1.0, -1.0}, kHeld, kStart + 0.1);
  const auto command = teleop.due(kStart + 0.1);
  EXPECT_NEAR(command->wrench[1], 1.7, 1e-9);
  EXPECT_EQ(command->wrench[2], 0.0);
  EXPECT_NEAR(command->yaw_rate, 0.2 * 0.816 / 0.297, 1e-9);
}

TEST(Teleop, PositionModeMovesTheSetPointFromWhereTheRobotIs) {
  Teleop teleop = ready(TeleopMode::kPosition);
  teleop.take({1.0, 0.0, -1.0}, kHeld, kStart + 0.1);
  EXPECT_EQ(teleop.due(kStart + 0.1)->pose, Eigen::Vector3d(1.0, 2.0, 3.1));
  const auto moved = teleop.due(kStart + 0.2);
  EXPECT_NEAR(moved->pose.x(), 1.0 + 0.1 * 0.5 * 3.4 / 16.8, 1e-9);
  EXPECT_EQ(moved->pose.y(), 2.0);
  EXPECT_NEAR(moved->pose.z(), 3.1 + 0.1 * 0.2 * 0.816 / 0.297, 1e-9);
}

TEST(Teleop, TheSetPointStaysNearTheRobotAlsoAcrossPi) {
  Teleop teleop = ready(TeleopMode::kPosition);
  std::optional<TeleopCommand> command;
  for (double t = 0.1; t < 10.0; t += 0.1) {
    teleop.see({1.0, 2.0, t < 9.85 ? 3.1 : 3.1 - 2.0 * M_PI}, kStart + t);
    teleop.take({0.6, 0.8, 1.0}, kHeld, kStart + t);
    command = teleop.due(kStart + t);
  }
  EXPECT_NEAR((command->pose.head<2>() - Eigen::Vector2d(1.0, 2.0)).norm(), 0.2, 1e-9);
  EXPECT_NEAR(std::remainder(command->pose.z() - 3.1, 2.0 * M_PI), -0.3, 1e-9);
}

TEST(Teleop, PositionModeHoldsTheRobotsPlaceOnRelease) {
  Teleop teleop = ready(TeleopMode::kPosition);
  teleop.take({1.0, 0.0, 0.0}, kHeld, kStart + 0.1);
  teleop.due(kStart + 0.1);
  teleop.see({1.05, 2.01, 3.0}, kStart + 0.2);
  teleop.see({kNan, 2.01, 3.0}, kStart + 0.21);
  teleop.take({1.0, 0.0, 0.0}, kReleased, kStart + 0.25);
  const auto command = teleop.due(kStart + 0.25);
  EXPECT_TRUE(command->closed);
  EXPECT_EQ(command->pose, Eigen::Vector3d(1.05, 2.01, 3.0));
  EXPECT_FALSE(teleop.due(kStart + 0.26));
}

TEST(Teleop, PositionModeSaysNothingOfARobotThatIsNotSeen) {
  Teleop teleop = ready(TeleopMode::kPosition);
  for (double t = 0.1; t < 1.0; t += 0.1) {
    teleop.take({1.0, 0.0, 0.0}, kHeld, kStart + t);
    EXPECT_EQ(teleop.due(kStart + t).has_value(), t <= Teleop::kPoseLimit_s) << t;
  }
}

TEST(TeleopConfig, ShippedFilesAreRead) {
  const TeleopConfig joystick = load_teleop(ATMOS_CONFIG_DIR "/teleop/joystick.yaml");
  EXPECT_EQ(joystick.dead_man_button, 5);
  EXPECT_EQ(joystick.turn.index, 3);
  EXPECT_NEAR(joystick.ahead_rad, 20.0 * M_PI / 180.0, 1e-12);
  EXPECT_EQ(load_teleop(ATMOS_CONFIG_DIR "/teleop/keyboard.yaml").dead_man_button, 0);
}

TEST(TeleopConfig, FaultsNameFileKeyAndRule) {
  std::ifstream in(ATMOS_CONFIG_DIR "/teleop/joystick.yaml");
  std::stringstream text;
  text << in.rdbuf();
  std::string content = text.str();
  const auto replace = [&content](const std::string& from, const std::string& to) {
    ASSERT_NE(content.find(from), std::string::npos) << from;
    content.replace(content.find(from), from.size(), to);
  };
  replace("force: 0.5", "force: 1.5");
  replace("dead_zone: 0.1", "dead_zone: 1.0");
  replace("left: {axis: 0}", "left: {axis: 1}");
  replace("speed: 0.5", "sped: 0.5");
  const std::string path = testing::TempDir() + "teleop_test.yaml";
  std::ofstream(path) << content;
  try {
    load_teleop(path);
    FAIL() << "accepted";
  } catch (const ConfigError& error) {
    const std::string what = error.what();
    for (const char* word :
         {"teleop_test.yaml", "shares.force", "dead_zone", "three different axes", "sped", "speed"})
      EXPECT_NE(what.find(word), std::string::npos) << word << " in\n" << what;
  }
}

}  // namespace
}  // namespace atmos
