// The bridge's node with each source in real time: a QTM server that dies in the middle of a packet and comes
// back, transforms from a topic, images of a camera.
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TransformStamped.h>
#include <gtest/gtest.h>
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <functional>
#include <memory>
#include <vector>

#include "../nodes/bridge_node.h"
#include "atmos_mocap_bridge/emulator_config.h"
#include "atmos_mocap_bridge/qtm/pose.h"
#include "atmos_mocap_bridge/qtm/server.h"
#include "atmos_mocap_bridge/tcp_socket.h"

namespace atmos {
namespace {

constexpr double kFrame_s = 0.01, kLimit_s = 15.0;

std::string config_path(const std::string& name) { return std::string(ATMOS_CONFIG_DIR) + "/" + name; }

class Sources : public ::testing::Test {
 protected:
  Sources() {
    odometry_subscriber_ = node.subscribe<nav_msgs::Odometry>(
        "odometry", 1000,
        [this](const nav_msgs::Odometry::ConstPtr& message) { odometry.push_back(*message); });
    pose_subscriber_ = node.subscribe<geometry_msgs::PoseStamped>(
        "mocap/pose", 1000, [this](const geometry_msgs::PoseStamped::ConstPtr&) { ++poses; });
  }

  void start(const MocapConfig& config) {
    bridge = std::make_unique<BridgeNode>(config, load_vehicle(config_path("vehicle/atmos.yaml")), false);
  }

  static bool wait_until(const std::function<bool()>& done, double limit_s = kLimit_s) {
    const ros::SteadyTime start = ros::SteadyTime::now();
    while (!done() && ros::ok() && (ros::SteadyTime::now() - start).toSec() < limit_s) {
      ros::spinOnce();
      ros::WallDuration(0.001).sleep();
    }
    return done();
  }
  static void pause(double seconds) {
    wait_until([] { return false; }, seconds);
  }

  ros::NodeHandle node;
  std::unique_ptr<BridgeNode> bridge;
  std::vector<nav_msgs::Odometry> odometry;
  int poses = 0;

 private:
  ros::Subscriber odometry_subscriber_, pose_subscriber_;
};

// One client of a QTM server in this process, led as far as the stream.
class QtmServerInTest {
 public:
  explicit QtmServerInTest(TcpListener& listener)
      : server_({{100.0, {{"wall", true}, {"atmos", true}}}, 22}), socket_(listener.accept(kLimit_s)) {
    const ros::SteadyTime start = ros::SteadyTime::now();
    char buffer[4096];
    while (socket_ && !server_.streaming() && (ros::SteadyTime::now() - start).toSec() < kLimit_s) {
      socket_->write(server_.take_output(), 1.0);
      const long count = socket_->read(buffer, sizeof buffer, 0.1);
      if (count > 0) server_.receive(buffer, static_cast<std::size_t>(count));
    }
  }
  bool streaming() const { return server_.streaming(); }
  // Frame `number`, `number` hundredths of a second after the server's clock began; the robot moves at 0.5
  // m/s.
  std::string frame(int number) {
    qtm::Frame frame;
    frame.number = static_cast<std::uint32_t>(number);
    const double t = (ros::SteadyTime::now() - begin_).toSec();
    frame.timestamp_us = static_cast<std::uint64_t>(1e6 * t);
    frame.bodies.assign(2, qtm::to_body({0.0, {x_ = 0.5 * t, 1.0, 0.0}, Eigen::Quaterniond::Identity()}));
    server_.add(frame);
    return server_.take_output();
  }
  double x_m() const { return x_; }  // of the newest frame
  void send(const std::string& bytes) { socket_->write(bytes, 1.0); }

