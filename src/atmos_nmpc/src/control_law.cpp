#include "atmos_nmpc/control_law.h"

#include <utility>

#include "atmos_nmpc/direct_allocation.h"
#include "atmos_nmpc/nmpc_law.h"
#include "atmos_nmpc/wrench.h"

namespace atmos {

std::unique_ptr<ControlLaw> make_control_law(const Vehicle& vehicle, const ControllerConfig& config,
                                             bool time_limit, Stopwatch stopwatch) {
  SolverOptions options = config.solver;
  if (!time_limit) options.time_limit_s.reset();

  if (config.formulation == FormulationKind::kWrench) {
    const auto actuate = [allocator = Allocator(vehicle), allocation = Allocation()](
                             const Eigen::Vector3d& wrench, ActuatorInput& result) mutable {
      allocator.allocate_into(wrench, allocation);
      result.wrench = wrench;
      result.duty = allocation.duty;
    };
    return std::make_unique<NmpcLaw<WrenchProblem>>(CommandLevel::kWrench, make_wrench(vehicle, config),
                                                    config, options, actuate, std::move(stopwatch));
  }
  const auto actuate = [vehicle, pairs = thruster_pairs(vehicle)](const Eigen::Vector4d& u,
                                                                  ActuatorInput& result) {
    result.wrench.setZero();
    duties_from_pairs(vehicle, pairs, u, result.duty);
  };
  return std::make_unique<NmpcLaw<DirectAllocation>>(CommandLevel::kThrusters,
                                                     make_direct_allocation(vehicle, config), config, options,
                                                     actuate, std::move(stopwatch));
}

}  // namespace atmos
