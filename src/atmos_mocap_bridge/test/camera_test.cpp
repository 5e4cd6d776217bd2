// Rendered images through detector and fit: pose against truth, covariance against scatter, several robots,
// and what cannot be seen; the camera's own pose out of markers on the floor.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>

#include "atmos_mocap_bridge/camera/planar_pose.h"
#include "atmos_mocap_bridge/emulator_config.h"
#include "atmos_model/strict_yaml.h"

namespace atmos {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

const std::string kFolder = std::string(ATMOS_CONFIG_DIR) + "/mocap";

class OverheadCamera : public ::testing::Test {
 protected:
  OverheadCamera()
      : emulator(load_camera_emulator_config(kFolder + "/emulator/camera.yaml")),
        config(load_mocap_config(kFolder + "/camera.yaml")),
        source(std::get<CameraSourceConfig>(config.source)),
        fit{source.markers, source.board_height_m, source.min_corners, source.corner_noise_px,
            source.max_reprojection_px},
        detector(source.dictionary) {}

  std::optional<PlanarFit> see(Renderer& renderer, const BoardPose& pose, const FitSettings& settings) {
    return fit_planar_pose(emulator.renderer.camera, settings, detector.detect(renderer.render({pose})));
  }

  CameraEmulatorConfig emulator;
  MocapConfig config;
  CameraSourceConfig source;
  FitSettings fit;
  MarkerDetector detector;
};

double yaw_error(double a, double b) { return std::remainder(a - b, 2.0 * M_PI); }

TEST_F(OverheadCamera, PosesAllOverTheFloor) {
  Renderer renderer(emulator.renderer);
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> x(-0.9, 1.8), y(-0.6, 1.6), turn(-M_PI, M_PI);
  double position = 0.0, yaw = 0.0, worst = 0.0, nees = 0.0;
  constexpr int kPoses = 12;
  for (int i = 0; i < kPoses; ++i) {
    const BoardPose pose{{x(random), y(random)}, turn(random)};
    const auto seen = see(renderer, pose, fit);
    ASSERT_TRUE(seen) << pose.p_WB.transpose() << " " << pose.yaw;
    EXPECT_EQ(seen->corners, 16);
    EXPECT_LT(seen->rms_px, 0.5);
    Vector3d error;
    error << seen->p_WB - pose.p_WB, yaw_error(seen->yaw, pose.yaw);
    position += error.head<2>().squaredNorm() / kPoses;
    yaw += error.z() * error.z() / kPoses;
    worst = std::max(worst, error.head<2>().norm());
    nees += error.dot(seen->covariance.ldlt().solve(error)) / kPoses;
  }
  std::printf("position RMS %.2f mm, worst %.2f mm, yaw RMS %.4f rad, NEES %.2f of 3\n",
              1e3 * std::sqrt(position), 1e3 * worst, std::sqrt(yaw), nees);
  EXPECT_LT(std::sqrt(position), 1e-3);
  EXPECT_LT(worst, 3e-3);
  EXPECT_LT(std::sqrt(yaw), 4e-3);
  EXPECT_LT(nees, 6.0) << "the covariance promises too much";
}

TEST_F(OverheadCamera, AMovingBoardIsSeenWhereItIsInTheMiddleOfTheExposure) {
  emulator.renderer.exposure_s = 0.01;
  Renderer renderer(emulator.renderer);
  const BoardPose pose{{0.4, 0.3}, 0.5, {0.4, -0.2}, 0.8};
  const auto seen = see(renderer, pose, fit);
  ASSERT_TRUE(seen);
  EXPECT_LT((seen->p_WB - pose.p_WB).norm(), 1.5e-3);
  EXPECT_LT(std::abs(yaw_error(seen->yaw, pose.yaw)), 5e-3);
}

TEST_F(OverheadCamera, FewerMarkersMakeALargerCovariance) {
  Renderer renderer(emulator.renderer);
  const BoardPose pose{{0.2, 0.1}, -1.0};
  const auto detected = detector.detect(renderer.render({pose}));
  std::vector<DetectedMarker> one;
  for (const DetectedMarker& marker : detected) {
    if (marker.id == 2) one.push_back(marker);
  }
  ASSERT_EQ(one.size(), 1u);
  const auto all = fit_planar_pose(emulator.renderer.camera, fit, detected);
  const auto single = fit_planar_pose(emulator.renderer.camera, fit, one);
  ASSERT_TRUE(all && single);
  EXPECT_EQ(single->corners, 4);
  EXPECT_GT(single->covariance(2, 2), 3.0 * all->covariance(2, 2));
  EXPECT_LT((single->p_WB - pose.p_WB).norm(), 5e-3);
  FitSettings strict = fit;
  strict.min_corners = 8;
  EXPECT_FALSE(fit_planar_pose(emulator.renderer.camera, strict, one));
}

TEST_F(OverheadCamera, TwoRobotsInOnePicture) {
  emulator.renderer.boards.push_back(emulator.renderer.boards[0]);
  FitSettings second = fit;
  for (std::size_t i = 0; i < second.markers.size(); ++i) {
    second.markers[i].id += 10;
    emulator.renderer.boards[1].markers[i].id += 10;
  }
  Renderer renderer(emulator.renderer);
  const BoardPose a{{0.0, 0.0}, 0.3}, b{{0.9, 0.8}, -2.0};
  const auto detected = detector.detect(renderer.render({a, b}));
  const auto seen_a = fit_planar_pose(emulator.renderer.camera, fit, detected);
  const auto seen_b = fit_planar_pose(emulator.renderer.camera, second, detected);
  ASSERT_TRUE(seen_a && seen_b);
  EXPECT_LT((seen_a->p_WB - a.p_WB).norm(), 2e-3);
  EXPECT_LT((seen_b->p_WB - b.p_WB).norm(), 2e-3);
}

TEST_F(OverheadCamera, WhatIsNotInThePictureIsNotSeen) {
  Renderer renderer(emulator.renderer);
  EXPECT_FALSE(see(renderer, {{std::nan(""), 0.0}, 0.0}, fit));
  EXPECT_FALSE(see(renderer, {{6.0, 0.0}, 0.0}, fit));
  EXPECT_FALSE(see(renderer, {{-30.0, 0.0}, 0.0}, fit));
  EXPECT_TRUE(see(renderer, {{0.0, 0.0}, 0.0}, fit));
}

TEST_F(OverheadCamera, PicturesOfAnySizeAreTaken) {
  const std::vector<std::uint8_t> grey(64 * 64, 128);
  for (int height = 1; height <= 64; height = 2 * height + 1) {
    for (int width = 1; width <= 64; width = 2 * width + 1)
      EXPECT_TRUE(detector.detect({width, height, grey.data(), 64}).empty()) << width << " x " << height;
  }
}

TEST_F(OverheadCamera, AFitThatDoesNotFitIsRefused) {
  Renderer renderer(emulator.renderer);
  auto detected = detector.detect(renderer.render({BoardPose{{0.0, 0.0}, 0.0}}));
  for (DetectedMarker& marker : detected) {
    if (marker.id == 1) marker.corners_px[0] += Vector2d(25.0, 0.0);
  }
  EXPECT_FALSE(fit_planar_pose(emulator.renderer.camera, fit, detected));
}

TEST_F(OverheadCamera, TheLensModelThereAndBack) {
  for (const Vector3d& p_W : {Vector3d(0.0, 0.0, 0.0), Vector3d(1.5, 1.2, 0.3), Vector3d(-0.8, -0.6, 0.0)}) {
    const Camera& camera = emulator.renderer.camera;
    const Vector2d ray = undistort(camera.intrinsics, {project(camera, p_W)})[0];
    const Vector3d p_C = camera.X_WC.inverse() * p_W;
    EXPECT_LT((ray - p_C.head<2>() / p_C.z()).norm(), 2e-5);
  }
}

TEST_F(OverheadCamera, TheCameraIsFoundByTheMarkersOnTheFloor) {
  Renderer renderer(emulator.renderer);
  const FloorMarkers floor = load_floor_markers(kFolder + "/extrinsic/floor_markers.yaml");
  std::vector<std::vector<DetectedMarker>> images;
  for (int i = 0; i < 5; ++i)
    images.push_back(detector.detect(renderer.render({BoardPose{{0.5, 0.5}, 0.0}})));
  const auto found = fit_extrinsic(emulator.renderer.camera.intrinsics, floor.markers, images);
  ASSERT_TRUE(found);
  const Eigen::Isometry3d error = emulator.renderer.camera.X_WC.inverse() * found->X_WC;
  std::printf("extrinsic: off by %.2f mm and %.3f mrad, RMS %.3f px\n", 1e3 * error.translation().norm(),
              1e3 * Eigen::AngleAxisd(error.linear()).angle(), found->rms_px);
  EXPECT_LT(error.translation().norm(), 5e-3);
  EXPECT_LT(Eigen::AngleAxisd(error.linear()).angle(), 1.5e-3);
  EXPECT_LT(found->rms_px, 0.3);

  const std::string path = ::testing::TempDir() + "mocap_extrinsic_test.yaml";
  save_extrinsic(*found, path);
  const Extrinsic read = load_extrinsic(path);
  EXPECT_LT((read.X_WC.matrix() - found->X_WC.matrix()).norm(), 1e-5);
  if (const char* out = std::getenv("ATMOS_EXTRINSIC_OUT")) save_extrinsic(*found, out);

  EXPECT_FALSE(fit_extrinsic(emulator.renderer.camera.intrinsics, {floor.markers[0]}, images));
  EXPECT_FALSE(fit_extrinsic(emulator.renderer.camera.intrinsics, floor.markers, {}));
}

TEST_F(OverheadCamera, TheShippedExtrinsicIsThatOfTheEmulatedCamera) {
  const Eigen::Isometry3d error =
      emulator.renderer.camera.X_WC.inverse() * load_extrinsic(source.extrinsic_path).X_WC;
  EXPECT_LT(error.translation().norm(), 5e-3);
  EXPECT_LT(Eigen::AngleAxisd(error.linear()).angle(), 1.5e-3);
}

TEST(CameraConfig, BrokenExtrinsicsAreRefused) {
  const std::string path = ::testing::TempDir() + "mocap_bad_extrinsic_test.yaml";
  std::ofstream(path) << "position_m: [0, 0, 3]\norientation_wxyz: [0.5, 0, 0, 0]\nrms_px: 0\n";
  EXPECT_THROW(load_extrinsic(path), ConfigError);
  std::ofstream(path) << "position_m: [0, 0]\norientation_wxyz: [1, 0, 0, 0]\nrms_px: 0\nmore: 1\n";
  try {
    load_extrinsic(path);
    FAIL();
  } catch (const ConfigError& error) {
    EXPECT_EQ(error.faults().size(), 2u);
  }
}

}  // namespace
}  // namespace atmos
