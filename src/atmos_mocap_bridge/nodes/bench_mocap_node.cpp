// Time from the bytes of a QTM frame to its odometry, inside the node: TCP, session, clock map, filter and
// publishing to one subscriber. Starts a ROS master of its own.
#include <nav_msgs/Odometry.h>
#include <ros/ros.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "atmos_mocap_bridge/qtm/pose.h"
#include "atmos_mocap_bridge/qtm/server.h"
#include "atmos_mocap_bridge/qtm/session.h"
#include "atmos_mocap_bridge/tcp_socket.h"
#include "bridge_node.h"

namespace atmos {

namespace {

constexpr int kFrames = 6000;
constexpr double kRate_hz = 100.0, kLimit_s = 20.0;
constexpr std::size_t kBodies = 10;

int free_port() { return TcpListener(0).port(); }

class Master {
 public:
  explicit Master(int port) {
    const std::string number = std::to_string(port);
    const char* const arguments[] = {"rosmaster", "--core", "-p", number.c_str(), nullptr};
    if (posix_spawnp(&process_, "rosmaster", nullptr, nullptr, const_cast<char* const*>(arguments),
                     environ) != 0)
      process_ = 0;
  }
  ~Master() {
    if (process_ == 0) return;
    kill(process_, SIGINT);
    waitpid(process_, nullptr, 0);
  }

 private:
  pid_t process_ = 0;
};

qtm::Frame frame_of(int number) {
  qtm::Frame frame;
  frame.number = static_cast<std::uint32_t>(number);
  frame.timestamp_us = static_cast<std::uint64_t>(1e6 * number / kRate_hz);
  const PoseFrame pose{0.0, {1e-3 * number, 0.0, 0.0}, Eigen::Quaterniond::Identity()};
  frame.bodies.assign(kBodies, qtm::to_body(pose));
  return frame;
}

// Serves one client until it streams; false when it does not.
bool serve_until_streaming(TcpSocket& socket, qtm::Server& server) {
  char buffer[4096];
  const double end = ros::SteadyTime::now().toSec() + kLimit_s;
  while (!server.streaming() && ros::SteadyTime::now().toSec() < end) {
    if (!socket.write(server.take_output(), 1.0)) return false;
    const long count = socket.read(buffer, sizeof buffer, 0.1);
    if (count < 0 || (count > 0 && !server.receive(buffer, static_cast<std::size_t>(count)))) return false;
  }
  return server.streaming();
}

int measure() {
  TcpListener listener(0);
  MocapConfig config = load_mocap_config(std::string(ATMOS_CONFIG_DIR) + "/mocap/qtm.yaml");
  std::get<QtmSourceConfig>(config.source).port = listener.port();
  std::get<QtmSourceConfig>(config.source).body = "atmos";
  const Vehicle vehicle = load_vehicle(std::string(ATMOS_CONFIG_DIR) + "/vehicle/atmos.yaml");

  ros::NodeHandle node;
  int answers = 0;
  const ros::Subscriber subscriber = node.subscribe<nav_msgs::Odometry>(
      "odometry", 1000, [&answers](const nav_msgs::Odometry::ConstPtr&) { ++answers; });
  const BridgeNode bridge(config, vehicle, false);
  ros::AsyncSpinner spinner(1);
  spinner.start();
  auto socket = listener.accept(kLimit_s);
  qtm::ServerSettings settings{{kRate_hz, {}}, qtm::kNewestMinor};
  settings.parameters.bodies.assign(kBodies, {"other", true});
  settings.parameters.bodies[3].name = "atmos";
  qtm::Server server(settings);
  if (!socket || !serve_until_streaming(*socket, server)) {
    std::fprintf(stderr, "bench_mocap_node: the bridge did not connect\n");
    return 1;
  }
  const ros::SteadyTime start = ros::SteadyTime::now();
  for (int k = 0; k < kFrames; ++k) {
    server.add(frame_of(k));
    if (!socket->write(server.take_output(), 1.0)) return 1;
    const double ahead = (k + 1) / kRate_hz - (ros::SteadyTime::now() - start).toSec();
    if (ahead > 0.0) ros::WallDuration(ahead).sleep();
  }
  const LatencyRecord::Summary latency = bridge.latency();
  std::fprintf(stderr, "bench_mocap_node: %d frames, %d odometry messages arrived\n", kFrames, answers);
  std::printf(
      "{\"name\": \"mocap/frame_to_odometry_latency\", \"unit\": \"ms\", \"median\": %.6g, \"p99\": %.6g, "
      "\"max\": %.6g, \"n\": %zu}\n",
      1e3 * latency.median_s, 1e3 * latency.p99_s, 1e3 * latency.max_s, latency.count);
  return 0;
}

}  // namespace

}  // namespace atmos

int main(int argc, char** argv) {
  const std::string name = "mocap/frame_to_odometry_latency";
  if (argc > 1 && name.rfind(argv[1], 0) != 0) return 0;
  const int port = atmos::free_port();
  setenv("ROS_MASTER_URI", ("http://localhost:" + std::to_string(port)).c_str(), 1);
  const atmos::Master master(port);
  int no_arguments = 0;
  ros::init(no_arguments, argv, "bench_mocap_node", ros::init_options::AnonymousName);
  for (const ros::SteadyTime start = ros::SteadyTime::now(); !ros::master::check();) {
    if ((ros::SteadyTime::now() - start).toSec() > atmos::kLimit_s) return 1;
    ros::WallDuration(0.1).sleep();
  }
  return atmos::measure();
}
