// The battery under the load of computers and actuators.
#pragma once

#include "atmos_model/vehicle.h"

namespace atmos {

struct BatteryReading {
  double voltage_v;  // at the terminals
  double current_a;  // > 0: discharging
  double charge_ah;  // left
  double share;      // of the capacity, [0, 1]
};

// Open-circuit voltage falls linearly with the charge; a resistance in series.
class BatteryPack {
 public:
  explicit BatteryPack(const Battery& battery)
      : battery_(battery), charge_ah_(battery.capacity_ah), activity_(0.0) {}

  // Draws the power of `dt_s` seconds with actuators at `activity`: the sum over valves of their opening, or
  // over propellers of |thrust / full thrust|^1.5.
  void draw(double activity, double dt_s);
  BatteryReading reading() const;

 private:
  Battery battery_;
  double charge_ah_;
  double activity_;  // of the last draw
};

}  // namespace atmos
