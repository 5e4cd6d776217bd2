#include "atmos_px4_bridge/offboard_session.h"

namespace atmos {

const char* name_of(OffboardSession::State state) {
  using State = OffboardSession::State;
  switch (state) {
    case State::kIdle:
      return "idle";
    case State::kPreparing:
      return "preparing";
    case State::kFlying:
      return "flying";
    case State::kClosed:
      return "closed";
    case State::kStabilised:
      return "stabilised";
    case State::kStopping:
      return "stopping";
    case State::kReleased:
      return "released";
  }
  return "unknown";
}

void OffboardSession::request(bool fly) {
  if (!fly && wish_) enter(State::kStopping);
  if (fly) enter(State::kPreparing);
  wish_ = fly;
  refusal_.clear();
  last_attempt_ = kNever;
}

void OffboardSession::on_state(const AutopilotState& state, double now_s) {
  const bool flew = autopilot_.armed && autopilot_.mode == FlightMode::kOffboard;
  const bool flies = state.armed && state.mode == FlightMode::kOffboard;
  autopilot_ = state;
  // A pilot's switch must never be fought.
  if (state_ == State::kFlying && flew && !flies && now_s - disturbed_s_ > kForeign_s) {
    wish_ = false;
    enter(State::kReleased);
  }
}

bool OffboardSession::retry(double now_s) {
  if (now_s - last_attempt_ < kRetry_s && now_s >= last_attempt_) return false;
  last_attempt_ = now_s;
  return true;
}

void OffboardSession::step(const Verdict& verdict, bool streaming, AutopilotLink& link, double now_s) {
  if (streaming && !streaming_) streaming_since_ = now_s;
  streaming_ = streaming;

  if (verdict.rule == Rule::kKill) {
    if (autopilot_.armed && retry(now_s)) link.send_arm(false, true, now_s);
    wish_ = false;
    enter(State::kClosed);
    return;
  }
  if (state_ == State::kStopping) {
    if (!autopilot_.armed) return enter(State::kIdle);
    if (!retry(now_s)) return;
    link.send_mode(FlightMode::kManual, now_s);
    link.send_arm(false, true, now_s);
    return;
  }
  if (!wish_) {
    if (state_ == State::kClosed || state_ == State::kPreparing) enter(State::kIdle);
    return;
  }

  switch (verdict.reaction) {
    case Reaction::kDisarm:
      enter(State::kClosed);
      if (autopilot_.armed && retry(now_s)) link.send_arm(false, true, now_s);
      return;
    case Reaction::kClose:
      // Before the start there is nothing to close.
      enter(state_ == State::kPreparing && !autopilot_.armed ? State::kPreparing : State::kClosed);
      if (!link.can_close() && autopilot_.armed && retry(now_s)) link.send_arm(false, true, now_s);
      return;
    case Reaction::kStabilise:
      enter(State::kStabilised);
      if (autopilot_.mode != FlightMode::kPosition && retry(now_s))
        link.send_mode(FlightMode::kPosition, now_s);
      return;
    case Reaction::kFly:
      break;
  }
  if (autopilot_.armed && autopilot_.mode == FlightMode::kOffboard) return enter(State::kFlying);
  enter(State::kPreparing);
  if (!streaming_ || now_s - streaming_since_ < kStreamFirst_s || !retry(now_s)) return;
  if (autopilot_.mode != FlightMode::kOffboard) {
    link.send_mode(FlightMode::kOffboard, now_s);
  } else {
    link.send_arm(true, false, now_s);
  }
}

}  // namespace atmos
