#include "atmos_sim/air_supply.h"

#include <algorithm>

namespace atmos {

AirReading read_air(const Pneumatics& pneumatics, const SupplySettings& settings, double gas_used_kg) {
  const double full_kg = settings.open_bottles * pneumatics.bottle_kg;
  const double share_needed = pneumatics.inoperable_below_bar / pneumatics.fill_bar;
  AirReading air{};
  air.gas_used_kg = gas_used_kg;
  air.gas_remaining_kg = std::max(0.0, full_kg * (1.0 - share_needed) - gas_used_kg);
  air.bottle_bar = pneumatics.fill_bar * std::max(0.0, 1.0 - gas_used_kg / full_kg);
  air.operable = settings.tethered || air.gas_remaining_kg > 0.0;
  if (air.operable) {
    // The low-pressure hose enters behind the bottles' regulators.
    const double manifold_bar =
        settings.tethered ? pneumatics.manifold_bar : std::min(air.bottle_bar, pneumatics.manifold_bar);
    air.thruster_bar = std::min(manifold_bar, pneumatics.thruster_bar);
    air.bearing_bar = std::min(manifold_bar, pneumatics.bearing_bar);
  }
  return air;
}

}  // namespace atmos
