// What the filter does with good frames, gaps, jumps and bad data, and in which frames it answers.
#include "atmos_mocap_bridge/pose_filter.h"

#include <gtest/gtest.h>

#include "sensor_simulator.h"

namespace atmos::test {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr double kFrame_s = 0.01;

// A robot that moves at constant velocity; frames by number, without noise.
class SteadyMotion : public ::testing::Test {
 protected:
  SteadyMotion() : config(nominal_config()), filter(config, nominal_vehicle()) {}

  Vector3d position(double k) const { return p0 + v * k * kFrame_s; }
  PoseFrame frame(double k) const {
    const Vector3d turn = w * k * kFrame_s;
    const Vector3d axis = turn.norm() > 0.0 ? turn.normalized() : Vector3d(Vector3d::UnitZ());
    return {kStart + k * kFrame_s, position(k), q0 * Quaterniond(Eigen::AngleAxisd(turn.norm(), axis))};
  }
  PoseFrame unseen(double k) const {
    return {kStart + k * kFrame_s, Vector3d::Constant(kNan), Quaterniond(kNan, kNan, kNan, kNan)};
  }
  // Frames `from` up to, not including, `to`.
  void track(int from, int to) {
    for (int k = from; k < to; ++k) {
      const FrameResult result = filter.take_frame(frame(k));
      ASSERT_TRUE(result.published) << k;
      ASSERT_EQ(result.state, TrackingState::kTracking) << k;
    }
  }

