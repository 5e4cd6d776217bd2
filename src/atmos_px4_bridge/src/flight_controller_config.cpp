#include "atmos_px4_bridge/flight_controller_config.h"

#include <stdexcept>

#include "atmos_model/actuator_model.h"
#include "atmos_model/allocator.h"
#include "atmos_model/strict_yaml.h"

namespace atmos {

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
  config.rate.p = map.number("p_n_m_s", Bounds::positive());
  config.rate.i = map.number("i_n_m", Bounds::non_negative());
  config.rate.d = map.number("d_n_m_s2", Bounds::non_negative());
  config.rate.feed_forward = map.number("feed_forward_n_m_s", Bounds::non_negative());
  config.rate.integral_limit = map.number("integral_limit_n_m", Bounds::non_negative());
  file.check();
  return config;
}

}  // namespace atmos
