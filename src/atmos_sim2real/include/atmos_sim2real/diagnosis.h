// The whole diagnosis of a set of flights: detect, locate, name, fit, and say what cannot be told apart.
#pragma once

#include <array>
#include <map>
#include <string>
#include <vector>

#include "atmos_sim2real/detectability.h"
#include "atmos_sim2real/locate.h"
#include "atmos_sim2real/placebo.h"
#include "atmos_sim2real/proof.h"

namespace atmos {

enum class Verdict { kConsistent, kExplained, kPartlyExplained, kUnexplained };
// "consistent", "explained", "partly_explained", "unexplained".
std::string text_of(Verdict verdict);

struct Diagnosis {
  Verdict verdict = Verdict::kConsistent;
  double p_value = 1.0;                           // of the nominal model, over all hypotheses together
  std::array<double, kAxes> axis_share{0, 0, 0};  // of the mismatch
  std::vector<Place> where;                       // the most concentrated first
  std::map<std::string, Detectable> smallest_detectable;  // by kind
  SearchResult search;
  std::vector<std::vector<std::string>>
      indistinguishable;         // per claim: kinds that these flights cannot separate from it
  std::vector<Placebo> placebo;  // per claim
  double unexplained_acceleration_rms =
      0.0;  // m/s^2, slow force that no effect of the final model accounts for
  std::string unexplained_where;
};

// Diagnoses flights of one vehicle; `known` effects count as part of the nominal model. The flights are
// smoothed under the final model afterwards.
Diagnosis diagnose(const Vehicle& vehicle, const std::vector<Effect>& known, std::vector<Flight>& flights,
                   const SearchOptions& options);

// What does not carry over to recordings that the fit has not seen explains no more than a part.
void judge_by(const Proof& proof, Diagnosis& diagnosis);

}  // namespace atmos
