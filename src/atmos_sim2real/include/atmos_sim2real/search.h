// Which effects explain the flights: screen every hypothesis, fit the best jointly, keep what the evidence
// demands.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "atmos_sim2real/screen.h"

namespace atmos {

// An effect that was tried beside the current model.
struct Tried {
  Hypothesis hypothesis;
  Fit fit;            // the current model with it
  double gain = 0.0;  // evidence over the current model, nats
};

// An effect of the final model, with what speaks for it.
struct Claim {
  Hypothesis hypothesis;
  double gain = 0.0;               // evidence it adds to the rest of the final model, nats
  double heldout_gain = 0.0;       // nats on data its fit has not seen
  double inclusion = 0.0;          // share of resamples that keep it
  std::vector<Tried> rivals;       // tried in its place, best first
  double rival_reference = 0.0;    // the gain it had when they were tried
  double onset_deviation_s = 0.0;  // of since_s, where the effect has one
};

// Nats by which an explanation may fall short of one that gains so many and still be as good: the evidence is
// approximate, and the more so the larger it is.
double indistinct(double gain);

bool is_claimed(const std::vector<Claim>& claims, const Hypothesis& hypothesis);

struct SearchResult {
  Fit nominal;
  Fit final;
  std::vector<Claim> claims;    // one per effect of `final`, in the same order
  std::vector<Tried> rejected;  // tried beside the final model and not accepted, best first
  std::optional<double>
      p_value_of_screen;  // of the best hypothesis beside the nominal model, under its noise alone
};

struct SearchOptions {
  double accept_gain = 12.0;           // nats of evidence a further effect must bring
  double accept_gain_of_local = 20.0;  // the same of what unseen data cannot contradict
  double accept_gain_of_map = 40.0;    // the same of a map, which takes in any slow force a little
  double plain_gain =
      20.0;  // above it, an effect of few parameters is named however little it moves the robot
  double least_inclusion = 0.8;
  std::size_t most_effects = 8;
  std::size_t fitted_per_step = 6;
  std::uint32_t seed = 1;  // of the resampling
  std::function<void(const std::string&)> progress = [](const std::string&) {};

  double needed(const Hypothesis& hypothesis) const;  // nats
};

// Smooths the flights as it goes: their velocities are those under the final model afterwards.
SearchResult search(const Problem& problem, const std::vector<Hypothesis>& library,
                    const SearchOptions& options);

}  // namespace atmos
