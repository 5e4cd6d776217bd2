// How high noise alone would score: what the calibrated false-alarm rate rests on.
#pragma once

#include <cstdint>
#include <vector>

#include "atmos_sim2real/fit.h"

namespace atmos {

struct Screened;

// Innovations as the noise alone might have made them: those of a fit, in blocks of 6 s with random signs, so
// that what correlation the noise model misses stays in them.
struct NoiseAlone {
  struct Flips {
    std::vector<Eigen::Index> begins;  // of the blocks among the rows, and the end of the last
    Eigen::MatrixXd signs;             // a row per block, a column per draw
  };
  std::vector<Flips> flights;
};
NoiseAlone noise_alone(const Problem& problem, const Fit& fit, int draws, std::uint32_t seed);

// Probability that noise alone scores as high as the best hypothesis does, all hypotheses together: the
// largest scores of the draws have a Gumbel distribution.
double p_value(const std::vector<Screened>& scored);

}  // namespace atmos
