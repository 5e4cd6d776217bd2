#include "atmos_nmpc/control_law.h"

#include <utility>

#include "atmos_nmpc/direct_allocation.h"
#include "atmos_nmpc/linear_law.h"
#include "atmos_nmpc/rate.h"
#include "atmos_nmpc/wrench.h"

namespace atmos {

std::unique_ptr<ControlLaw> make_control_law(const Vehicle& vehicle, const ControllerConfig& config,
                                             bool time_limit, Stopwatch stopwatch) {
  ControllerConfig limited = config;
  if (!time_limit) limited.solver.time_limit_s.reset();
  switch (config.formulation) {
    case FormulationKind::kDirectAllocation:
      return make_direct_allocation_law(vehicle, limited, std::move(stopwatch));
    case FormulationKind::kWrench:
      return make_wrench_law(vehicle, limited, std::move(stopwatch));
    case FormulationKind::kRate:
      return make_rate_law(vehicle, limited, std::move(stopwatch));
    case FormulationKind::kLqr:
    case FormulationKind::kPd:
      break;
  }
  return std::make_unique<LinearLaw>(vehicle, config);
}

}  // namespace atmos
