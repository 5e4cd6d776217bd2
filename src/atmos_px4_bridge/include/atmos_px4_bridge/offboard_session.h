// The way into and out of flight: stream, switch to offboard, arm, and back (docs/px4_bridge.md,
// "Handshake"). Knows no protocol. Times are ROS seconds.
#pragma once

#include <limits>
#include <optional>
#include <string>

#include "atmos_px4_bridge/autopilot_link.h"
#include "atmos_px4_bridge/supervisor.h"

namespace atmos {

class OffboardSession {
 public:
  static constexpr double kStreamFirst_s = 1.1;  // PX4 wants set-points for one second before the switch
  static constexpr double kRetry_s = 0.5;        // between attempts at the same step
  static constexpr double kForeign_s = 3.0;      // after a fault of the link, changes are the autopilot's own
  static constexpr double kNotice_s = 0.5;       // a fault of the link may become known after its effect

  enum class State {
    kIdle,        // nobody asked to fly
    kPreparing,   // streaming set-points, switching, arming
    kFlying,      // armed and offboard
    kClosed,      // a rule holds the valves closed
    kStabilised,  // the autopilot holds the place
    kStopping,    // on the way back: manual, disarmed
    kReleased,    // somebody else (a pilot, the autopilot) took the vehicle; asked again, it flies again
  };

  // The operator's wish: fly, or stop and disarm.
  void request(bool fly);
  bool wanted() const { return wish_; }

  // What the autopilot says of itself, or confirms by acknowledging.
  void on_state(const AutopilotState& state, double now_s);
  // Why a command was refused; for people.
  void on_refusal(const std::string& text) { refusal_ = text; }
  // The link was down, or the autopilot started anew: what changes now is nobody's decision.
  void on_disturbance(double now_s);

  // Sends what is next. Nothing is sent against a pilot's switch. `streaming`: set-points (closed ones
  // included) are being sent.
  void step(const Verdict& verdict, bool streaming, AutopilotLink& link, double now_s);

  State state() const { return state_; }
  const AutopilotState& autopilot() const { return autopilot_; }
  const std::string& refusal() const { return refusal_; }

 private:
  void enter(State state) { state_ = state; }
  bool in_our_hands() const;
  void disarm(AutopilotLink& link, double now_s);
  bool retry(double now_s);

  static constexpr double kNever = -std::numeric_limits<double>::infinity();
  bool wish_ = false;
  State state_ = State::kIdle;
  AutopilotState autopilot_;
  bool known_ = false;  // the autopilot has spoken since the last disturbance
  bool held_ = false;   // it was armed, in the mode that is ours
  bool own_ = false;    // we told it to leave
  std::string refusal_;
  double streaming_since_ = kNever, last_attempt_ = kNever, disturbed_s_ = kNever;
  std::optional<double> left_s_;  // since when it no longer flies although nobody here wanted that
  bool streaming_ = false;
};

const char* name_of(OffboardSession::State state);

}  // namespace atmos
