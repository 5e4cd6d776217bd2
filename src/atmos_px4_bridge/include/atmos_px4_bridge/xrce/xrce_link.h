// PX4 behind its own uxrce_dds_client: set-points of every level, odometry and commands out, telemetry in, on
// unpatched firmware (docs/xrce.md). PX4 lets whatever comes over this link act at once, in every mode: so a
// set-point is sent only while PX4 reports offboard mode; before, only the wish for it (OffboardControlMode).
// Times are ROS seconds.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>

#include "atmos_model/allocator.h"
#include "atmos_model/vehicle.h"
#include "atmos_px4_bridge/telemetry.h"
#include "atmos_px4_bridge/time_sync.h"
#include "atmos_px4_bridge/xrce/endpoint.h"

namespace atmos {

struct XrceConfig {
  xrce::Firmware firmware = xrce::Firmware::kPx4Space;
  std::uint8_t system_id = 1, autopilot_system_id = 1;
  double baud = 921600.0;  // of the line: sets the pace
};

class XrceLink : public AutopilotLink {
 public:
  using Write = xrce::Endpoint::Write;
  static constexpr double kStatusLimit_s = 1.5;  // PX4 reports its status twice a second and at every change

  XrceLink(const XrceConfig& config, const Vehicle& vehicle, Write write, TelemetryListener listener);

  void receive(const std::uint8_t* data, std::size_t size, double now_s) {
    endpoint_.receive(data, size, now_s);
  }
  void restart() { endpoint_.restart(); }
  // Timers and pacing: as often as time moves.
  void tick(double now_s) { endpoint_.tick(now_s); }

  LevelSupport support(Level level) const override;
  void send_setpoint(const Setpoint& setpoint, const OdometrySample& measured, double now_s) override;
  bool can_close() const override { return true; }
  void send_closed(double now_s) override;
  void send_odometry(const OdometrySample& odometry, double now_s) override;
  void send_mode(FlightMode mode, double now_s) override;
  void send_arm(bool arm, bool force, double now_s) override;

  const xrce::Endpoint& endpoint() const { return endpoint_; }
  // Of PX4's clock; the delay of the line is in the offset.
  const TimeSync& time_sync() const { return time_sync_; }
  double round_trip_s() const { return round_trip_s_; }  // as PX4 measures it
  LinkCounters counters() const;

 private:
  using Samples = std::vector<xrce::Endpoint::Sample>;
  template <class Message>
  void add(Samples& samples, xrce::Topic topic, const Message& message) const;
  void send_command(std::uint32_t command, float param1, float param2, double now_s);
  void send_actuators(const std::vector<double>& duty, double now_s);
  bool offboard_confirmed(double now_s) const;
  xrce::F3 thrust_body(const Eigen::Vector3d& force_B) const;
  void fill_position(const Setpoint& setpoint, double now_s, Samples& samples) const;
  void take_sample(xrce::Topic topic, xrce::ByteView payload, double now_s);
  double local_time(std::uint64_t stamp_us, double now_s) const;
  void on_status(const xrce::VehicleStatus& message, double now_s);
  void on_ack(const xrce::VehicleCommandAck& message);

  XrceConfig config_;
  BodyWrench unit_;  // N, N, N m of a normalised 1
  std::size_t thrusters_;
  bool reversible_;
  TelemetryListener listener_;
  TimeSync time_sync_;
  double round_trip_s_ = 0.0;
  std::optional<AutopilotState> state_;
  double state_s_ = 0.0;
  MotionEstimate motion_;
  bool has_angular_velocity_ = false;
  std::map<std::uint32_t, std::string> asked_;  // command -> words for it
  xrce::Endpoint endpoint_;
};

}  // namespace atmos
