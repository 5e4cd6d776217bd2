// The flight that would tell a claim from its nearest rival, chosen by flying each manoeuvre in the
// simulator.
#pragma once

#include <optional>
#include <string>

#include "atmos_sim2real/diagnosis.h"
#include "atmos_sim2real/experiment.h"

namespace atmos {

struct NextExperiment {
  std::size_t claim;  // index into the claims
  std::string rival;  // its kind
  Manoeuvre manoeuvre;
  double expected_nats;
};

// For the claim whose nearest rival of another kind these flights cannot separate from it; none where there
// is no such claim. The simulated robot is the one that the claims describe. Throws std::runtime_error when
// the simulator fails; `folder` takes the files that the child reads and writes, which are removed.
std::optional<NextExperiment> next_experiment(const Diagnosis& diagnosis, const Problem& problem,
                                              const std::string& vehicle_path, const std::string& folder);

}  // namespace atmos
