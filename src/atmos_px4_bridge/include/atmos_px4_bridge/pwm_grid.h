// When the autopilot's PWM periods begin: its own reports of them, freed from the jitter of clock and line,
// so that period follows period without a gap.
#pragma once

#include <cmath>
#include <optional>

namespace atmos {

class PwmGrid {
 public:
  explicit PwmGrid(double period_s) : period_s_(period_s) {}

  // Start of the period that was reported to begin at `reported_s`, ROS seconds.
  double align(double reported_s) {
    const double periods = last_s_ ? std::round((reported_s - *last_s_) / period_s_) : 0.0;
    const double expected = last_s_ ? *last_s_ + periods * period_s_ : reported_s;
    const double error = reported_s - expected;
    const bool continues =
        last_s_ && periods >= 1.0 && periods <= kMostPeriods && std::abs(error) < kJump * period_s_;
    last_s_ = continues ? expected + kGain * error : reported_s;
    return *last_s_;
  }

 private:
  static constexpr double kGain = 0.05, kJump = 0.25, kMostPeriods = 20.0;
  double period_s_;
  std::optional<double> last_s_;
};

}  // namespace atmos
