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
  held_ = false;
  left_s_.reset();
  refusal_.clear();
  last_attempt_ = kNever;
}

bool OffboardSession::in_our_hands() const {
  const FlightMode ours = state_ == State::kStabilised ? FlightMode::kPosition : FlightMode::kOffboard;
  return autopilot_.armed && autopilot_.mode == ours;
}

void OffboardSession::on_state(const AutopilotState& state, double now_s) {
  autopilot_ = state;
  known_ = true;
  if (in_our_hands()) {
    held_ = true;
    own_ = false;
    left_s_.reset();
  } else if (held_) {
    held_ = false;
    if (!own_) left_s_ = now_s;
  }
}

void OffboardSession::disarm(AutopilotLink& link, double now_s) {
  if ((known_ && !autopilot_.armed) || !retry(now_s)) return;
  own_ = true;
  link.send_arm(false, true, now_s);
}

void OffboardSession::on_disturbance(double now_s) {
  disturbed_s_ = now_s;
  known_ = false;
}

bool OffboardSession::retry(double now_s) {
  if (now_s - last_attempt_ < kRetry_s && now_s >= last_attempt_) return false;
  last_attempt_ = now_s;
  return true;
}

void OffboardSession::step(const Verdict& verdict, bool streaming, AutopilotLink& link, double now_s) {
  if (streaming && !streaming_) streaming_since_ = now_s;
  streaming_ = streaming;

  const bool flies = known_ && autopilot_.armed && autopilot_.mode == FlightMode::kOffboard;
  if (verdict.rule == Rule::kKill) {
    disarm(link, now_s);
    wish_ = false;
    enter(State::kClosed);
    return;
  }
  if (state_ == State::kStopping) {
    if (known_ && !autopilot_.armed) return enter(State::kIdle);
    if (known_ && autopilot_.mode != FlightMode::kManual) link.send_mode(FlightMode::kManual, now_s);
    return disarm(link, now_s);
  }
  if (!wish_) {
    if (state_ == State::kClosed || state_ == State::kPreparing) enter(State::kIdle);
    return;
  }

  if (left_s_ && now_s - disturbed_s_ > kForeign_s) {
    if (now_s - *left_s_ < kNotice_s) return;
    left_s_.reset();
    wish_ = false;
    return enter(State::kReleased);
  }
  left_s_.reset();

  switch (verdict.reaction) {
    case Reaction::kDisarm:
      enter(State::kClosed);
      return disarm(link, now_s);
    case Reaction::kClose:
      // Before the start there is nothing to close.
      enter(state_ == State::kPreparing && !autopilot_.armed ? State::kPreparing : State::kClosed);
      if (!link.can_close()) disarm(link, now_s);
      return;
    case Reaction::kStabilise:
      if (state_ != State::kStabilised) held_ = false, own_ = true;
      enter(State::kStabilised);
      if (autopilot_.mode != FlightMode::kPosition && retry(now_s))
        link.send_mode(FlightMode::kPosition, now_s);
      return;
    case Reaction::kFly:
      break;
  }
  if (flies) return enter(State::kFlying);
  enter(State::kPreparing);
  if (!streaming_ || now_s - streaming_since_ < kStreamFirst_s || !retry(now_s)) return;
  if (!known_) return;
  if (autopilot_.mode != FlightMode::kOffboard) {
    link.send_mode(FlightMode::kOffboard, now_s);
  } else {
    link.send_arm(true, false, now_s);
  }
}

}  // namespace atmos
