#include "atmos_mocap_bridge/lockstep_gate.h"

#include <gtest/gtest.h>

namespace atmos {
namespace {

constexpr double kStart = 1234.5;

PoseFrame frame(double stamp) { return {stamp, Eigen::Vector3d::Zero(), Eigen::Quaterniond::Identity()}; }
ThrusterCommand command(double stamp) { return {stamp, 0.1, {0.0}}; }

TEST(LockstepGate, TheFirstFrameNeedsNoCommand) {
  LockstepGate gate(0.1);
  EXPECT_FALSE(gate.next());
  gate.add_frame(frame(kStart));
  const auto ready = gate.next();
  ASSERT_TRUE(ready);
  EXPECT_EQ(ready->frame.stamp_s, kStart);
  EXPECT_TRUE(ready->commands.empty());
}

TEST(LockstepGate, FramesOfAPeriodWaitForItsCommand) {
  LockstepGate gate(0.1);
  gate.add_frame(frame(kStart));
  ASSERT_TRUE(gate.next());
  for (int k = 1; k <= 11; ++k) gate.add_frame(frame(kStart + 0.01 * k));
  EXPECT_FALSE(gate.next());
  gate.add_command(command(kStart));
  for (int k = 1; k <= 10; ++k) {
    const auto ready = gate.next();
    ASSERT_TRUE(ready) << k;
    EXPECT_EQ(ready->commands.size(), k == 1 ? 1u : 0u);
  }
  EXPECT_FALSE(gate.next()) << "the frame after the period's end needs the next command";
  EXPECT_EQ(gate.held(), 1u);
  gate.add_command(command(kStart + 0.1));
  EXPECT_TRUE(gate.next());
}

TEST(LockstepGate, TheFilterSeesOneOrderWhicheverArrivesFirst) {
  const auto sequence = [](bool commands_first) {
    LockstepGate gate(0.1);
    std::vector<double> seen;
    const auto drain = [&] {
      while (const auto ready = gate.next()) {
        for (const ThrusterCommand& one : ready->commands) seen.push_back(-one.stamp_s);
        seen.push_back(ready->frame.stamp_s);
      }
    };
    gate.add_frame(frame(kStart));
    drain();
    for (int period = 0; period < 5; ++period) {
      if (commands_first) gate.add_command(command(kStart + 0.1 * period));
      for (int k = 1; k <= 10; ++k) {
        gate.add_frame(frame(kStart + 0.1 * period + 0.01 * k));
        drain();
      }
      if (!commands_first) gate.add_command(command(kStart + 0.1 * period));
      drain();
    }
    return seen;
  };
  EXPECT_EQ(sequence(true), sequence(false));
  EXPECT_EQ(sequence(true).size(), 56u);
}

TEST(LockstepGate, ACommandAheadIsReleasedOnlyWithTheFramesItActsBefore) {
  LockstepGate gate(0.1);
  gate.add_command(command(kStart));
  gate.add_command(command(kStart + 0.1));
  gate.add_frame(frame(kStart));
  gate.add_frame(frame(kStart + 0.1));
  gate.add_frame(frame(kStart + 0.11));
  EXPECT_EQ(gate.next()->commands.size(), 0u);
  EXPECT_EQ(gate.next()->commands.size(), 1u);
  EXPECT_EQ(gate.next()->commands.size(), 1u);
}

}  // namespace
}  // namespace atmos
