// PX4 behind a MAVLink line: set-points, odometry and commands out, telemetry in. What PX4 accepts and what
// is lost on stock firmware: docs/px4_bridge.md, "Levels over MAVLink". Times are ROS seconds.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "atmos_model/allocator.h"
#include "atmos_model/vehicle.h"
#include "atmos_px4_bridge/autopilot_link.h"
#include "atmos_px4_bridge/mavlink/codec.h"
#include "atmos_px4_bridge/telemetry.h"
#include "atmos_px4_bridge/time_sync.h"

namespace atmos {

// stock: as PX4 ships. patched: also takes the natural encodings of all levels (docs/px4_bridge.md).
enum class Firmware { kStock, kPatched };

struct MavlinkConfig {
  Firmware firmware;
  mavlink::Address own, autopilot;
  double attitude_p;  // 1/s, the autopilot's SC_YAW_P: for the work-around of the rate level
};

class MavlinkLink : public AutopilotLink {
 public:
  using Write = std::function<void(const mavlink::u8*, std::size_t)>;

  MavlinkLink(const MavlinkConfig& config, const Vehicle& vehicle, Write write, TelemetryListener listener);

  // Bytes as they came from the line.
  void receive(const mavlink::u8* data, std::size_t size, double now_s);
  // The line was opened (again).
  void restart();
  // Heartbeat, time synchronisation, stream requests; at 50 Hz or more.
  void tick(double now_s);

  LevelSupport support(Level level) const override;
  void send_setpoint(const Setpoint& setpoint, const OdometrySample& measured, double now_s) override;
  bool can_close() const override { return config_.firmware == Firmware::kPatched; }
  void send_closed(double now_s) override;
  void send_odometry(const OdometrySample& odometry, double now_s) override;
  void send_mode(FlightMode mode, double now_s) override;
  void send_arm(bool arm, bool force, double now_s) override;

  void request_parameter(const std::string& name);
  void set_parameter(const Parameter& parameter);
  // Opens one thruster (from 1) for a time; PX4 does so only while disarmed and for 3 s at most.
  void send_actuator_test(int thruster, double share, double duration_s);

  const TimeSync& time_sync() const { return time_sync_; }
  const LinkCounters& counters() const { return counters_; }

 private:
  template <class Message>
  void send(const Message& message);
  void send_command(mavlink::u16 command, const std::vector<float>& parameters);
  void dispatch(const mavlink::Frame& frame, double now_s);
  void on_timesync(const mavlink::Timesync& message, double now_s);
  void notice_remote_time(double remote_s, double now_s);
  double local_time(double remote_s, double now_s) const;
  void send_attitude(const Eigen::Quaterniond& q_WB, const Eigen::Vector3d& force_B, double now_s);
  void send_actuators(mavlink::u8 group, const std::vector<double>& controls, double now_s);
  mavlink::Floats<3> thrust_body(const Eigen::Vector3d& force_B) const;
  mavlink::u32 boot_ms(double now_s) const;

  MavlinkConfig config_;
  BodyWrench unit_;  // N, N, N m of a normalised 1
  std::size_t thrusters_;
  Write write_;
  TelemetryListener listener_;
  mavlink::Parser parser_;
  TimeSync time_sync_;
  LinkCounters counters_;
  mavlink::u8 sequence_ = 0;
  std::optional<mavlink::u8> last_sequence_;
  std::optional<double> first_now_, heartbeat_s_, timesync_s_, remote_s_, streams_s_;
  MotionEstimate motion_;
  std::map<mavlink::u16, std::string> asked_;  // command -> words for it
};

}  // namespace atmos
