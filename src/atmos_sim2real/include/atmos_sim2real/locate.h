// Where a mismatch lies: along which axis, when, where on the floor, in which regime, in which recording.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "atmos_sim2real/fit.h"

namespace atmos {

// What every frame of every flight gains when one model is replaced by another.
struct FrameGains {
  enum Column { kWorldX, kWorldY, kInYaw, kForward, kLeft, kColumns };
  std::vector<Eigen::Matrix<double, Eigen::Dynamic, kColumns>> nats;  // per flight: frames x columns

  // Of all three axes.
  Eigen::VectorXd of_frames(std::size_t flight) const {
    return nats[flight].leftCols<kAxes>().rowwise().sum();
  }
  double along(Column column) const;
  double total() const { return along(kWorldX) + along(kWorldY) + along(kInYaw); }
};

// By the effects of `final` in place of the nominal ones, at the final noise.
FrameGains gains_of_effects(const Problem& problem, const Fit& nominal, const Fit& final);
// By the slow force of the final noise in place of an ordinary one, which may not be stronger.
FrameGains gains_of_slow_force(const Problem& problem, const Fit& final, const NoiseModel& ordinary);

// Shares of x, y and yaw in the gain; 0 where nothing is gained.
std::array<double, kAxes> axis_shares(const FrameGains& gains);

// One answer to "where": the share of the whole mismatch that lies there, and the one that would if it were
// spread evenly over time (or axes).
struct Place {
  std::string what;       // time, place, regime, recording or axis
  std::string statement;  // what completes "it lies ..."
  double share = 0.0, even_share = 0.0;
};

// "while thruster 3 fires (84 % of it; evenly spread 12 % would lie there)".
std::string text_of(const Place& place);

// Where the gain is concentrated beyond chance (3 standard deviations, and by 15 % of it), the most
// concentrated first, by relative entropy of its shares to even ones; at most one answer per question.
std::vector<Place> locate(const Problem& problem, const FrameGains& gains);

}  // namespace atmos
