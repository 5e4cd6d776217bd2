#include "atmos_sim2real/recording.h"

#include <gtest/gtest.h>

#include <limits>

#include "synthetic.h"

namespace atmos {
namespace {

constexpr double kStart = 1.7e9;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

Recording flown() {
  static const Recording recording = fly(nominal_vehicle(), {}, pulse_commands(kStart, 5.0, 3), 4).recording;
  return recording;
}

// The message with which a recording is refused; empty: it was taken.
std::string refusal(const Recording& recording, int thrusters = 8) {
  try {
    clean_recording(recording, thrusters);
    return "";
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
}

bool warns(const Recording& recording, const std::string& of) {
  for (const std::string& warning : recording.warnings) {
    if (warning.find(of) != std::string::npos) return true;
  }
  return false;
}

TEST(CleanRecording, TakesAGoodOneAsItIs) {
  const Recording clean = clean_recording(flown(), 8);
  EXPECT_TRUE(clean.warnings.empty());
  EXPECT_EQ(clean.poses.size(), flown().poses.size());
  EXPECT_DOUBLE_EQ(clean.start_s(), kStart);
}

TEST(CleanRecording, RefusesWhatNothingCanBeConcludedFrom) {
  Recording none = flown();
  none.commands.clear();
  EXPECT_NE(refusal(none).find("no thruster commands"), std::string::npos);

  Recording one_pose = flown();
  one_pose.poses.resize(1);
  EXPECT_NE(refusal(one_pose).find("fewer than two usable poses"), std::string::npos);

  EXPECT_NE(refusal(flown(), 4).find("not for the 4 thrusters"), std::string::npos);

  Recording apart = flown();
  for (PoseSample& pose : apart.poses) pose.time_s += 3600.0;
  EXPECT_NE(refusal(apart).find("clocks apart"), std::string::npos);
}

TEST(CleanRecording, DropsPosesThatAreNotFinite) {
  Recording raw = flown();
  raw.poses[50].x_m = kNaN;
  raw.poses[60].yaw_rad = std::numeric_limits<double>::infinity();
  const Recording clean = clean_recording(raw, 8);
  EXPECT_EQ(clean.poses.size(), raw.poses.size() - 2);
  EXPECT_TRUE(warns(clean, "2 poses are not finite"));
}

TEST(CleanRecording, SortsPosesAndDropsRepeats) {
  Recording raw = flown();
  std::swap(raw.poses[30], raw.poses[31]);
  raw.poses.insert(raw.poses.begin() + 100, raw.poses[100]);
  const Recording clean = clean_recording(raw, 8);
  EXPECT_TRUE(warns(clean, "1 poses are out of order"));
  EXPECT_TRUE(warns(clean, "1 poses repeat a stamp"));
  for (std::size_t i = 1; i < clean.poses.size(); ++i)
    ASSERT_GT(clean.poses[i].time_s, clean.poses[i - 1].time_s);
}

TEST(CleanRecording, DropsFrozenPoses) {
  Recording raw = flown();
  for (std::size_t i = 201; i < 211; ++i) {
    const double stamp = raw.poses[i].time_s;
    raw.poses[i] = raw.poses[200];
    raw.poses[i].time_s = stamp;
  }
  const Recording clean = clean_recording(raw, 8);
  EXPECT_TRUE(warns(clean, "10 poses repeat the pose before them"));
  EXPECT_EQ(clean.poses.size(), raw.poses.size() - 10);
}

TEST(CleanRecording, DropsMalformedCommands) {
  Recording raw = flown();
  raw.commands[3].duty[2] = kNaN;
  raw.commands[4].duty[0] = 1.5;
  raw.commands[5].period_s = 0.0;
  raw.commands[6].duty.resize(7);
  const Recording clean = clean_recording(raw, 8);
  EXPECT_TRUE(warns(clean, "4 commands are malformed"));
  EXPECT_EQ(clean.commands.size(), raw.commands.size() - 4);
}

TEST(CleanRecording, UnwrapsYaw) {
  Recording raw = flown();
  for (std::size_t i = 0; i < raw.poses.size(); ++i)
    raw.poses[i].yaw_rad = wrap_angle(3.0 + 0.01 * static_cast<double>(i));
  const Recording clean = clean_recording(raw, 8);
  EXPECT_NEAR(clean.poses.back().yaw_rad - clean.poses.front().yaw_rad,
              0.01 * static_cast<double>(raw.poses.size() - 1), 1e-9);
}

TEST(CleanRecording, LeavesOutPosesBeforeTheFirstCommand) {
  Recording raw = flown();
  raw.commands.erase(raw.commands.begin(), raw.commands.begin() + 10);
  EXPECT_GE(clean_recording(raw, 8).poses.front().time_s, kStart + 1.0 - 1e-6);
}

TEST(CleanRecording, StampsFarFromTheOthersAreDropped) {
  Recording recording = flown();
  recording.commands[3].stamp_s = 0.0;
  recording.commands[5].stamp_s += 1e9;
  recording.poses[7].time_s -= 4000.0;
  const Recording clean = clean_recording(recording, 8);
  EXPECT_DOUBLE_EQ(clean.start_s(), kStart);
  EXPECT_LT(clean.duration_s(), 6.0);
  EXPECT_TRUE(warns(clean, "2 commands are stamped far from the others"));
  EXPECT_TRUE(warns(clean, "1 poses are stamped far from the others"));
}

TEST(CleanRecording, SpikesAndWildNumbersAreDropped) {
  Recording recording = flown();
  recording.poses[100].x_m += 64.0;
  recording.poses[200].yaw_rad += 2.0;
  recording.poses[300].y_m = 1e200;
  recording.commands[4].period_s = 1e9;
  const Recording clean = clean_recording(recording, 8);
  EXPECT_EQ(clean.poses.size(), recording.poses.size() - 3);
  EXPECT_TRUE(warns(clean, "2 poses lie far from those before and after"));
  EXPECT_TRUE(warns(clean, "1 poses are not finite or off any floor"));
  EXPECT_TRUE(warns(clean, "1 commands are malformed"));
}

TEST(CleanRecording, AFastRobotIsNoSpike) {
  Recording recording = flown();
  for (std::size_t i = 0; i < recording.poses.size(); ++i)
    recording.poses[i].x_m += 0.3 * static_cast<double>(i);
  EXPECT_EQ(clean_recording(recording, 8).poses.size(), recording.poses.size());
}

}  // namespace
}  // namespace atmos
