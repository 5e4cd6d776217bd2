// Whether the motion answers the commands at all as the vehicle file says: before any effect is looked for.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "atmos_model/vehicle.h"
#include "atmos_sim2real/recording.h"

namespace atmos {

struct Response {
  // Of the motion with what the vehicle file predicts of it, means left out: correlation, and how much
  // stronger the motion is, of translation and of yaw.
  double correlation = 0.0;
  double strength = 1.0, yaw_strength = 1.0;
  // How far the motion stands out of the noise of the poses, as a ratio of variances.
  double above_noise = 0.0;
  // The shift of the poses against the commands at which the correlation is largest [s, positive: poses
  // late].
  double best_shift_s = 0.0;
  double best_correlation = 0.0;
  // Per thruster, body axes: acceleration when open [m/s^2, m/s^2, rad/s^2] as observed, its standard
  // deviation, and as the vehicle file says. Empty where nothing was observed.
  std::vector<Eigen::Vector3d> observed, deviation, stated;
};

// Out of second differences of the poses over 0.5 s: no noise level, no model of effects. Coarse, and robust
// against every effect of the vocabulary.
Response response(const Recording& recording, const Vehicle& vehicle);

// One sentence where no diagnosis should be tried: poses and commands that are seconds apart, or a vehicle
// whose thrusters push other ways or far more strongly or weakly than the file says. Empty otherwise.
std::string refusal(const Response& response);

}  // namespace atmos
