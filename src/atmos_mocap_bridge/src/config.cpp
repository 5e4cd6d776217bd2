#include "atmos_mocap_bridge/config.h"

#include "atmos_model/strict_yaml.h"

namespace atmos {

namespace {

AccelerationNoise read_noise(const ConfigMap& map) {
  return {map.number("acceleration_m_s2", Bounds::positive()),
          map.number("angular_acceleration_rad_s2", Bounds::positive())};
}

}  // namespace

MocapConfig load_mocap_config(const std::string& path) {
  const ConfigFile file(path);
  const ConfigMap root = file.root();
  MocapConfig config;
  config.robot = root.text("robot", "");

  const ConfigMap measurement = root.map("measurement");
  config.position_noise_m = measurement.number("position_noise_m", Bounds::positive());
  config.attitude_noise_rad = measurement.number("attitude_noise_rad", Bounds::positive());

  const ConfigMap process = root.map("process");
  config.correlation_s = process.number("correlation_s", Bounds::positive());
  config.thrust_error = process.number("thrust_error", Bounds::between(0.0, 1.0));
  config.known_input = read_noise(process.map("known_input"));
  config.unknown_input = read_noise(process.map("unknown_input"));

  const ConfigMap initial = root.map("initial");
  config.initial_velocity_m_s = initial.number("velocity_m_s", Bounds::positive());
  config.initial_angular_velocity_rad_s = initial.number("angular_velocity_rad_s", Bounds::positive());

  const ConfigMap gate = root.map("gate");
  config.nis_gate = gate.number("nis", Bounds::positive());
  config.reinitialise_after = gate.integer("reinitialise_after", 1, 1000);
  config.coast_s = root.number("coast_s", Bounds::between(0.0, 10.0));
  config.forget_s = root.number("forget_s", Bounds::between(0.0, 10.0));
  if (!root.faulty("coast_s") && !root.faulty("forget_s") && config.forget_s < config.coast_s)
    root.fault("forget_s", "must not be shorter than coast_s");
  file.check();
  return config;
}

}  // namespace atmos
