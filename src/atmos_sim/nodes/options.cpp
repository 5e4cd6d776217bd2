#include "options.h"

#include <cmath>

#include "atmos_model_ros/node.h"

namespace atmos {

Options read_options(const ros::NodeHandle& node) {
  std::vector<ConfigFault> faults;
  const auto fault = [&](const char* key, const char* rule) {
    faults.push_back({node.getNamespace(), 0, key, rule});
  };
  // Keeps the default that is in `value` when the parameter is not set; a value of another type is a fault.
  const auto read = [&](const char* key, auto& value) {
    if (node.hasParam(key) && !node.getParam(key, value)) fault(key, "is of the wrong type");
  };
  Options options{load_fleet(required_parameter<std::string>(node, "scenario")), true, 1.0, 20.0, {}, ""};
  std::string clock = "lockstep";
  std::string wait_for;
  read("clock", clock);
  read("speed", options.speed);
  read("answer_limit_s", options.answer_limit_s);
  read("wait_for", wait_for);
  read("summary", options.summary);

  options.lockstep = clock == "lockstep";
  if (clock != "lockstep" && clock != "real") fault("clock", "must be one of lockstep, real");
  if (!(options.speed > 0.0) || std::isinf(options.speed)) fault("speed", "must be > 0");
  if (!(options.answer_limit_s > 0.0)) fault("answer_limit_s", "must be > 0");
  const Scenario& first = options.fleet.front();
  for (const Scenario& scenario : options.fleet) {
    if (scenario.vehicle.pwm.period_s != first.vehicle.pwm.period_s)
      faults.push_back({first.path, 0, "robots", "must all have the same pwm.period_s to fly together"});
  }
  const double frames_per_period = first.mocap.rate_hz * first.vehicle.pwm.period_s;
  if (options.lockstep && std::abs(frames_per_period - std::round(frames_per_period)) > 1e-6) {
    faults.push_back(
        {first.path, 0, "mocap.rate_hz",
         "must give a whole number of frames per PWM period in lockstep: the answer is waited for there"});
  }
  if (!faults.empty()) throw ConfigError(faults);
  options.wait_for = parse_connections(wait_for);
  return options;
}

}  // namespace atmos
