// An overhead camera over the simulated robots: sim/mocap_pose of every robot in, images and calibration out
// (docs/mocap.md). Parameters: ~config (path), ~robots (names, separated by blanks: their namespaces, in the
// order of the boards in the settings). Publishes camera/image_raw and camera/camera_info in its own
// namespace.
#include <geometry_msgs/PoseStamped.h>
#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "atmos_mocap_bridge/emulator_config.h"
#include "atmos_model_ros/messages.h"
#include "atmos_model_ros/node.h"

namespace atmos {

namespace {

constexpr std::uint32_t kQueue = 1000;  // messages: nothing may be lost at many times real time
constexpr double kSameInstant_s = 1e-4;

class CameraEmulator {
 public:
  CameraEmulator(const CameraEmulatorConfig& config, const std::vector<std::string>& robots)
      : config_(config), renderer_(config.renderer) {
    info_publisher_ = node_.advertise<sensor_msgs::CameraInfo>("camera/camera_info", kQueue, true);
    image_publisher_ = node_.advertise<sensor_msgs::Image>("camera/image_raw", kQueue);
    poses_.resize(robots.size());
    for (std::size_t i = 0; i < robots.size(); ++i) {
      subscribers_.push_back(node_.subscribe<geometry_msgs::PoseStamped>(
          "/" + robots[i] + "/sim/mocap_pose", kQueue,
          [this, i](const geometry_msgs::PoseStamped::ConstPtr& message) { on_pose(i, *message); }, {},
          ros::TransportHints().tcpNoDelay()));
    }
  }

 private:
  struct Pose {
    ros::Time stamp;
    BoardPose board;
  };

  void on_pose(std::size_t robot, const geometry_msgs::PoseStamped& message) {
    Pose& pose = poses_[robot];
    const BoardPose last = pose.board;
    const double dt = (message.header.stamp - pose.stamp).toSec();
    pose.stamp = message.header.stamp;
    pose.board.p_WB = {message.pose.position.x, message.pose.position.y};
    pose.board.yaw = yaw_of(message.pose.orientation);
    pose.board.v_WB = (pose.board.p_WB - last.p_WB) / dt;
    pose.board.yaw_rate = std::remainder(pose.board.yaw - last.yaw, 2.0 * M_PI) / dt;
    if (!pose.board.v_WB.allFinite() || dt > 1.0 || dt <= 0.0) {
      pose.board.v_WB.setZero();
      pose.board.yaw_rate = 0.0;
    }
    const double images = pose.stamp.toSec() * config_.rate_hz;
    if (std::abs(images - std::round(images)) > kSameInstant_s * config_.rate_hz) return;
    const bool all_there = std::all_of(poses_.begin(), poses_.end(),
                                       [&pose](const Pose& other) { return other.stamp == pose.stamp; });
    if (all_there) publish(pose.stamp);
  }

  void publish(const ros::Time& stamp) {
    const CameraIntrinsics& lens = config_.renderer.camera.intrinsics;
    sensor_msgs::CameraInfo info;
    info.header.stamp = stamp;
    info.header.frame_id = "overhead_camera";
    info.width = static_cast<std::uint32_t>(lens.width);
    info.height = static_cast<std::uint32_t>(lens.height);
    info.distortion_model = "plumb_bob";
    info.D = lens.distortion;
    info.K = {lens.fx, 0.0, lens.cx, 0.0, lens.fy, lens.cy, 0.0, 0.0, 1.0};
    info.R = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
    info.P = {lens.fx, 0.0, lens.cx, 0.0, 0.0, lens.fy, lens.cy, 0.0, 0.0, 0.0, 1.0, 0.0};
    info_publisher_.publish(info);

    std::vector<BoardPose> boards;
    for (const Pose& pose : poses_) boards.push_back(pose.board);
    const GrayImage picture = renderer_.render(boards);
    sensor_msgs::Image image;
    image.header = info.header;
    image.width = info.width;
    image.height = info.height;
    image.encoding = "mono8";
    image.step = static_cast<std::uint32_t>(picture.step);
    image.data.assign(picture.data, picture.data + picture.step * static_cast<std::size_t>(picture.height));
    image_publisher_.publish(image);
  }

  CameraEmulatorConfig config_;
  Renderer renderer_;
  ros::NodeHandle node_;
  std::vector<Pose> poses_;
  ros::Publisher info_publisher_, image_publisher_;
  std::vector<ros::Subscriber> subscribers_;
};

}  // namespace

}  // namespace atmos

int main(int argc, char** argv) {
  return atmos::run_node(argc, argv, "camera_emulator", [] {
    const ros::NodeHandle parameters("~");
    const auto config =
        atmos::load_camera_emulator_config(atmos::required_parameter<std::string>(parameters, "config"));
    std::istringstream words(atmos::required_parameter<std::string>(parameters, "robots"));
    std::vector<std::string> robots;
    for (std::string word; words >> word;) robots.push_back(word);
    if (robots.empty() || robots.size() != config.renderer.boards.size())
      throw std::invalid_argument("parameter robots must name as many robots as the settings have boards");
    const atmos::CameraEmulator emulator(config, robots);
    ros::spin();
    return 0;
  });
}
