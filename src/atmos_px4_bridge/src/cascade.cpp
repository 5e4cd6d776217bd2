#include "atmos_px4_bridge/cascade.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace atmos {

namespace {

using Eigen::Vector3d;

constexpr double kNever = std::numeric_limits<double>::infinity();

PidGains scaled(PidGains gains, double factor) {
  for (double* gain : {&gains.p, &gains.i, &gains.d, &gains.feed_forward, &gains.integral_limit})
    *gain *= factor;
  return gains;
}

CascadeGains metric(CascadeGains gains, const Vector3d& force_unit, const Vector3d& torque_unit) {
  for (int i = 0; i < 3; ++i) {
    // World axes: the body may be turned any way, and the units along x and y are the same for a symmetric
    // set.
    gains.velocity[i] = scaled(gains.velocity[i], force_unit[i]);
    gains.force_max[i] *= force_unit[i];
    gains.rate[i] = scaled(gains.rate[i], torque_unit[i]);
  }
  return gains;
}

std::array<Pid, 3> loops(const std::array<PidGains, 3>& gains, double fade_out) {
  return {Pid(gains[0], fade_out), Pid(gains[1], fade_out), Pid(gains[2], fade_out)};
}

}  // namespace

const char* name_of(Level level) {
  switch (level) {
    case Level::kPosition:
      return "position";
    case Level::kAttitude:
      return "attitude";
    case Level::kRate:
      return "rate";
    case Level::kWrench:
      return "wrench";
    case Level::kThrusters:
      return "thrusters";
  }
  return "unknown";
}

Cascade::Cascade(const Vehicle& vehicle, const CascadeGains& gains, Units units)
    : allocator_(vehicle),
      force_unit_(units == Units::kMetric ? Vector3d::Ones()
                                          : Vector3d(allocator_.max_wrench()[0], allocator_.max_wrench()[1],
                                                     allocator_.max_wrench()[0])),
      torque_unit_(units == Units::kMetric ? Vector3d::Ones()
                                           : Vector3d::Constant(allocator_.max_wrench()[2])),
      gains_(metric(gains, force_unit_, torque_unit_)),
      velocity_(loops(gains_.velocity, kNever)),
      rate_(loops(gains_.rate, Pid::kRateFadeOut)),
      last_stamp_(-kNever) {}

Vector3d Cascade::velocity_integral() const {
  return {velocity_[0].integral(), velocity_[1].integral(), velocity_[2].integral()};
}

Vector3d Cascade::rate_integral() const {
  return {rate_[0].integral(), rate_[1].integral(), rate_[2].integral()};
}

void Cascade::reset() {
  position_integral_.setZero();
  for (Pid& loop : velocity_) loop.reset();
  for (Pid& loop : rate_) loop.reset();
}

const CascadeOutput& Cascade::update(double stamp_s, const Setpoint& setpoint, const CascadeState& state) {
  std::fill_n(velocity_runs_, 3, false);
  std::fill_n(rate_runs_, 3, false);
  output_.rate_B = kNotControlled;
  output_.force_B.setZero();
  output_.torque_B.setZero();

  if (setpoint.level == Level::kThrusters) {
    output_.allocation.duty = setpoint.duty;
    output_.allocation.achieved.setZero();
    output_.allocation.scale = 1.0;
  } else {
    const Eigen::Matrix3d R_WB = state.q_WB.toRotationMatrix();
    if (setpoint.level == Level::kPosition) {
      control_position(stamp_s, setpoint, state);
      output_.force_B = R_WB.transpose() * output_.force_B;
    } else {
      output_.force_B = setpoint.force_B.cwiseProduct(force_unit_);
    }
    if (setpoint.level == Level::kAttitude) control_attitude(setpoint.q_WB, state);
    if (setpoint.level == Level::kRate) output_.rate_B = setpoint.w_WB_B;
    if (setpoint.level == Level::kWrench) {
      output_.torque_B = setpoint.torque_B.cwiseProduct(torque_unit_);
    } else {
      control_rate(stamp_s, state);
    }
    allocate(R_WB);
  }
  // A loop that does not act must not come back with what it integrated in another situation.
  for (int i = 0; i < 3; ++i) {
    if (!velocity_runs_[i]) velocity_[i].reset(), position_integral_[i] = 0.0;
    if (!rate_runs_[i]) rate_[i].reset();
  }
  last_stamp_ = stamp_s;
  return output_;
}

