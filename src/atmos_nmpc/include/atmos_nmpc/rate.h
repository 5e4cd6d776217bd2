// The paper's body force and angular rate (ctl:rate) for a planar vehicle: the inputs are the force along
// body x and y and the rate about body z, which the flight controller's rate level carries out.
#pragma once

#include <memory>

#include "atmos_nmpc/config.h"
#include "atmos_nmpc/control_law.h"
#include "atmos_nmpc/multiple_shooting.h"
#include "atmos_nmpc/rate_step.h"

namespace atmos {

using RateProblem = MultipleShooting<RateStep>;
extern template class MultipleShooting<RateStep>;  // compiled once

RateProblem make_rate(const Vehicle& vehicle, const ControllerConfig& config);

std::unique_ptr<ControlLaw> make_rate_law(const Vehicle& vehicle, const ControllerConfig& config,
                                          Stopwatch stopwatch);

}  // namespace atmos
