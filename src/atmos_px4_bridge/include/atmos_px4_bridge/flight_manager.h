// Flying through an autopilot, whatever the link: set-points pass while every safety rule holds, closed
// valves take their place otherwise. Times are ROS seconds; bad data never throws.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>

#include "atmos_px4_bridge/autopilot_link.h"
#include "atmos_px4_bridge/offboard_session.h"
#include "atmos_px4_bridge/supervisor.h"

namespace atmos {

struct FlightManagerStatus {
  OffboardSession::State state = OffboardSession::State::kIdle;
  Verdict verdict;
  AutopilotState autopilot;
  bool connected = false;
  std::string refusal;            // last command that the autopilot refused, since the last request
  std::uint64_t setpoints = 0;    // counters since start: sent to the autopilot for the first time
  std::uint64_t malformed = 0;    // not finite, out of range: not sent
  std::uint64_t unsupported = 0;  // of a level that does not exist over this link: not sent
  std::uint64_t odometry = 0;     // sent
};

class FlightManager {
 public:
  static constexpr double kRepeat_s = 0.02;          // a set-point is sent again this often
  static constexpr double kOdometryPeriod_s = 0.01;  // the autopilot wants no more

  // A set-point has `thrusters` duties within [min_duty, 1].
  FlightManager(const SupervisorConfig& config, AutopilotLink& link, std::size_t thrusters, double min_duty);

  void take_setpoint(const Setpoint& setpoint, double now_s);
  void take_odometry(const OdometrySample& odometry, double now_s);
  // Whether the controller says that it has no command worth carrying out.
  void take_nmpc(bool failed);
  void take_battery(double share) { supervisor_.on_battery(share); }
  void take_autopilot(const AutopilotState& state, double now_s) { session_.on_state(state, now_s); }
  void take_refusal(const std::string& text) { session_.on_refusal(text); }
  // Something intelligible came from the autopilot.
  void hear(double now_s);
  void take_reboot(double now_s) { session_.on_disturbance(now_s); }

  // The operator: fly or stop; kill stays until it is taken back.
  void request(bool fly);
  void set_kill(bool kill);

  // To be called at 50 Hz or more.
  void tick(double now_s);

  FlightManagerStatus status() const;

 private:
  bool well_formed(const Setpoint& setpoint) const;

  Supervisor supervisor_;
  OffboardSession session_;
  AutopilotLink& link_;
  std::size_t thrusters_;
  double min_duty_;
  bool nmpc_failed_ = false, nmpc_closed_ = false;
  std::optional<Setpoint> setpoint_;
  OdometrySample odometry_;
  FlightManagerStatus status_;
  static constexpr double kNever = -std::numeric_limits<double>::infinity();
  double heard_s_ = kNever, sent_s_ = kNever, odometry_sent_s_ = kNever;
};

}  // namespace atmos
