// Frames of a Qualisys Track Manager: a thread that owns the connection, the session and the clock map.
#include <atomic>
#include <cmath>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "atmos_mocap_bridge/clock_map.h"
#include "atmos_mocap_bridge/qtm/pose.h"
#include "atmos_mocap_bridge/qtm/session.h"
#include "atmos_mocap_bridge/tcp_socket.h"
#include "pose_source.h"

namespace atmos {

namespace {

constexpr double kConnectLimit_s = 1.0, kWriteLimit_s = 1.0;
constexpr double kWait_s = 0.05;  // for bytes, and so the delay of everything that is not a frame
constexpr double kNoFrames_s = 1.0;
constexpr std::size_t kChunk = 1 << 16;

ros::Time time_of_microseconds(std::uint64_t us) {
  return ros::Time(static_cast<std::uint32_t>(us / 1000000), static_cast<std::uint32_t>(us % 1000000) * 1000);
}

class QtmSource : public PoseSource {
 public:
  QtmSource(const QtmSourceConfig& config, const SourceContext& context)
      : config_(config),
        lockstep_(context.lockstep),
        sink_(context.sink),
        session_({config.body.empty() ? context.robot : config.body, config.silence_s, config.max_wait_s},
                 [this](const qtm::Frame& frame, const qtm::Body& body) { on_frame(frame, body); }),
        thread_([this] { run(); }) {}

  ~QtmSource() override {
    running_ = false;
    thread_.join();
  }

  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& out) override {
    using diagnostic_msgs::DiagnosticStatus;
    const std::lock_guard<std::mutex> lock(report_mutex_);
    const Report& report = report_;
    if (report.state != qtm::Session::State::kStreaming)
      out.summary(DiagnosticStatus::ERROR, "no stream from " + config_.host + ": " + report.problem);
    else if (report.without_frames)
      out.summary(DiagnosticStatus::WARN, "connected, but no frames come: QTM measures nothing");
    else if (!report.body_known)
      out.summary(DiagnosticStatus::WARN, "QTM streams no frame with the body");
    else
      out.summary(DiagnosticStatus::OK, "streaming");
    out.add("protocol version", report.version);
    out.add("last problem", report.problem);
    out.add("connections", report.counters.connections);
    out.add("frames", report.counters.frames);
    out.add("frames without the body in sight", report.counters.unseen);
    out.add("frames without a place for the body", report.counters.without_body);
    out.add("frames skipped by the server", report.counters.skipped);
    out.add("malformed packets", report.counters.malformed);
    out.add("errors of the server", report.counters.errors);
    out.add("residual [mm]", report.residual_mm);
    out.add("cameras' 2D data dropped [1/1000]", report.drop_rate);
    out.add("clock drift [1e-6]", 1e6 * report.drift);
  }

 private:
  struct Report {
    qtm::Session::State state = qtm::Session::State::kOffline;
    qtm::Session::Counters counters;
    std::string version, problem;
    bool body_known = false, without_frames = true;
    float residual_mm = 0.0f;
    int drop_rate = 0;
    double drift = 0.0;
  };

  void run() {
    std::vector<char> buffer(kChunk);
    std::optional<TcpSocket> socket;
    while (running_) {
      double now = ros::SteadyTime::now().toSec();
      if (!socket && session_.wants_connection(now)) {
        socket = TcpSocket::connect(config_.host, config_.port, kConnectLimit_s);
        now = ros::SteadyTime::now().toSec();
        if (socket)
          session_.connected(now);
        else
          session_.connection_failed(now);
      }
      if (socket) {
        if (!serve(*socket, buffer)) {
          socket.reset();
          session_.closed(ros::SteadyTime::now().toSec());
        }
      } else {
        ros::WallDuration(kWait_s).sleep();
      }
      renew_report();
    }
  }

  // False: the connection is over.
  bool serve(TcpSocket& socket, std::vector<char>& buffer) {
    if (!socket.write(session_.take_output(), kWriteLimit_s)) return false;
    const long count = socket.read(buffer.data(), buffer.size(), kWait_s);
    if (count < 0) return false;
    received_ = ros::SteadyTime::now();
    const double now = received_.toSec();
    return (count == 0 || session_.receive(buffer.data(), static_cast<std::size_t>(count), now)) &&
           session_.tick(now);
  }

  void on_frame(const qtm::Frame& frame, const qtm::Body& body) {
    // In lockstep arrivals say nothing about time; the emulator's clock is ROS time.
    ros::Time stamp = time_of_microseconds(frame.timestamp_us);
    if (!lockstep_)
      stamp.fromSec(clock_.add(1e-6 * static_cast<double>(frame.timestamp_us), ros::Time::now().toSec()));
    residual_mm_ = body.residual_mm;
    drop_rate_ = frame.drop_rate;
    sink_({stamp, qtm::to_pose_frame(body, stamp.toSec()), received_});
  }

  void renew_report() {
    const std::lock_guard<std::mutex> lock(report_mutex_);
    report_.state = session_.state();
    report_.counters = session_.counters();
    report_.version = session_.version();
    report_.problem = session_.last_problem();
    report_.body_known = session_.body_known();
    if (session_.counters().frames + session_.counters().without_body != frames_seen_) {
      frames_seen_ = session_.counters().frames + session_.counters().without_body;
      last_frame_ = ros::SteadyTime::now();
    }
    report_.without_frames = (ros::SteadyTime::now() - last_frame_).toSec() > kNoFrames_s;
    report_.residual_mm = residual_mm_;
    report_.drop_rate = drop_rate_;
    report_.drift = clock_.drift();
  }

  QtmSourceConfig config_;
  bool lockstep_;
  Sink sink_;
  qtm::Session session_;
  ClockMap clock_;
  ros::SteadyTime received_;
  std::uint64_t frames_seen_ = 0;
  ros::SteadyTime last_frame_;
  float residual_mm_ = 0.0f;
  int drop_rate_ = 0;
  std::mutex report_mutex_;
  Report report_;
  std::atomic<bool> running_{true};
  std::thread thread_;  // last: it uses all of the above
};

}  // namespace

std::unique_ptr<PoseSource> make_qtm_source(const QtmSourceConfig& config, const SourceContext& context) {
  return std::make_unique<QtmSource>(config, context);
}

}  // namespace atmos
