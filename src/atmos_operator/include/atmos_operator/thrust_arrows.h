// Where to draw the thrust of each nozzle.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "atmos_model/vehicle.h"

namespace atmos {

// An arrow in body axes (FLU, from the geometric centre): along the force on the vehicle, its head at the
// nozzle, so that it covers the jet outside the body. With a negative duty (propellers) head and tail change
// places.
struct ThrustArrow {
  int thruster;                    // from 1, in vehicle-file order
  Eigen::Vector3d tail_B, head_B;  // m
};

// One arrow for every open valve; metres_per_newton scales duty * force. A command of the wrong size or a
// duty that is not finite gives no arrows.
std::vector<ThrustArrow> thrust_arrows(const Vehicle& vehicle, const std::vector<double>& duty,
                                       double metres_per_newton);

}  // namespace atmos
