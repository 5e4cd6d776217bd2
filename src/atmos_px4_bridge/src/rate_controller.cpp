#include "atmos_px4_bridge/rate_controller.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "atmos_model/actuator_model.h"
#include "atmos_model/allocator.h"
#include "atmos_model/strict_yaml.h"

namespace atmos {

namespace {

constexpr double kFadeOut = 400.0 * M_PI / 180.0;  // rad/s: from this error on nothing is integrated (PX4)
constexpr double kTorqueResolution = 1e-6;         // N m

}  // namespace

FlightControllerConfig load_flight_controller(const std::string& path, const Vehicle& vehicle) {
  const ConfigFile file(path);
  const ConfigMap root = file.root().map("flight_controller"), map = root.map("rate");
  FlightControllerConfig config{};
  if (root.has("model")) {
    const std::string model = root.text("model");
    if (!root.faulty("model")) config.model = load_model(file.resolve(model), vehicle);
    try {
      Allocator{ActuatorModel(vehicle, config.model).vehicle()};
    } catch (const std::invalid_argument& error) {
      root.fault("model", error.what());
    }
  }
  config.rate.p_n_m_s = map.number("p_n_m_s", Bounds::positive());
  config.rate.i_n_m = map.number("i_n_m", Bounds::non_negative());
  config.rate.d_n_m_s2 = map.number("d_n_m_s2", Bounds::non_negative());
  config.rate.feed_forward_n_m_s = map.number("feed_forward_n_m_s", Bounds::non_negative());
  config.rate.integral_limit_n_m = map.number("integral_limit_n_m", Bounds::non_negative());
  file.check();
  return config;
}

double RateController::torque(double stamp_s, double rate_setpoint, const std::optional<double>& rate) {
  const double dt = last_stamp_ ? stamp_s - *last_stamp_ : 0.0;
  if (dt < 0.0 || dt > kGap_s) reset();
  dt_ = last_stamp_ ? dt : 0.0;
  last_stamp_ = stamp_s;
  if (!rate) {
    error_ = 0.0;
    last_rate_.reset();
    return asked_ = integral_;
  }
  error_ = rate_setpoint - *rate;
  const double acceleration = last_rate_ && dt_ > 0.0 ? (*rate - *last_rate_) / dt_ : 0.0;
  last_rate_ = rate;
  asked_ = gains_.p_n_m_s * error_ + integral_ - gains_.d_n_m_s2 * acceleration +
           gains_.feed_forward_n_m_s * rate_setpoint;
  return asked_;
}

void RateController::achieved(double torque) {
  const double missing = asked_ - torque;
  if (std::abs(missing) > kTorqueResolution && missing * error_ > 0.0) return;
  const double share = error_ / kFadeOut;
  const double fade = std::max(0.0, 1.0 - share * share);
  integral_ = std::clamp(integral_ + gains_.i_n_m * fade * error_ * dt_, -gains_.integral_limit_n_m,
                         gains_.integral_limit_n_m);
}

}  // namespace atmos