 private:
  qtm::Server server_;
  std::optional<TcpSocket> socket_;
  ros::SteadyTime begin_ = ros::SteadyTime::now();
  double x_ = 0.0;
};

TEST_F(Sources, AQtmServerThatDiesInTheMiddleOfAPacketAndComesBack) {
  TcpListener listener(0);
  MocapConfig config = load_mocap_config(config_path("mocap/qtm.yaml"));
  config.source = QtmSourceConfig{"127.0.0.1", listener.port(), "atmos", 2.0, 1.0};
  start(config);

  for (int life = 0; life < 2; ++life) {
    auto server = std::make_unique<QtmServerInTest>(listener);
    ASSERT_TRUE(server->streaming()) << "life " << life;
    odometry.clear();
    poses = 0;
    for (int k = 0; k < 100; ++k) {
      server->send(server->frame(k));
      pause(kFrame_s);
    }
    ASSERT_TRUE(wait_until([&] { return odometry.size() == 100; })) << odometry.size();
    EXPECT_EQ(poses, 100) << "the raw poses are published too";
    const nav_msgs::Odometry& last = odometry.back();
    EXPECT_NEAR((ros::Time::now() - last.header.stamp).toSec(), 0.015, 0.1) << "stamps are in ROS time";
    EXPECT_NEAR(last.pose.pose.position.x, server->x_m(), 2e-3);
    EXPECT_NEAR(last.twist.twist.linear.x, 0.5, 0.1);
    for (std::size_t k = 1; k < odometry.size(); ++k)
      ASSERT_GT(odometry[k].header.stamp, odometry[k - 1].header.stamp);

    const std::string whole = server->frame(100);
    server->send(whole.substr(0, whole.size() / 2));
    server.reset();
    pause(0.3);
    EXPECT_EQ(odometry.size(), 100u) << "a pose without a frame";
  }
}

TEST_F(Sources, TransformsFromATopic) {
  MocapConfig config = load_mocap_config(config_path("mocap/topic.yaml"));
  config.source = TopicSourceConfig{"vicon/atmos", true};
  start(config);
  auto publisher = node.advertise<geometry_msgs::TransformStamped>("vicon/atmos", 100);
  ASSERT_TRUE(wait_until([&] { return publisher.getNumSubscribers() == 1; }));
  geometry_msgs::TransformStamped message;
  message.header.stamp = ros::Time(1234.5);
  message.transform.translation.x = 1.5;
  message.transform.rotation.w = 1.0;
  publisher.publish(message);
  ASSERT_TRUE(wait_until([&] { return odometry.size() == 1 && poses == 1; }));
  EXPECT_EQ(odometry[0].header.stamp, ros::Time(1234.5));
  EXPECT_EQ(odometry[0].pose.pose.position.x, 1.5);
}

TEST_F(Sources, ImagesOfACamera) {
  const CameraEmulatorConfig emulator =
      load_camera_emulator_config(config_path("mocap/emulator/camera.yaml"));
  Renderer renderer(emulator.renderer);
  start(load_mocap_config(config_path("mocap/camera.yaml")));
  auto images = node.advertise<sensor_msgs::Image>("camera/image_raw", 10);
  auto infos = node.advertise<sensor_msgs::CameraInfo>("camera/camera_info", 10);
  ASSERT_TRUE(wait_until([&] { return images.getNumSubscribers() == 1 && infos.getNumSubscribers() == 1; }));
  const CameraIntrinsics& lens = emulator.renderer.camera.intrinsics;
  sensor_msgs::CameraInfo info;
  info.width = static_cast<std::uint32_t>(lens.width);
  info.height = static_cast<std::uint32_t>(lens.height);
  info.K = {lens.fx, 0.0, lens.cx, 0.0, lens.fy, lens.cy, 0.0, 0.0, 1.0};
  info.D = lens.distortion;
  info.distortion_model = "plumb_bob";
  const auto send = [&](double stamp, double x, std::size_t channels) {
    const GrayImage picture = renderer.render({BoardPose{{x, 0.4}, 0.3}});
    sensor_msgs::Image image;
    image.header.stamp = ros::Time(stamp);
    image.width = info.width;
    image.height = info.height;
    image.encoding = channels == 1 ? "mono8" : "rgb8";
    image.step = static_cast<std::uint32_t>(static_cast<std::size_t>(picture.width) * channels);
    for (int v = 0; v < picture.height; ++v) {
      for (int u = 0; u < picture.width; ++u) {
        for (std::size_t c = 0; c < channels; ++c)
          image.data.push_back(
              picture.data[static_cast<std::size_t>(v) * picture.step + static_cast<std::size_t>(u)]);
      }
    }
    images.publish(image);
  };
  send(1000.0, 0.5, 1);
  pause(0.3);
  EXPECT_TRUE(odometry.empty()) << "without a calibration there is no pose";
  infos.publish(info);
  ASSERT_TRUE(wait_until([&] { return odometry.size() == 1; })) << "the image waited for its calibration";
  send(1000.05, 0.5, 3);
  ASSERT_TRUE(wait_until([&] { return odometry.size() == 2; }));
  EXPECT_EQ(odometry[1].header.stamp, ros::Time(1000.05));
  for (const nav_msgs::Odometry& one : odometry) {
    EXPECT_NEAR(one.pose.pose.position.x, 0.5, 2e-3);
    EXPECT_NEAR(one.pose.pose.position.y, 0.4, 2e-3);
    EXPECT_NEAR(one.pose.pose.orientation.z, std::sin(0.15), 2e-3);
  }
  // Out of the picture: predictions for the coast time, then nothing.
  for (int k = 2; k < 8; ++k) send(1000.0 + 0.05 * k, 9.0, 1), pause(0.15);
  ASSERT_TRUE(wait_until([&] { return poses == 8; }));
  EXPECT_EQ(odometry.size(), 4u);
}

}  // namespace
}  // namespace atmos

int main(int argc, char** argv) {
  ::testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "mocap_sources_test");
  ros::NodeHandle keep_alive;
  return RUN_ALL_TESTS();
}
