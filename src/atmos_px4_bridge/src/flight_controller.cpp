#include "atmos_px4_bridge/flight_controller.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

namespace atmos {

namespace {

constexpr double kSameInstant = 1e-6;  // s, above the resolution of a ROS time held in a double
constexpr double kMostPeriodsAhead = 2.0;
constexpr double kScaleResolution = 1e-9;
constexpr double kRateAge = 1.5;  // periods: a yaw rate measured longer ago is none

std::string text(const char* format, double a, double b = 0.0) {
  char buffer[160];
  std::snprintf(buffer, sizeof(buffer), format, a, b);
  return buffer;
}

std::optional<ActuatorModel> model_of(const Vehicle& vehicle, const FlightControllerConfig& config) {
  if (config.model.empty()) return std::nullopt;
  return ActuatorModel(vehicle, config.model);
}

}  // namespace

FlightController::FlightController(const Vehicle& vehicle, const FlightControllerConfig& config,
                                   Pacing pacing)
    : thruster_count_(vehicle.thrusters.size()),
      actuation_(vehicle.actuation),
      model_(model_of(vehicle, config)),
      allocator_(model_ ? model_->vehicle() : vehicle),
      orders_(static_cast<int>(vehicle.thrusters.size()), model_ ? model_->timing() : ValveTiming{},
              vehicle.actuation),
      rate_(config.rate),
      pwm_(vehicle.pwm),
      pacing_(pacing) {}

double FlightController::period_start(double time_s) const {
  return std::floor((time_s + kSameInstant) / pwm_.period_s) * pwm_.period_s;
}

std::string FlightController::fault_in(const ThrusterCommand& command, double now_s) const {
  if (command.duty.size() != thruster_count_) {
    return text("malformed command: %.0f duties for %.0f thrusters", static_cast<double>(command.duty.size()),
                static_cast<double>(thruster_count_));
  }
  for (std::size_t i = 0; i < command.duty.size(); ++i) {
    const double number = static_cast<double>(i + 1);
    if (!std::isfinite(command.duty[i])) return text("malformed command: duty %.0f is not finite", number);
    if (actuation_ == Actuation::kOnOff && (command.duty[i] < 0.0 || command.duty[i] > 1.0))
      return text("malformed command: duty %.0f is %g, outside [0, 1]", number, command.duty[i]);
    if (std::abs(command.duty[i]) > 1.0)
      return text("malformed command: duty %.0f is %g, outside [-1, 1]", number, command.duty[i]);
  }
  // Written so that a NaN fails.
  if (!(std::abs(command.period_s - pwm_.period_s) <= kSameInstant))
    return text("malformed command: period %g s, the vehicle's is %g s", command.period_s, pwm_.period_s);
  if (!(std::abs(std::remainder(command.stamp_s, pwm_.period_s)) <= kGrid_s))
    return text("malformed command: stamp %.6f s is off the PWM grid", command.stamp_s);
  if (pacing_ == Pacing::kRealTime && command.stamp_s > now_s + kMostPeriodsAhead * pwm_.period_s)
    return text("malformed command: stamp lies %g s ahead", command.stamp_s - now_s);
  return {};
}

std::string FlightController::odometry_fault(double time_s) const {
  if (pacing_ == Pacing::kLockstep) return {};
  if (std::isinf(odometry_stamp_)) return "no odometry yet";
  const double age = time_s - odometry_stamp_;
  return age < kOdometryLimit_s ? std::string() : text("odometry is %.2f s old", age);
}

ValveOrder FlightController::order(ThrusterCommand command, const std::string& reason) {
  newest_stamp_ = command.stamp_s;
  last_fault_.clear();
  status_.stamp_s = command.stamp_s;
  status_.reason = reason;
  status_.flying = reason.empty();
  if (model_) {
    model_->observe(command.stamp_s, orders_);
    orders_.add(command);
    orders_.forget_before(command.stamp_s - 2.0 * pwm_.period_s);
  }
  return {std::move(command), status_};
}

ValveOrder FlightController::closed(double stamp_s, const std::string& reason) {
  return order({stamp_s, pwm_.period_s, std::vector<double>(thruster_count_, 0.0)}, reason);
}

// A recording played again or a restarted simulator: what was known belongs to another time.
void FlightController::notice_restart(double now_s) {
  if (now_s < last_now_ - pwm_.period_s) {
    newest_stamp_ = -std::numeric_limits<double>::infinity();
    odometry_stamp_ = measured_stamp_ = -std::numeric_limits<double>::infinity();
    rate_.reset();
    if (model_) {
      model_->forget();
      orders_ = ValveSchedule(static_cast<int>(thruster_count_), model_->timing(), actuation_);
    }
  }
  last_now_ = now_s;
}

std::optional<ValveOrder> FlightController::take_command(const ThrusterCommand& command, double now_s) {
  return take(command, fault_in(command, now_s), now_s);
}

std::optional<ValveOrder> FlightController::take(const ThrusterCommand& command, const std::string& fault,
                                                 double now_s) {
  const bool lockstep = pacing_ == Pacing::kLockstep;
  if (!lockstep) notice_restart(now_s);
  ++status_.commands;

  if (!fault.empty()) {
    ++status_.malformed;
    last_fault_ = fault;
    if (!lockstep || !std::isfinite(command.stamp_s)) return std::nullopt;
    // The simulator waits for an answer to this period.
    const double stamp = std::round(command.stamp_s / pwm_.period_s) * pwm_.period_s;
    if (stamp <= newest_stamp_ + kGrid_s) return std::nullopt;
    return closed(stamp, fault);
  }

  // In real time a command for the newest period replaces the rest of it; in lockstep that period has been
  // answered.
  const bool superseded =
      lockstep ? command.stamp_s <= newest_stamp_ + kGrid_s : command.stamp_s < newest_stamp_ - 2.0 * kGrid_s;
  const bool over = !lockstep && now_s >= command.stamp_s + pwm_.period_s - kSameInstant;
  if (superseded || over) {
    ++status_.expired;
    return std::nullopt;
  }
  if (!lockstep && now_s > command.stamp_s + kSameInstant) ++status_.late;

  const std::string odometry = odometry_fault(std::max(command.stamp_s, now_s));
  if (!odometry.empty()) {
    const bool closed_already = std::abs(newest_stamp_ - command.stamp_s) <= 2.0 * kGrid_s && !status_.flying;
    if (closed_already) return std::nullopt;
    return closed(command.stamp_s, odometry);
  }

  ThrusterCommand sent = command;
  const double longest =
      lockstep ? 1.0 : (odometry_stamp_ + kOdometryLimit_s - command.stamp_s) / pwm_.period_s;
  if (actuation_ == Actuation::kOnOff) {
    for (double& duty : sent.duty) {
      duty = std::min(duty, longest);
      if (duty * pwm_.period_s < pwm_.min_on_time_s - kSameInstant) duty = 0.0;
    }
  }
  return order(std::move(sent), {});
}

std::optional<ValveOrder> FlightController::take_wrench(double stamp_s, const BodyWrench& wrench,
                                                        double now_s) {
  Allocation allocation = allocator_.allocate(wrench);
  ThrusterCommand command{stamp_s, pwm_.period_s, std::move(allocation.duty)};
  if (!wrench.allFinite()) return take(command, "malformed command: wrench is not finite", now_s);
  if (allocation.scale < 1.0 - kScaleResolution) ++status_.scaled;
  if (model_ && fault_in(command, now_s).empty()) {
    model_->observe(stamp_s, orders_);
    model_->compensate(stamp_s, command.duty);
  }
  return take_command(command, now_s);
}

std::optional<ValveOrder> FlightController::take_rate(double stamp_s, const Eigen::Vector2d& force,
                                                      double yaw_rate, double now_s) {
  if (!std::isfinite(stamp_s) || !force.allFinite() || !std::isfinite(yaw_rate)) {
    const ThrusterCommand none{stamp_s, pwm_.period_s, std::vector<double>(thruster_count_, 0.0)};
    return take(none, "malformed command: force or rate is not finite", now_s);
  }
  std::optional<double> measured;
  if (stamp_s - measured_stamp_ <= kRateAge * pwm_.period_s) measured = measured_yaw_rate_;
  const BodyWrench wrench(force.x(), force.y(), rate_.output(stamp_s, yaw_rate, measured));
  rate_.achieved(std::min(1.0, allocator_.attainable_scale(wrench)) * wrench[2]);
  return take_wrench(stamp_s, wrench, now_s);
}

void FlightController::take_odometry(double stamp_s, double yaw_rate, double now_s) {
  if (!std::isfinite(stamp_s)) return;
  if (std::isfinite(yaw_rate) && stamp_s > measured_stamp_) {
    measured_stamp_ = stamp_s;
    measured_yaw_rate_ = yaw_rate;
  }
  if (pacing_ == Pacing::kLockstep) return;
  notice_restart(now_s);
  odometry_stamp_ = std::max(odometry_stamp_, std::min(stamp_s, now_s));
}

std::optional<ValveOrder> FlightController::tick(double now_s) {
  if (pacing_ == Pacing::kLockstep) return std::nullopt;
  notice_restart(now_s);
  const double start = period_start(now_s);
  if (now_s < start + kGrace_s || newest_stamp_ > start - 2.0 * kGrid_s) return std::nullopt;
  const std::string odometry = odometry_fault(now_s);
  if (!odometry.empty()) return closed(start, odometry);
  return closed(start, last_fault_.empty() ? "no command for this period" : last_fault_);
}

}  // namespace atmos
