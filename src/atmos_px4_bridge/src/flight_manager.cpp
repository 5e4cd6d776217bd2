#include "atmos_px4_bridge/flight_manager.h"

#include <algorithm>
#include <cmath>

namespace atmos {

namespace {

constexpr double kSlack = 1e-4;  // s: what comes at exactly the period counts as due

bool is_closed(const Setpoint& setpoint) {
  return setpoint.level == Level::kThrusters &&
         std::all_of(setpoint.duty.begin(), setpoint.duty.end(), [](double duty) { return duty == 0.0; });
}

}  // namespace

FlightManager::FlightManager(const SupervisorConfig& config, AutopilotLink& link, std::size_t thrusters,
                             double min_duty)
    : supervisor_(config), link_(link), thrusters_(thrusters), min_duty_(min_duty) {}

bool FlightManager::well_formed(const Setpoint& setpoint) const {
  switch (setpoint.level) {
    case Level::kPosition:
      return !setpoint.p_WB.array().isInf().any() && !setpoint.v_WB.array().isInf().any();
    case Level::kAttitude:
      return setpoint.force_B.allFinite() && setpoint.q_WB.coeffs().allFinite() &&
             std::abs(setpoint.q_WB.norm() - 1.0) < 1e-3;
    case Level::kRate:
      return setpoint.force_B.allFinite() && std::isfinite(setpoint.w_WB_B.z());
    case Level::kWrench:
      return setpoint.force_B.allFinite() && setpoint.torque_B.allFinite();
    case Level::kThrusters:
      return setpoint.duty.size() == thrusters_ &&
             std::all_of(setpoint.duty.begin(), setpoint.duty.end(),
                         [this](double duty) { return duty >= min_duty_ && duty <= 1.0; });
  }
  return false;
}

void FlightManager::take_setpoint(const Setpoint& setpoint, double now_s) {
  if (!well_formed(setpoint)) {
    ++status_.malformed;
    return;
  }
  const bool supported = link_.support(setpoint.level).how != LevelSupport::How::kNone;
  // Closed valves are a thruster command at every level: it is obeyed over a link that has no such level,
  // too.
  nmpc_closed_ = !supported && is_closed(setpoint);
  supervisor_.on_nmpc(nmpc_failed_ || nmpc_closed_);
  if (!supported) {
    if (!nmpc_closed_) ++status_.unsupported;
    return;
  }
  setpoint_ = setpoint;
  supervisor_.on_setpoint(now_s);
  if (supervisor_.judge(now_s).reaction != Reaction::kFly) return;
  link_.send_setpoint(setpoint, odometry_, now_s);
  ++status_.setpoints;
  sent_s_ = now_s;
}

void FlightManager::take_odometry(const OdometrySample& odometry, double now_s) {
  supervisor_.on_odometry(odometry, now_s);
  if (!odometry.is_finite() || !(odometry.stamp_s >= odometry_sent_s_ + kOdometryPeriod_s - kSlack)) return;
  odometry_ = odometry;
  odometry_sent_s_ = odometry.stamp_s;
  link_.send_odometry(odometry, now_s);
  ++status_.odometry;
}

void FlightManager::take_nmpc(bool failed) {
  nmpc_failed_ = failed;
  supervisor_.on_nmpc(nmpc_failed_ || nmpc_closed_);
}

void FlightManager::hear(double now_s) {
  supervisor_.on_link(now_s);
  heard_s_ = now_s;
}

void FlightManager::request(bool fly) {
  if (fly) supervisor_.release_latches();
  session_.request(fly);
}

void FlightManager::set_kill(bool kill) { supervisor_.set_kill(kill); }

void FlightManager::tick(double now_s) {
  if (now_s < sent_s_) sent_s_ = odometry_sent_s_ = kNever;  // a restarted simulator
  const Verdict verdict = supervisor_.judge(now_s);
  if (verdict.rule == Rule::kLinkLost) session_.on_disturbance(now_s);

  const bool fly = verdict.reaction == Reaction::kFly;
  const bool streaming = fly || (link_.can_close() && verdict.reaction != Reaction::kDisarm);
  if (streaming && now_s >= sent_s_ + kRepeat_s - kSlack) {
    // While the autopilot stabilises, closed valves are what offboard would start with again.
    if (fly && setpoint_) {
      link_.send_setpoint(*setpoint_, odometry_, now_s);
    } else {
      link_.send_closed(now_s);
    }
    sent_s_ = now_s;
  }
  session_.step(verdict, streaming, link_, now_s);
  status_.verdict = verdict;
  status_.connected = supervisor_.link_alive(now_s);
}

FlightManagerStatus FlightManager::status() const {
  FlightManagerStatus status = status_;
  status.state = session_.state();
  status.autopilot = session_.autopilot();
  status.refusal = session_.refusal();
  return status;
}

}  // namespace atmos
