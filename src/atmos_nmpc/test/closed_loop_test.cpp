// The paper's set-point sequence against the model's own plant, with measurement noise.
#include "closed_loop.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "atmos_nmpc/config.h"

namespace atmos {
namespace {

using testing::kDegree;
using testing::kLabNoise;
using testing::kStart;
using testing::stopped_clock;

using testing::FlightRow;
using testing::planar_goal;

constexpr double kHold = 20.0;
constexpr int kPeriods = 200;  // per set-point

class ClosedLoop : public ::testing::Test {
 protected:
  std::vector<FlightRow> fly(const std::vector<Eigen::Vector3d>& poses, testing::Noise noise,
                             std::uint32_t seed, PlanarState<double> start = {}) {
    Controller controller(vehicle_, config_, true, stopped_clock);
    for (std::size_t i = 0; i < poses.size(); ++i)
      controller.add_goal(
          planar_goal(kStart + kHold * static_cast<double>(i), poses[i][0], poses[i][1], poses[i][2]));
    testing::Flight flight(vehicle_, controller, kStart, start, noise, seed);
    std::vector<FlightRow> rows;
    for (std::size_t k = 0; k < kPeriods * poses.size(); ++k) {
      rows.push_back(flight.period());
      const ControlDecision& decision = rows.back().decision;
      EXPECT_TRUE(is_success(decision.solve.status))
          << "period " << k << ": " << name_of(decision.solve.status);
      for (const double duty : decision.command.duty) EXPECT_TRUE(duty >= 0.0 && duty <= 1.0) << duty;
    }
    return rows;
  }

  const Vehicle vehicle_ = load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml");
  ControllerConfig config_ = load_controller(ATMOS_CONFIG_DIR "/controller/direct_allocation.yaml", vehicle_);
};

Eigen::Vector3d error_of(const FlightRow& row, const Eigen::Vector3d& pose) {
  return Eigen::Vector3d(row.truth.p_WC.x(), row.truth.p_WC.y(), row.truth.yaw) - pose;
}

TEST_F(ClosedLoop, PaperSequence) {
  const std::vector<Eigen::Vector3d> poses = {
      {0, 0, 0}, {1, 0, 0}, {1, 0, 45 * kDegree}, {1, 1, 90 * kDegree}, {0, 0, 0}};
  const std::vector<FlightRow> rows = fly(poses, kLabNoise, 7);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    SCOPED_TRACE("set-point " + std::to_string(i));
    const Eigen::Vector3d step = i == 0 ? Eigen::Vector3d::Zero() : Eigen::Vector3d(poses[i] - poses[i - 1]);
    Eigen::Vector3d overshoot = Eigen::Vector3d::Zero(), mean = Eigen::Vector3d::Zero();
    double settled_s = 0.0, impulse = 0.0;
    for (std::size_t k = 0; k < kPeriods; ++k) {
      const FlightRow& row = rows[kPeriods * i + k];
      const Eigen::Vector3d error = error_of(row, poses[i]);
      for (int axis = 0; axis < 3; ++axis) {
        if (step[axis] != 0.0) overshoot[axis] = std::max(overshoot[axis], error[axis] / step[axis]);
      }
      if (error.head<2>().norm() > 0.05 || std::abs(error[2]) > 5 * kDegree)
        settled_s = 0.1 * static_cast<double>(k + 1);
      if (k < 150) continue;
      mean += error / 50.0;
      for (const double duty : row.decision.command.duty) impulse += duty * 1.7 * 0.1;
    }
    EXPECT_LT(overshoot.maxCoeff(), 0.05);
    EXPECT_LT(settled_s, 7.0);
    EXPECT_LT(mean.head<2>().norm(), 0.003);
    EXPECT_LT(std::abs(mean[2]), 0.1 * kDegree);
    EXPECT_LT(impulse, 0.4);  // N s in 5 s at rest: what the noise costs, 0.08 N out of 13.6 N
  }
}

TEST_F(ClosedLoop, ReachesEveryHeadingTheShortWay) {
  for (const double yaw : {170.0, -170.0, 179.9, 90.0}) {
    PlanarState<double> start;
    start.yaw = 45 * kDegree;
    const double target = start.yaw + yaw * kDegree;
    const std::vector<FlightRow> rows = fly({{0, 0, wrap_angle(target)}}, kLabNoise, 3, start);
    EXPECT_NEAR(rows.back().truth.yaw, target, 0.5 * kDegree) << yaw;  // not wrapped: the way counts
  }
}

TEST_F(ClosedLoop, PaperErrorFliesToo) {
  config_.attitude_error = AttitudeError::kPaper;
  config_.weights.terminal_factor = 20.0;
  config_.weights.attitude.setConstant(8e3);
  const std::vector<FlightRow> rows = fly({{1, 0, 45 * kDegree}}, {}, 1);
  const Eigen::Vector3d error = error_of(rows.back(), {1, 0, 45 * kDegree});
  EXPECT_LT(error.head<2>().norm(), 0.01);
  EXPECT_LT(std::abs(error[2]), 1.0 * kDegree);
}

TEST_F(ClosedLoop, SoftBoundsHoldFromInsideAndBringBackFromOutside) {
  config_.bounds.velocity.setConstant(0.1);
  const std::vector<FlightRow> rows = fly({{1, 0, 0}}, {}, 1);
  double fastest = 0.0;
  for (const FlightRow& row : rows) fastest = std::max(fastest, row.truth.v_WC.x());
  EXPECT_GT(fastest, 0.08);
  EXPECT_LT(fastest, 0.12);

  PlanarState<double> start;
  start.v_WC.x() = 0.4;
  EXPECT_LT(fly({{1, 0, 0}}, {}, 1, start)[50].truth.v_WC.x(), 0.12);
}

TEST_F(ClosedLoop, RepeatsBitByBit) {
  const auto first = fly({{1, 0.5, 1.0}}, kLabNoise, 9), second = fly({{1, 0.5, 1.0}}, kLabNoise, 9);
  for (std::size_t k = 0; k < first.size(); ++k)
    ASSERT_EQ(first[k].decision.command.duty, second[k].decision.command.duty) << k;
}

}  // namespace
}  // namespace atmos
