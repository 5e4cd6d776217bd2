// The rate level of the flight controller: PX4's rate loop about body z, run once per PWM period.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "atmos_model/effects.h"
#include "atmos_model/vehicle.h"

namespace atmos {

struct RateGains {
  double p_n_m_s;             // torque per rad/s of error
  double i_n_m;               // torque per rad of integrated error
  double d_n_m_s2;            // torque against rad/s^2
  double feed_forward_n_m_s;  // torque per rad/s of set-point
  double integral_limit_n_m;  // |integral part| <= this
};

// What a flight controller file sets (config/flight_controller/*.yaml).
struct FlightControllerConfig {
  RateGains rate;
  std::vector<Effect> model{};  // what a model.yaml adds to the vehicle; empty: the nominal one
};

// Reads a flight controller file for a vehicle, and the model file it names. Throws ConfigError with every
// fault.
FlightControllerConfig load_flight_controller(const std::string& path, const Vehicle& vehicle);

// torque = P e + I - D w' + FF w_sp (PX4, RateControl). The integral fades with large errors and stands still
// in the direction in which the thrusters are saturated. Times are ROS seconds.
class RateController {
 public:
  static constexpr double kGap_s = 0.5;  // a longer pause: what was integrated belongs to another flight

  explicit RateController(const RateGains& gains) : gains_(gains) {}

  // Torque [N m] for the period that starts at stamp_s. `rate`: measured at that time [rad/s]; none: only
  // what the integral holds, for a torque on a guessed rate might turn the robot ever faster.
  double torque(double stamp_s, double rate_setpoint, const std::optional<double>& rate);

  // What the thrusters can give of the torque asked for last; integrates accordingly.
  void achieved(double torque);

  void reset() { integral_ = 0.0, last_stamp_.reset(), last_rate_.reset(); }
  double integral() const { return integral_; }

 private:
  RateGains gains_;
  double integral_ = 0.0;
  std::optional<double> last_stamp_, last_rate_;
  double asked_ = 0.0, error_ = 0.0, dt_ = 0.0;  // of the last torque()
};

}  // namespace atmos
