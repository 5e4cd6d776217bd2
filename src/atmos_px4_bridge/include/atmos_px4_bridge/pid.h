// One axis of a feedback loop with PX4's structure: the velocity and rate levels of the cascade, and the rate
// level of the flight controller.
#pragma once

#include <limits>
#include <optional>

namespace atmos {

// Units: those of the output over those of the controlled quantity, and seconds.
struct PidGains {
  double p;               // output per unit of error
  double i;               // output per unit of integrated error
  double d;               // output against the quantity's rate of change
  double feed_forward;    // output per unit of set-point
  double integral_limit;  // |integral part| <= this
};

// output = P e + I - D y' + FF y_sp (PX4, RateControl). The integral fades with large errors and stands still
// in the direction in which the output is saturated. Times are ROS seconds.
class Pid {
 public:
  static constexpr double kGap_s = 0.5;  // a longer pause: what was integrated belongs to another flight
  static constexpr double kRateFadeOut = 6.981317007977318;  // rad/s, 400 deg/s (PX4)

  // From an error of `fade_out` on nothing is integrated.
  explicit Pid(const PidGains& gains, double fade_out = kRateFadeOut) : gains_(gains), fade_out_(fade_out) {}

  // Output for the time from stamp_s on. `measured`: at that time; none: only what the integral holds, for
  // an output on a guess might drive the quantity ever further away.
  double output(double stamp_s, double setpoint, const std::optional<double>& measured);

  // What the actuators can give of the output asked for last; integrates accordingly.
  void achieved(double output);

  void reset() { integral_ = 0.0, last_stamp_.reset(), last_measured_.reset(); }
  double integral() const { return integral_; }

 private:
  PidGains gains_;
  double fade_out_;
  double integral_ = 0.0;
  std::optional<double> last_stamp_, last_measured_;
  double asked_ = 0.0, error_ = 0.0, dt_ = 0.0;  // of the last output()
};

}  // namespace atmos
