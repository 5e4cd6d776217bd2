// Compressed air: what is left in the bottles and at which pressures, out of the one gas state of the
// effects.
#pragma once

#include "atmos_model/scenario.h"

namespace atmos {

struct AirReading {
  double gas_used_kg;
  double gas_remaining_kg;  // above the pressure at which thrusters and bearings fail
  double bottle_bar;
  double thruster_bar;  // behind their regulator; 0 once inoperable
  double bearing_bar;
  bool operable;
};

// `gas_used_kg` since the bottles were filled. Pressure falls with the air in the open bottles (isothermal);
// a tethered robot takes none of it.
AirReading read_air(const Pneumatics& pneumatics, const SupplySettings& settings, double gas_used_kg);

}  // namespace atmos