  MocapConfig config;
  PoseFilter filter;
  Vector3d p0{1.0, -2.0, 0.3}, v{0.2, -0.1, 0.05}, w{0.0, 0.0, 0.6};
  Quaterniond q0{Eigen::AngleAxisd(2.5, Vector3d(0.1, -0.2, 0.97).normalized())};
};

TEST_F(SteadyMotion, WaitsForTheFirstFrame) {
  EXPECT_EQ(filter.state(), TrackingState::kWaiting);
  const FrameResult nothing = filter.take_frame(unseen(0));
  EXPECT_EQ(nothing.state, TrackingState::kWaiting);
  EXPECT_FALSE(nothing.published);
  EXPECT_EQ(nothing.age_s, 0.0);
  const FrameResult first = filter.take_frame(frame(1));
  EXPECT_EQ(first.state, TrackingState::kTracking);
  EXPECT_TRUE(first.published);
  EXPECT_EQ(filter.counters().reinitialisations, 0u);
  EXPECT_EQ(filter.estimate().v_WB, Vector3d::Zero());
  EXPECT_EQ(filter.estimate().covariance(6, 6), config.initial_velocity_m_s * config.initial_velocity_m_s);
}

TEST_F(SteadyMotion, FindsTheVelocities) {
  track(0, 300);
  const PoseEstimate& estimate = filter.estimate();
  EXPECT_EQ(estimate.stamp_s, frame(299).stamp_s);
  EXPECT_LT((estimate.p_WB - position(299)).norm(), 1e-5);
  EXPECT_LT((estimate.v_WB - v).norm(), 1e-4);
  EXPECT_LT((estimate.w_WB_B - w).norm(), 1e-4);
  EXPECT_LT(estimate.q_WB.angularDistance(frame(299).q_WB), 1e-5);
}

TEST_F(SteadyMotion, TurnsThroughManyRevolutionsWithoutATransient) {
  w = {0.0, 0.0, 2.9};
  track(0, 1000);
  EXPECT_LT((filter.estimate().w_WB_B - w).norm(), 1e-3);
  EXPECT_EQ(filter.counters().rejected_gate, 0u);
}

TEST_F(SteadyMotion, StandingStillIsNoSingularity) {
  v.setZero();
  w.setZero();
  track(0, 100);
  EXPECT_TRUE(filter.estimate().covariance.allFinite());
  EXPECT_LT(filter.estimate().w_WB_B.norm(), 1e-12);
  EXPECT_LT((filter.estimate().p_WB - p0).norm(), 1e-12);
}

TEST_F(SteadyMotion, SignOfTheQuaternionDoesNotMatter) {
  for (int k = 0; k < 100; ++k) {
    PoseFrame flipped = frame(k);
    if (k % 2 == 1) flipped.q_WB.coeffs() *= -1.0;
    ASSERT_EQ(filter.take_frame(flipped).state, TrackingState::kTracking);
  }
  EXPECT_EQ(filter.counters().accepted, 100u);
}

TEST_F(SteadyMotion, CoastsOverAGapWithGrowingCovarianceAndIsThenLost) {
  track(0, 100);
  const int coast = static_cast<int>(std::lround(config.coast_s / kFrame_s));
  double variance = filter.estimate().covariance.diagonal().head<3>().sum();
  for (int k = 100; k < 100 + coast; ++k) {
    const FrameResult result = filter.take_frame(unseen(k));
    ASSERT_EQ(result.state, TrackingState::kCoasting) << k;
    ASSERT_TRUE(result.published);
    EXPECT_NEAR(result.age_s, (k - 99) * kFrame_s, 1e-9);
    EXPECT_EQ(filter.estimate().stamp_s, frame(k).stamp_s) << "never a stale pose";
    EXPECT_LT((filter.estimate().p_WB - position(k)).norm(), 2e-3);
    const double grown = filter.estimate().covariance.diagonal().head<3>().sum();
    EXPECT_GT(grown, variance);
    variance = grown;
  }
  for (int k = 100 + coast; k < 300; ++k) {
    const FrameResult result = filter.take_frame(unseen(k));
    ASSERT_EQ(result.state, TrackingState::kLost) << k;
    ASSERT_FALSE(result.published);
  }
  EXPECT_EQ(filter.counters().rejected_not_finite, 200u);
}

TEST_F(SteadyMotion, ContinuesAfterAShortGap) {
  track(0, 100);
  for (int k = 100; k < 120; ++k) filter.take_frame(unseen(k));
  EXPECT_EQ(filter.take_frame(frame(120)).state, TrackingState::kTracking);
  EXPECT_LT((filter.estimate().v_WB - v).norm(), 1e-2) << "the velocity was kept over the gap";
  track(121, 130);
  EXPECT_EQ(filter.counters().reinitialisations, 0u);
  EXPECT_LT((filter.estimate().v_WB - v).norm(), 1e-2);
}

TEST_F(SteadyMotion, StartsAnewWhenFramesReturn) {
  track(0, 100);
  for (int k = 100; k < 150; ++k) filter.take_frame(unseen(k));
  p0 += Vector3d(3.0, 0.0, 0.0);
  const FrameResult result = filter.take_frame(frame(150));
  EXPECT_EQ(result.state, TrackingState::kTracking);
  EXPECT_TRUE(result.published);
  EXPECT_EQ(filter.counters().reinitialisations, 1u);
  EXPECT_EQ(filter.estimate().v_WB, Vector3d::Zero()) << "what is old is forgotten";
  track(151, 250);
  EXPECT_LT((filter.estimate().v_WB - v).norm(), 1e-2);
}

TEST_F(SteadyMotion, SilenceLongerThanTheCoastTimeStartsAnewToo) {
  track(0, 100);
  const FrameResult result = filter.take_frame(frame(100 + 31));
  EXPECT_TRUE(result.published);
  EXPECT_EQ(filter.counters().reinitialisations, 1u);
}

TEST_F(SteadyMotion, ASingleOutlierIsRefused) {
  track(0, 100);
  PoseFrame outlier = frame(100);
  outlier.p_WB.x() += 0.05;
  const FrameResult result = filter.take_frame(outlier);
  EXPECT_EQ(result.state, TrackingState::kCoasting);
  EXPECT_TRUE(result.published);
  EXPECT_LT((filter.estimate().p_WB - position(100)).norm(), 1e-3);
  EXPECT_EQ(filter.counters().rejected_gate, 1u);
  track(101, 200);
  EXPECT_EQ(filter.counters().reinitialisations, 0u);
}

TEST_F(SteadyMotion, OutliersThatAreNotInARowNeverStartAnew) {
  track(0, 100);
  for (int k = 100; k < 200; ++k) {
    PoseFrame one = frame(k);
    if (k % 2 == 0) one.p_WB.y() += 0.2;
    filter.take_frame(one);
  }
  EXPECT_EQ(filter.counters().rejected_gate, 50u);
  EXPECT_EQ(filter.counters().reinitialisations, 0u);
}

TEST_F(SteadyMotion, AJumpIsBelievedAfterTheConfiguredNumberOfRefusals) {
  track(0, 100);
  p0 += Vector3d(0.5, 0.5, 0.0);
  for (int k = 100; k < 100 + config.reinitialise_after - 1; ++k)
    EXPECT_EQ(filter.take_frame(frame(k)).state, TrackingState::kCoasting) << k;
  const int last = 100 + config.reinitialise_after - 1;
  EXPECT_EQ(filter.take_frame(frame(last)).state, TrackingState::kTracking);
  EXPECT_EQ(filter.counters().reinitialisations, 1u);
  EXPECT_LT((filter.estimate().p_WB - position(last)).norm(), 1e-12);
  track(last + 1, 200);
}

TEST_F(SteadyMotion, RepeatedAndReversedStampsAreRefusedAndLeaveTheStateAlone) {
  track(0, 100);
  const Vector3d before = filter.estimate().p_WB;
  EXPECT_FALSE(filter.take_frame(frame(99)).published);
  EXPECT_FALSE(filter.take_frame(frame(50)).published);
  PoseFrame without_time = frame(100);
  without_time.stamp_s = kNan;
  EXPECT_FALSE(filter.take_frame(without_time).published);
  EXPECT_EQ(filter.counters().rejected_order, 3u);
  EXPECT_EQ(filter.counters().frames, 103u);
  EXPECT_EQ(filter.estimate().p_WB, before);
  EXPECT_EQ(filter.state(), TrackingState::kTracking);
  track(100, 120);
}

TEST_F(SteadyMotion, ARepeatedFrameIsRefusedForEver) {
  track(0, 100);
  for (int k = 0; k < 1000; ++k) ASSERT_FALSE(filter.take_frame(frame(99)).published);
  EXPECT_EQ(filter.counters().reinitialisations, 0u);
}

TEST_F(SteadyMotion, ReversedStreamIsRefusedForEver) {
  track(0, 100);
  for (int k = 99; k > 0; --k) ASSERT_FALSE(filter.take_frame(frame(k)).published);
}

TEST_F(SteadyMotion, RecoversWhenTimeJumpsBack) {
  track(0, 100);
  for (int k = -5000; k < -5000 + config.reinitialise_after - 1; ++k)
    EXPECT_FALSE(filter.take_frame(frame(k)).published);
  EXPECT_TRUE(filter.take_frame(frame(-5000 + config.reinitialise_after)).published);
  track(-4990, -4900);
  EXPECT_EQ(filter.counters().reinitialisations, 1u);
}

TEST_F(SteadyMotion, AFrameFromTheFutureDoesNotBlockForEver) {
  track(0, 100);
  filter.take_frame(frame(1e6));
  int lost = 0;
  for (int k = 100; k < 200; ++k) lost += filter.take_frame(frame(k)).published ? 0 : 1;
  EXPECT_EQ(lost, config.reinitialise_after - 1);
}

TEST_F(SteadyMotion, ValuesThatAreNoPoseAreUnseen) {
  track(0, 50);
  PoseFrame bad[] = {frame(50), frame(51), frame(52), frame(53)};
  bad[0].p_WB.y() = std::numeric_limits<double>::infinity();
  bad[1].q_WB.z() = kNan;
  bad[2].q_WB.coeffs().setZero();
  bad[3].q_WB.coeffs() *= 1.1;
  for (const PoseFrame& one : bad) EXPECT_EQ(filter.take_frame(one).state, TrackingState::kCoasting);
  EXPECT_EQ(filter.counters().rejected_not_finite, 4u);
  EXPECT_TRUE(filter.estimate().covariance.allFinite());
  track(54, 100);
}

TEST_F(SteadyMotion, WrongNoiseSettingShowsInTheNisAndNotInAHang) {
  config.position_noise_m = 1e-6;
  PoseFilter strict(config, nominal_vehicle());
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal(0.0, 1e-3);
  int published = 0;
  for (int k = 0; k < 200; ++k) {
    PoseFrame noisy = frame(k);
    noisy.p_WB += Vector3d(normal(random), normal(random), normal(random));
    published += strict.take_frame(noisy).published ? 1 : 0;
  }
  EXPECT_GT(strict.counters().rejected_gate, 50u)
      << "a thousandfold wrong deviation is visible in the counters";
  EXPECT_EQ(strict.nis_monitor().verdict(), NisMonitor::Verdict::kUnderstated);
  EXPECT_EQ(published, 200);
  EXPECT_LT((strict.estimate().p_WB - position(199)).norm(), 0.05);
}

TEST_F(SteadyMotion, CommandsPushOnlyWhileTheyAct) {
  v.setZero();
  w.setZero();
  q0 = Quaterniond::Identity();
  track(0, 100);
  const Vector3d before = filter.estimate().v_WB;
  // Thrusters 1 and 3 push along +x for 35 ms of the period that starts with frame 100.
  filter.take_command({kStart + 1.0, 0.1, {0.35, 0, 0.35, 0, 0, 0, 0, 0}});
  for (int k = 100; k < 120; ++k) filter.take_frame(unseen(k));
  const double gain = 2.0 * 1.7 * 0.035 / 16.8;
  EXPECT_NEAR((filter.estimate().v_WB - before).x(), gain, 1e-9);
  EXPECT_NEAR((filter.estimate().v_WB - before).y(), 0.0, 1e-9);
}

TEST_F(SteadyMotion, ThrustTurnsWithTheEstimatedAttitude) {
  v.setZero();
  w.setZero();
  q0 = Quaterniond(Eigen::AngleAxisd(M_PI / 2.0, Vector3d::UnitZ()));
  track(0, 100);
  filter.take_command({kStart + 1.0, 0.1, {1, 0, 1, 0, 0, 0, 0, 0}});
  for (int k = 100; k <= 110; ++k) filter.take_frame(unseen(k));
  EXPECT_NEAR(filter.estimate().v_WB.y(), 2.0 * 1.7 * 0.1 / 16.8, 1e-6);
  EXPECT_NEAR(filter.estimate().v_WB.x(), 0.0, 1e-6);
}

TEST_F(SteadyMotion, ALateCommandPushesOnlyFromItsArrival) {
  v.setZero();
  w.setZero();
  q0 = Quaterniond::Identity();
  track(0, 100);
  filter.take_command({kStart + 1.0, 0.1, {1, 0, 1, 0, 0, 0, 0, 0}}, kStart + 1.06);
  for (int k = 100; k <= 110; ++k) filter.take_frame(unseen(k));
  EXPECT_NEAR(filter.estimate().v_WB.x(), 2.0 * 1.7 * 0.04 / 16.8, 1e-6);
}

TEST_F(SteadyMotion, KnownCommandsMakeTheFilterSurer) {
  PoseFilter informed(config, nominal_vehicle());
  for (int k = 0; k < 200; ++k) {
    if (k % 10 == 0) informed.take_command({kStart + k * kFrame_s, 0.1, std::vector<double>(8, 0.0)});
    informed.take_frame(frame(k));
    filter.take_frame(frame(k));
  }
  EXPECT_LT(informed.estimate().covariance(6, 6), 0.1 * filter.estimate().covariance(6, 6));
  // Without further commands nothing is known about the valves any more.
  for (int k = 200; k < 300; ++k) {
    informed.take_frame(frame(k));
    filter.take_frame(frame(k));
  }
  EXPECT_NEAR(informed.estimate().covariance(6, 6), filter.estimate().covariance(6, 6),
              0.01 * filter.estimate().covariance(6, 6));
}

TEST_F(SteadyMotion, MalformedCommandsAreIgnored) {
  track(0, 50);
  filter.take_command({kStart + 0.5, 0.1, {kNan, 0, 0, 0, 0, 0, 0, 0}});
  filter.take_command({kStart + 0.5, 0.1, {1.0}});
  filter.take_command({kNan, 0.1, std::vector<double>(8, 1.0)});
  track(50, 100);
  EXPECT_LT((filter.estimate().v_WB - v).norm(), 1e-3);
}

TEST(OdometryFrames, KnownAnswers) {
  // Yaw 90 degrees: body x is world y, body y is world -x.
  PoseEstimate estimate;
  estimate.p_WB << 1.0, 2.0, 3.0;
  estimate.q_WB = Quaterniond(Eigen::AngleAxisd(M_PI / 2.0, Vector3d::UnitZ()));
  estimate.v_WB << 1.0, 2.0, 3.0;
  estimate.w_WB_B << 0.1, 0.2, 0.3;
  estimate.covariance.diagonal() << 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, 12.0;
  const OdometryEstimate odometry = to_odometry(estimate);
  EXPECT_EQ(odometry.p_WB, Vector3d(1.0, 2.0, 3.0));
  EXPECT_TRUE(odometry.v_WB_B.isApprox(Vector3d(2.0, -1.0, 3.0), 1e-12));
  EXPECT_EQ(odometry.w_WB_B, Vector3d(0.1, 0.2, 0.3));

  Vector6 pose_variance;
  pose_variance << 1.0, 2.0, 3.0, 5.0, 4.0, 6.0;
  EXPECT_TRUE(odometry.pose_covariance.diagonal().isApprox(pose_variance, 1e-12));
  // Twist: the rotated velocity variance and |v x| of the attitude error: [v]x diag(4, 5, 6) [v]x^T.
  Vector6 twist_variance;
  twist_variance << 8.0 + 9.0 * 5.0 + 1.0 * 6.0, 7.0 + 9.0 * 4.0 + 4.0 * 6.0, 9.0 + 1.0 * 4.0 + 4.0 * 5.0,
      10.0, 11.0, 12.0;
  EXPECT_TRUE(odometry.twist_covariance.diagonal().isApprox(twist_variance, 1e-12));
}

TEST(OdometryFrames, CovarianceAgreesWithSamples) {
  PoseEstimate estimate;
  estimate.q_WB = Quaterniond(0.4, -0.3, 0.7, 0.5).normalized();
  estimate.v_WB << 1.0, 2.0, 3.0;
  std::mt19937_64 random(99);
  std::normal_distribution<double> normal;
  const Matrix12 factor =
      1e-3 * Matrix12::NullaryExpr([&](Eigen::Index, Eigen::Index) { return normal(random); });
  estimate.covariance = factor * factor.transpose();
  const OdometryEstimate odometry = to_odometry(estimate);

  Matrix6 pose = Matrix6::Zero(), twist = Matrix6::Zero();
  constexpr int kSamples = 200000;
  for (int i = 0; i < kSamples; ++i) {
    const Eigen::Matrix<double, 12, 1> error =
        factor * Eigen::Matrix<double, 12, 1>::NullaryExpr([&](Eigen::Index) { return normal(random); });
    const Vector3d turn = error.segment<3>(pose_error::kAttitude);
    const Quaterniond q = estimate.q_WB * Quaterniond(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
    const Eigen::AngleAxisd world_turn(q * estimate.q_WB.conjugate());
    Vector6 pose_deviation, twist_deviation;
    pose_deviation << error.head<3>(), std::remainder(world_turn.angle(), 2.0 * M_PI) * world_turn.axis();
    twist_deviation << q.conjugate() * (estimate.v_WB + error.segment<3>(pose_error::kVelocity)) -
                           odometry.v_WB_B,
        error.segment<3>(pose_error::kAngularVelocity);
    pose += pose_deviation * pose_deviation.transpose() / kSamples;
    twist += twist_deviation * twist_deviation.transpose() / kSamples;
  }
  EXPECT_LT((pose - odometry.pose_covariance).norm(), 0.02 * pose.norm());
  EXPECT_LT((twist - odometry.twist_covariance).norm(), 0.02 * twist.norm());
}

}  // namespace
}  // namespace atmos::test
