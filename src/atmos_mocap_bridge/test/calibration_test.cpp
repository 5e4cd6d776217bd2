// The calibration: what a diagnosis found out about the mocap is taken back from every frame.
#include <gtest/gtest.h>

#include "sensor_simulator.h"

namespace atmos::test {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

Quaterniond yaw(double angle) { return Quaterniond(Eigen::AngleAxisd(angle, Vector3d::UnitZ())); }

TEST(Calibration, MarkerOffsetAndYawMisalignmentAreTakenBack) {
  MocapConfig config = nominal_config();
  config.calibration.marker_offset_m << 0.03, -0.02;
  config.calibration.yaw_misalignment_rad = 0.1;
  PoseFilter filter(config, nominal_vehicle());
  // docs/effects.md: the mocap shows p + R (x_m, y_m), and yaw + angle_rad. Robot at (1, 2), 90 degrees.
  const double shown_yaw = M_PI / 2.0 + 0.1;
  filter.take_frame({kStart, {1.0 + 0.02, 2.0 + 0.03, 0.0}, yaw(shown_yaw)});
  EXPECT_LT((filter.estimate().p_WB - Vector3d(1.0, 2.0, 0.0)).norm(), 1e-12);
  EXPECT_LT(filter.estimate().q_WB.angularDistance(yaw(M_PI / 2.0)), 1e-12);
}

TEST(Calibration, UnseenFramesStayUnseen) {
  MocapConfig config = nominal_config();
  config.calibration.marker_offset_m << 0.03, -0.02;
  PoseFilter filter(config, nominal_vehicle());
  filter.take_frame({kStart, Vector3d::Zero(), yaw(0.0)});
  EXPECT_EQ(filter.take_frame({kStart + 0.01, Vector3d::Constant(kNan), yaw(0.0)}).state,
            TrackingState::kCoasting);
}

// Frames that are old when they are stamped: sample k shows the robot `late` frames earlier.
struct Errors {
  double position_m = 0.0, yaw_rad = 0.0;  // RMS
};
Errors errors_with_latency(double calibrated_s, int late, bool with_commands) {
  FlightOptions options;
  options.duration_s = 20.0;
  SensorSimulator simulator(nominal_vehicle(), options);
  MocapConfig config = nominal_config();
  config.calibration.delay_s = calibrated_s;
  PoseFilter filter(config, nominal_vehicle());
  Errors errors;
  int count = 0;
  for (std::size_t k = static_cast<std::size_t>(late); k < simulator.samples.size(); ++k) {
    const Sample& now = simulator.samples[k];
    PoseFrame frame = simulator.samples[k - static_cast<std::size_t>(late)].frame;
    frame.stamp_s = now.frame.stamp_s;
    if (with_commands) simulator.feed_commands(filter, frame.stamp_s);
    EXPECT_TRUE(filter.take_frame(frame).published);
    EXPECT_EQ(filter.estimate().stamp_s, frame.stamp_s) << "the odometry bears the frame's stamp";
    if (frame.stamp_s < kStart + 1.0) continue;
    const auto error = error_of(filter.estimate(), now.truth);
    errors.position_m += error.head<2>().squaredNorm();
    errors.yaw_rad += error[pose_error::kAttitude + 2] * error[pose_error::kAttitude + 2];
    ++count;
  }
  errors = {std::sqrt(errors.position_m / count), std::sqrt(errors.yaw_rad / count)};
  std::printf("latency %d frames, calibrated %.0f ms: position %.3f mm, yaw %.5f rad\n", late,
              1e3 * calibrated_s, 1e3 * errors.position_m, errors.yaw_rad);
  return errors;
}

TEST(Calibration, LatencyIsPredictedOverWithTheKnownThrust) {
  const Errors none = errors_with_latency(0.0, 0, true);
  const Errors ignored = errors_with_latency(0.0, 3, true);
  const Errors calibrated = errors_with_latency(0.03, 3, true);
  EXPECT_GT(ignored.position_m, 5.0 * none.position_m);
  EXPECT_LT(calibrated.position_m, 1.5 * none.position_m);
  EXPECT_LT(calibrated.yaw_rad, 1.5 * none.yaw_rad);
}

TEST(Calibration, LatencyIsPredictedOverFromPoseAlone) {
  const Errors ignored = errors_with_latency(0.0, 3, false);
  const Errors calibrated = errors_with_latency(0.03, 3, false);
  EXPECT_LT(calibrated.position_m, 0.5 * ignored.position_m);
}

TEST(Calibration, GapsAndOrderAreCountedInTheStampsOfTheFrames) {
  MocapConfig config = nominal_config();
  config.calibration.delay_s = 0.02;
  PoseFilter filter(config, nominal_vehicle());
  for (int k = 0; k < 50; ++k) filter.take_frame({kStart + 0.01 * k, Vector3d::Zero(), yaw(0.0)});
  EXPECT_FALSE(filter.take_frame({kStart + 0.48, Vector3d::Zero(), yaw(0.0)}).published);
  EXPECT_EQ(filter.counters().rejected_order, 1u);
  EXPECT_EQ(filter.estimate().stamp_s, kStart + 0.49);
  int published = 0;
  for (int k = 50; k < 70; ++k)
    published += filter.take_frame({kStart + 0.01 * k, Vector3d::Constant(kNan), yaw(0.0)}).published ? 1 : 0;
  EXPECT_EQ(published, 5) << "the coast time of 50 ms";
}

TEST(FrameCovariance, TheSourcesOwnCovarianceCountsInPlaceOfTheSettings) {
  MocapConfig config = nominal_config();
  PoseFilter plain(config, nominal_vehicle()), coarse(config, nominal_vehicle());
  for (int k = 0; k < 100; ++k) {
    PoseFrame frame{kStart + 0.01 * k, Vector3d::Zero(), yaw(0.0)};
    plain.take_frame(frame);
    Vector6 variance;
    variance << 1e-4, 4e-4, 1e-6, 1e-4, 1e-4, 1e-3;
    frame.covariance = variance.asDiagonal();
    coarse.take_frame(frame);
  }
  EXPECT_GT(coarse.estimate().covariance(0, 0), 10.0 * plain.estimate().covariance(0, 0));
  EXPECT_GT(coarse.estimate().covariance(1, 1), 1.5 * coarse.estimate().covariance(0, 0));
  PoseFrame broken{kStart + 1.0, Vector3d::Zero(), yaw(0.0)};
  broken.covariance = Matrix6::Constant(kNan);
  EXPECT_EQ(coarse.take_frame(broken).state, TrackingState::kCoasting);
}

}  // namespace
}  // namespace atmos::test
