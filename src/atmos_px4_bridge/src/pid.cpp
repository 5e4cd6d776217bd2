#include "atmos_px4_bridge/pid.h"

#include <algorithm>
#include <cmath>

namespace atmos {

namespace {

constexpr double kResolution = 1e-6;  // a smaller difference is none

}  // namespace

double Pid::output(double stamp_s, double setpoint, const std::optional<double>& measured) {
  const double dt = last_stamp_ ? stamp_s - *last_stamp_ : 0.0;
  if (dt < 0.0 || dt > kGap_s) reset();
  dt_ = last_stamp_ ? dt : 0.0;
  last_stamp_ = stamp_s;
  if (!measured) {
    error_ = 0.0;
    last_measured_.reset();
    return asked_ = integral_;
  }
  error_ = setpoint - *measured;
  const double slope = last_measured_ && dt_ > 0.0 ? (*measured - *last_measured_) / dt_ : 0.0;
  last_measured_ = measured;
  asked_ = gains_.p * error_ + integral_ - gains_.d * slope + gains_.feed_forward * setpoint;
  return asked_;
}

void Pid::achieved(double output) {
  const double missing = asked_ - output;
  if (std::abs(missing) > kResolution && missing * error_ > 0.0) return;
  const double share = error_ / fade_out_;
  const double fade = std::max(0.0, 1.0 - share * share);
  integral_ =
      std::clamp(integral_ + gains_.i * fade * error_ * dt_, -gains_.integral_limit, gains_.integral_limit);
}

}  // namespace atmos