// Leaves the force in world axes in output_.force_B.
void Cascade::control_position(double stamp_s, const Setpoint& setpoint, const CascadeState& state) {
  const double dt = stamp_s - last_stamp_;
  for (int i = 0; i < 3; ++i) {
    const bool position = std::isfinite(setpoint.p_WB[i]), velocity = std::isfinite(setpoint.v_WB[i]);
    double v = velocity ? setpoint.v_WB[i] : 0.0;
    const bool known = std::isfinite(state.v_WB[i]) && (!position || std::isfinite(state.p_WB[i]));
    if ((!position && !velocity) || !known) continue;
    if (position) {
      const double error = setpoint.p_WB[i] - state.p_WB[i];
      const double asked = v + gains_.position_p[i] * error + position_integral_[i];
      v = std::clamp(asked, -gains_.velocity_max[i], gains_.velocity_max[i]);
      if (dt > 0.0 && dt <= Pid::kGap_s && (asked - v) * error <= 0.0) {
        const double limit = gains_.position_integral_max[i];
        position_integral_[i] =
            std::clamp(position_integral_[i] + gains_.position_i[i] * error * dt, -limit, limit);
      }
    } else {
      v = std::clamp(v, -gains_.velocity_max[i], gains_.velocity_max[i]);
      position_integral_[i] = 0.0;
    }
    velocity_runs_[i] = true;
    output_.force_B[i] =
        std::clamp(velocity_[i].output(stamp_s, v, state.v_WB[i]), -gains_.force_max[i], gains_.force_max[i]);
  }
  if (std::isfinite(setpoint.yaw)) {
    control_attitude(Eigen::Quaterniond(Eigen::AngleAxisd(setpoint.yaw, Vector3d::UnitZ())), state);
    if (std::isfinite(setpoint.yaw_rate)) {
      output_.rate_B.z() =
          std::clamp(output_.rate_B.z() + setpoint.yaw_rate, -gains_.rate_max.z(), gains_.rate_max.z());
    }
  } else {
    output_.rate_B = {0.0, 0.0, setpoint.yaw_rate};
  }
}

void Cascade::control_attitude(const Eigen::Quaterniond& q_WB_setpoint, const CascadeState& state) {
  const Eigen::Quaterniond error = state.q_WB.conjugate() * q_WB_setpoint.normalized();
  // Both signs of a quaternion are the same attitude: the short way round.
  const Vector3d rate = gains_.attitude_p.cwiseProduct((error.w() < 0.0 ? -2.0 : 2.0) * error.vec());
  for (int i = 0; i < 3; ++i)
    output_.rate_B[i] = std::clamp(rate[i], -gains_.rate_max[i], gains_.rate_max[i]);
  if (!rate.allFinite()) output_.rate_B = kNotControlled;
}

void Cascade::control_rate(double stamp_s, const CascadeState& state) {
  for (int i = 0; i < 3; ++i) {
    if (!std::isfinite(output_.rate_B[i]) || !std::isfinite(state.w_WB_B[i])) continue;
    rate_runs_[i] = true;
    output_.torque_B[i] = rate_[i].output(stamp_s, output_.rate_B[i], state.w_WB_B[i]);
  }
}

// The planar part goes to the thrusters; what they cannot give is told to the loops that asked for it.
void Cascade::allocate(const Eigen::Matrix3d& R_WB) {
  for (int i = 0; i < 3; ++i) {
    if (!std::isfinite(output_.force_B[i])) output_.force_B[i] = 0.0;
    if (!std::isfinite(output_.torque_B[i])) output_.torque_B[i] = 0.0;
  }
  const BodyWrench wrench(output_.force_B.x(), output_.force_B.y(), output_.torque_B.z());
  allocator_.allocate_into(wrench, output_.allocation);
  const double scale = output_.allocation.scale;
  const Vector3d given_W = R_WB * Vector3d(scale * wrench[0], scale * wrench[1], 0.0);
  for (int i = 0; i < 3; ++i) {
    if (velocity_runs_[i]) velocity_[i].achieved(i < 2 ? given_W[i] : 0.0);
    if (rate_runs_[i]) rate_[i].achieved(i == 2 ? scale * wrench[2] : 0.0);
  }
}

}  // namespace atmos
