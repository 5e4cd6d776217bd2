// What a diagnosis is worth: open-loop prediction errors of nominal and fitted model beside those that noise
// alone would cause.
#pragma once

#include <string>
#include <vector>

#include "atmos_sim2real/fit.h"
#include "atmos_sim2real/prediction.h"

namespace atmos {

constexpr const char* kHeldOut = "held-out";  // on what a proof is given
constexpr const char* kBlocks = "blocks";

struct HorizonProof {
  double horizon_s;
  PredictionError nominal, fitted, noise_floor;
};

// Windows of 5 s of one recording, for figures.
struct PredictedRecording {
  Recording recording;
  std::vector<PredictedPose> nominal, fitted;
};

struct Proof {
  std::string on;                      // kHeldOut or kBlocks
  std::vector<HorizonProof> horizons;  // 5, 1 and 10 s
  std::vector<PredictedRecording> predicted;
};

// On recordings that the fit has not seen.
Proof prove_held_out(const Problem& problem, const Fit& final, const std::vector<Recording>& held_out);

// Without such recordings: each flight is predicted by parameters refitted to the others or, when it is the
// only one, each half of it by parameters refitted to the other half. Which effects there are was chosen on
// all of them.
Proof prove_on_blocks(const Problem& problem, const Fit& final);

}  // namespace atmos
