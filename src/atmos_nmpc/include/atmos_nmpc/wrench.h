// The paper's body force and torque (ctl:wrench) for a planar vehicle: the inputs are the force along body x
// and y and the torque about body z. The other three components of the paper's u are left out: no thruster
// gives them, and an input that nobody carries out must not be planned with.
#pragma once

#include <memory>

#include "atmos_nmpc/config.h"
#include "atmos_nmpc/control_law.h"
#include "atmos_nmpc/multiple_shooting.h"

namespace atmos {

using WrenchProblem = MultipleShooting<RigidBodyStep<3>>;
extern template class MultipleShooting<RigidBodyStep<3>>;  // compiled once

WrenchProblem make_wrench(const Vehicle& vehicle, const ControllerConfig& config);

std::unique_ptr<ControlLaw> make_wrench_law(const Vehicle& vehicle, const ControllerConfig& config,
                                            Stopwatch stopwatch);

}  // namespace atmos
