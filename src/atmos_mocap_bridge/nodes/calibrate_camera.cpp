// Finds where an overhead camera is: markers on the floor at known places, seen in some images
// (docs/mocap.md).
//   rosrun atmos_mocap_bridge calibrate_camera --markers FLOOR.yaml --out EXTRINSIC.yaml [--images N]
//       [image_raw:=/topic] [camera_info:=/topic]
#include <ros/ros.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <stdexcept>

#include "atmos_mocap_bridge/camera/planar_pose.h"
#include "atmos_model_ros/node.h"
#include "camera_messages.h"

namespace atmos {

namespace {

int calibrate(const std::string& markers, const std::string& out, int wanted, double limit_s) {
  const FloorMarkers floor = load_floor_markers(markers);
  const MarkerDetector detector(floor.dictionary);
  std::optional<CameraIntrinsics> intrinsics;
  std::vector<std::vector<DetectedMarker>> images;
  std::vector<std::uint8_t> storage;
  ros::NodeHandle node;
  const ros::Subscriber info_subscriber = node.subscribe<sensor_msgs::CameraInfo>(
      "camera_info", 1, [&](const sensor_msgs::CameraInfo::ConstPtr& message) {
        intrinsics = from_message(*message);
        if (!intrinsics) std::fprintf(stderr, "calibrate_camera: the camera has no plumb_bob calibration\n");
      });
  const ros::Subscriber image_subscriber =
      node.subscribe<sensor_msgs::Image>("image_raw", 1, [&](const sensor_msgs::Image::ConstPtr& message) {
        if (const auto image = gray_view(*message, storage)) images.push_back(detector.detect(*image));
      });
  const ros::SteadyTime start = ros::SteadyTime::now();
  while (ros::ok() && (!intrinsics || static_cast<int>(images.size()) < wanted)) {
    ros::spinOnce();
    ros::WallDuration(0.01).sleep();
    if ((ros::SteadyTime::now() - start).toSec() > limit_s) {
      std::fprintf(stderr, "calibrate_camera: %zu images and %s calibration after %.0f s\n", images.size(),
                   intrinsics ? "a" : "no", limit_s);
      return 1;
    }
  }
  if (!ros::ok()) return 1;
  const auto extrinsic = fit_extrinsic(*intrinsics, floor.markers, images);
  if (!extrinsic) {
    std::fprintf(stderr, "calibrate_camera: fewer than two of the floor's markers are seen\n");
    return 1;
  }
  save_extrinsic(*extrinsic, out);
  const Eigen::Vector3d p = extrinsic->X_WC.translation();
  std::printf("camera at (%.4f, %.4f, %.4f) m, reprojection RMS %.3f px; written: %s\n", p.x(), p.y(), p.z(),
              extrinsic->rms_px, out.c_str());
  return 0;
}

}  // namespace

}  // namespace atmos

int main(int argc, char** argv) {
  return atmos::run_node(argc, argv, "calibrate_camera", [&] {
    CLI::App app("Finds where an overhead camera is, out of markers on the floor.");
    std::string markers, out;
    int images = 20;
    double limit_s = 60.0;
    app.add_option("--markers", markers, "file with the markers and their places")->required();
    app.add_option("--out", out, "file to write")->required();
    app.add_option("--images", images, "images to take")->check(CLI::Range(1, 10000));
    app.add_option("--limit", limit_s, "longest time to wait for them [s]")->check(CLI::PositiveNumber);
    std::vector<std::string> words;
    ros::removeROSArgs(argc, argv, words);
    words.erase(words.begin());
    std::reverse(words.begin(), words.end());  // as CLI11 takes them
    try {
      app.parse(words);
    } catch (const CLI::ParseError& error) {
      return app.exit(error) == 0 ? 0 : 2;
    }
    try {
      return atmos::calibrate(markers, out, images, limit_s);
    } catch (const atmos::ConfigError&) {
      throw;
    } catch (const std::runtime_error& error) {
      std::fprintf(stderr, "calibrate_camera: %s\n", error.what());
      return 1;
    }
  });
}
