#include "atmos_sim/mocap_sensor.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "test_scenario.h"

namespace atmos {
namespace {

// Frames of a robot that pushes along +x from the start.
std::vector<MocapFrame> frames_of(const Scenario& scenario, int count, std::uint32_t seed = 1) {
  Simulation simulation(scenario, kTestStart);
  MocapSensor mocap(scenario.mocap, seed, kTestStart);
  for (const ThrusterCommand& command : repeated(open_thrusters(kTestStart, 1.0, {1, 3}), 20))
    simulation.robot().command(command);
  std::vector<MocapFrame> frames;
  for (int k = 0; k < count; ++k) {
    simulation.advance_to(mocap.next_frame_s());
    frames.push_back(mocap.expose(simulation.robot()));
  }
  return frames;
}

bool lost(const MocapFrame& frame) {
  const bool nan = std::isnan(frame.pose.yaw);
  EXPECT_EQ(nan, std::isnan(frame.pose.p_W.x()));
  EXPECT_EQ(nan, std::isnan(frame.pose.p_W.y()));
  return nan;
}

double x_after(double t) { return 0.5 * (3.4 / 16.8) * t * t; }

TEST(MocapSensor, FramesStandAtWholeMultiplesOfThePeriod) {
  Scenario scenario = test_scenario();
  scenario.mocap.rate_hz = 120.0;
  const auto frames = frames_of(scenario, 240);
  EXPECT_DOUBLE_EQ(frames.front().stamp_s, kTestStart);  // 1000 s is frame 120000
  for (std::size_t k = 0; k < frames.size(); ++k) {
    EXPECT_DOUBLE_EQ(frames[k].stamp_s, (120000.0 + static_cast<double>(k)) / 120.0);
    EXPECT_NEAR(frames[k].pose.p_W.x(), x_after(frames[k].stamp_s - kTestStart), 1e-9);
  }
}

TEST(MocapSensor, TheFirstFrameIsNotBeforeTheStart) {
  const Scenario scenario = test_scenario();
  EXPECT_DOUBLE_EQ(MocapSensor(scenario.mocap, 1, 1000.0).next_frame_s(), 1000.0);
  EXPECT_DOUBLE_EQ(MocapSensor(scenario.mocap, 1, 1000.0001).next_frame_s(), 1000.01);
}

TEST(MocapSensor, NoiseHasTheGivenStandardDeviations) {
  Scenario scenario = test_scenario();
  scenario.mocap.noise_m = 3e-4;
  scenario.mocap.noise_rad = 9e-4;
  const int count = 20000;
  Simulation simulation(scenario, kTestStart);
  MocapSensor mocap(scenario.mocap, 17, kTestStart);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  for (int k = 0; k < count; ++k) {
    simulation.advance_to(mocap.next_frame_s());
    const MocapFrame frame = mocap.expose(simulation.robot());
    const Eigen::Vector3d error(frame.pose.p_W.x() / 3e-4, frame.pose.p_W.y() / 3e-4, frame.pose.yaw / 9e-4);
    sum += error;
    squares += error * error.transpose();
  }
  // Five standard deviations of mean, variance and correlation.
  const double bound = 5.0 / std::sqrt(static_cast<double>(count));
  const Eigen::Vector3d mean = sum / count;
  const Eigen::Matrix3d covariance = squares / count;
  for (int i = 0; i < 3; ++i) {
    EXPECT_LT(std::abs(mean[i]), bound);
    EXPECT_LT(std::abs(covariance(i, i) - 1.0), bound * std::sqrt(2.0));
    for (int j = 0; j < i; ++j) EXPECT_LT(std::abs(covariance(i, j)), bound);
  }
}

TEST(MocapSensor, LosesFramesAtRandomWithoutShiftingTheNoise) {
  Scenario scenario = test_scenario();
  scenario.mocap.noise_m = 3e-4;
  scenario.mocap.noise_rad = 9e-4;
  const auto complete = frames_of(scenario, 2000);
  scenario.mocap.dropout_probability = 0.1;
  const auto thinned = frames_of(scenario, 2000);
  int missing = 0;
  for (std::size_t k = 0; k < complete.size(); ++k) {
    EXPECT_EQ(thinned[k].stamp_s, complete[k].stamp_s);
    EXPECT_FALSE(lost(complete[k]));
    if (lost(thinned[k])) {
      ++missing;
      continue;
    }
    EXPECT_EQ(thinned[k].pose.p_W, complete[k].pose.p_W);
    EXPECT_EQ(thinned[k].pose.yaw, complete[k].pose.yaw);
  }
  EXPECT_NEAR(missing, 200, 5.0 * std::sqrt(2000.0 * 0.1 * 0.9));
}

TEST(MocapSensor, LosesExactlyTheFramesOfAStretch) {
  Scenario scenario = test_scenario();
  scenario.mocap.dropouts = {{0.5, 0.25}, {1.0, 0.01}};
  const auto frames = frames_of(scenario, 150);
  for (int k = 0; k < 150; ++k)
    EXPECT_EQ(lost(frames[static_cast<std::size_t>(k)]), (k >= 50 && k < 75) || k == 100) << k;
}

TEST(MocapSensor, LatencyShowsThePastUnderThePresentStamp) {
  Scenario scenario = test_scenario();
  MocapLatency latency;
  latency.delay_s = 0.0305;
  scenario.effects = {latency};
  const auto frames = frames_of(scenario, 100);
  for (std::size_t k = 0; k < frames.size(); ++k) {
    const double t = 0.01 * static_cast<double>(k);
    EXPECT_DOUBLE_EQ(frames[k].stamp_s, (100000.0 + static_cast<double>(k)) / 100.0);
    EXPECT_NEAR(frames[k].pose.p_W.x(), x_after(std::max(t - 0.0305, 0.0)), 1e-9);
  }
}

TEST(MocapSensor, SeedsDecideTheNoise) {
  Scenario scenario = test_scenario();
  scenario.mocap.noise_m = 3e-4;
  const auto a = frames_of(scenario, 10, 1), b = frames_of(scenario, 10, 1), c = frames_of(scenario, 10, 2);
  for (std::size_t k = 0; k < a.size(); ++k) {
    EXPECT_EQ(a[k].pose.p_W, b[k].pose.p_W);
    EXPECT_NE(a[k].pose.p_W, c[k].pose.p_W);
  }
}

}  // namespace
}  // namespace atmos
