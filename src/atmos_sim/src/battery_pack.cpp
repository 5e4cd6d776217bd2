#include "atmos_sim/battery_pack.h"

#include <algorithm>
#include <cmath>

namespace atmos {

void BatteryPack::draw(double activity, double dt_s) {
  activity_ = activity;
  charge_ah_ = std::max(0.0, charge_ah_ - reading().current_a * dt_s / 3600.0);
}

BatteryReading BatteryPack::reading() const {
  const double share = charge_ah_ / battery_.capacity_ah;
  const double open_v =
      battery_.cells * (battery_.empty_cell_v + share * (battery_.full_cell_v - battery_.empty_cell_v));
  // The current at which terminals deliver the load, P = (V - R I) I; beyond the pack's reach its greatest
  // power.
  const double load_w = battery_.idle_w + battery_.actuator_w * activity_;
  const double r = battery_.resistance_ohm;
  const double root = std::sqrt(std::max(0.0, open_v * open_v - 4.0 * r * load_w));
  const double current_a = 2.0 * load_w / (open_v + root);
  return {open_v - r * current_a, current_a, charge_ah_, share};
}

}  // namespace atmos
