// A QTM server fed by the simulator: sim/mocap_pose of every robot in, the real-time protocol out
// (docs/mocap.md). Parameters: ~config (path), ~robots (names, separated by blanks: namespaces and names of
// the bodies), ~lockstep (bool), ~port (optional: in place of the file's). It listens to the simulator only
// once a client streams: simulated time can wait for that connection.
#include <geometry_msgs/PoseStamped.h>
#include <ros/ros.h>

#include <atomic>
#include <cmath>
#include <deque>
#include <list>
#include <mutex>
#include <random>
#include <sstream>
#include <thread>

#include "atmos_mocap_bridge/emulator_config.h"
#include "atmos_mocap_bridge/qtm/pose.h"
#include "atmos_mocap_bridge/qtm/server.h"
#include "atmos_mocap_bridge/tcp_socket.h"
#include "atmos_model_ros/node.h"

namespace atmos {

namespace {

constexpr std::uint32_t kQueue = 10000;
constexpr std::size_t kMostClients = 10;  // as QTM
constexpr double kWriteLimit_s = 0.1;     // a client that does not read is left
constexpr double kPause_s = 0.0005;       // of the thread that serves the clients

class QtmEmulator {
 public:
  QtmEmulator(const QtmEmulatorConfig& config, std::vector<std::string> robots, bool lockstep)
      : config_(config),
        lockstep_(lockstep),
        robots_(std::move(robots)),
        random_(config.seed),
        listener_(config.port) {
    settings_.newest_minor = config.newest_minor;
    settings_.parameters.frequency_hz = config.rate_hz;
    for (const std::string& robot : robots_) settings_.parameters.bodies.push_back({robot, true});
    poses_.assign(robots_.size(), unseen());
    thread_ = std::thread([this] { serve(); });
  }

  ~QtmEmulator() {
    running_ = false;
    thread_.join();
  }

 private:
  struct Client {
    TcpSocket socket;
    qtm::Server server;
  };
  struct Departure {
    double due_s;  // steady time
    qtm::Frame frame;
  };

  static PoseFrame unseen() {
    const double nan = std::nan("");
    return {nan, Eigen::Vector3d::Constant(nan), Eigen::Quaterniond(nan, nan, nan, nan)};
  }
  bool happens(double probability) {
    return std::uniform_real_distribution<double>(0.0, 1.0)(random_) < probability;
  }

  // Frames leave when every robot's pose of that stamp is there, or a newer one comes.
  void on_pose(std::size_t robot, const geometry_msgs::PoseStamped& message) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (message.header.stamp != stamp_) {
      if (poses_known_ > 0) send_frame();
      stamp_ = message.header.stamp;
    }
    const auto& p = message.pose.position;
    const auto& q = message.pose.orientation;
    poses_[robot] = {stamp_.toSec(), {p.x, p.y, p.z}, {q.w, q.x, q.y, q.z}};
    if (happens(config_.dropout_probability)) poses_[robot] = unseen();
    if (++poses_known_ == robots_.size()) send_frame();
  }

  void send_frame() {
    qtm::Frame frame;
    frame.number = ++number_;
    for (const PoseFrame& pose : poses_) frame.bodies.push_back(qtm::to_body(pose));
    poses_.assign(robots_.size(), unseen());
    poses_known_ = 0;
    frame.timestamp_us = stamp_.toNSec() / 1000;
    double wait = 0.0;
    if (!lockstep_) {
      frame.timestamp_us = static_cast<std::uint64_t>(
          1e6 * (config_.clock_offset_s + stamp_.toSec() * (1.0 + config_.clock_drift)));
      if (happens(config_.loss_probability)) return;
      wait = config_.latency_s;
      if (config_.jitter_s > 0.0)
        wait += std::exponential_distribution<double>(1.0 / config_.jitter_s)(random_);
    }
    if (wait > 0.0) {
      departures_.push_back({ros::SteadyTime::now().toSec() + wait, std::move(frame)});
    } else {
      for (Client& client : clients_) client.server.add(frame);
      flush();
    }
  }

  void flush() {
    clients_.remove_if([](Client& client) {
      const std::string data = client.server.take_output();
      return !data.empty() && !client.socket.write(data, kWriteLimit_s);
    });
  }

  void serve() {
    std::vector<char> buffer(1 << 16);
    while (running_) {
      auto socket = listener_.accept(0.0);
      {
        const std::lock_guard<std::mutex> lock(mutex_);
        if (socket && clients_.size() < kMostClients)
          clients_.push_back({std::move(*socket), qtm::Server(settings_)});
        for (double now = ros::SteadyTime::now().toSec();
             !departures_.empty() && departures_.front().due_s <= now; departures_.pop_front()) {
          for (Client& client : clients_) client.server.add(departures_.front().frame);
        }
        clients_.remove_if([&buffer](Client& client) {
          const long count = client.socket.read(buffer.data(), buffer.size(), 0.0);
          return count < 0 ||
                 (count > 0 && !client.server.receive(buffer.data(), static_cast<std::size_t>(count)));
        });
        flush();
        listen_once_somebody_streams();
      }
      ros::WallDuration(kPause_s).sleep();
    }
  }

  void listen_once_somebody_streams() {
    if (!subscribers_.empty()) return;
    bool streaming = false;
    for (const Client& client : clients_) streaming = streaming || client.server.streaming();
    if (!streaming) return;
    for (std::size_t i = 0; i < robots_.size(); ++i) {
      subscribers_.push_back(node_.subscribe<geometry_msgs::PoseStamped>(
          "/" + robots_[i] + "/sim/mocap_pose", kQueue,
          [this, i](const geometry_msgs::PoseStamped::ConstPtr& message) { on_pose(i, *message); }, {},
          ros::TransportHints().tcpNoDelay()));
    }
  }

  QtmEmulatorConfig config_;
  bool lockstep_;
  std::vector<std::string> robots_;
  std::mt19937_64 random_;
  TcpListener listener_;
  qtm::ServerSettings settings_;
  ros::NodeHandle node_;
  std::mutex mutex_;
  std::list<Client> clients_;
  std::vector<PoseFrame> poses_;  // of stamp_, by robot
  std::size_t poses_known_ = 0;
  ros::Time stamp_;
  std::uint32_t number_ = 0;
  std::deque<Departure> departures_;  // in the order of the frames: a late one holds up those after it
  std::vector<ros::Subscriber> subscribers_;
  std::atomic<bool> running_{true};
  std::thread thread_;
};

}  // namespace

}  // namespace atmos

int main(int argc, char** argv) {
  return atmos::run_node(argc, argv, "qtm_emulator", [] {
    const ros::NodeHandle parameters("~");
    const auto config =
        atmos::load_qtm_emulator_config(atmos::required_parameter<std::string>(parameters, "config"));
    std::istringstream words(atmos::required_parameter<std::string>(parameters, "robots"));
    std::vector<std::string> robots;
    for (std::string word; words >> word;) robots.push_back(word);
    if (robots.empty()) throw std::invalid_argument("parameter robots names no robot");
    try {
      const atmos::QtmEmulator emulator(config, robots,
                                        atmos::required_parameter<bool>(parameters, "lockstep"));
      ros::spin();
    } catch (const std::runtime_error& error) {
      std::fprintf(stderr, "qtm_emulator: %s\n", error.what());
      return 1;
    }
    return 0;
  });
}
