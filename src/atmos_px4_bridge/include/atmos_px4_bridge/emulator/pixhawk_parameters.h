// Parameters of the emulated autopilot, under PX4's names and with PX4's meaning.
#pragma once

#include <map>
#include <string>

#include "atmos_px4_bridge/cascade.h"

namespace atmos {

class PixhawkParameters {
 public:
  // PX4's defaults of the spacecraft airframe.
  PixhawkParameters();
  // Defaults changed by a file (config/px4/pixhawk.yaml). Throws ConfigError with every fault.
  static PixhawkParameters load(const std::string& path);

  bool has(const std::string& name) const { return values_.count(name) > 0; }
  double operator[](const std::string& name) const { return values_.at(name); }
  // False for a name that is not known.
  bool set(const std::string& name, double value);
  static bool is_whole(const std::string& name);
  std::size_t size() const { return values_.size(); }

  // The cascade's gains, normalised.
  CascadeGains gains() const;

 private:
  std::map<std::string, double> values_;
};

}  // namespace atmos
