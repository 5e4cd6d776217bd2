// From screened hypotheses to fits: which are worth one, and the fits.
#pragma once

#include <string>
#include <vector>

#include "atmos_sim2real/search.h"

namespace atmos {

// As people read it: kind, thruster, law.
std::string label(const Hypothesis& hypothesis);

bool by_gain(const Tried& a, const Tried& b);

// Numbers that an effect takes; of a map so many, whatever its nodes, that one field is simpler than two.
std::size_t complexity(const Hypothesis& hypothesis);

// Neither a map nor a law without a name, nor what happened once or in one place.
bool is_plain(const Hypothesis& hypothesis);

// A plain effect of so few parameters stands before a map that has not much more evidence.
constexpr std::size_t kFew = 2;
constexpr double kNearly = 0.8;  // of the map's gain

// What replacing one fit by another at the same noise gains once the noise is fitted again, roughly: the
// level of each axis falls with what is left there. [nats]
double gain_to_expect(const Fit& before, const Fit& after);

// The best starts of the best hypotheses, and of those that are sure of a fit: maps if they are not hopeless,
// others once wherever something asks to be explained.
std::vector<Screened> shortlist(const std::vector<Screened>& scored, std::size_t most,
                                const SearchOptions& options);

// One screened hypothesis beside one model.
struct Attempt {
  const Fit* beside;
  const Screened* candidate;
  double least = 0.0;  // nats to expect, or it is not worth fitting further
};

// Fits the model with the hypothesis. The flights are smoothed under the model before and after.
Tried attempt(const Problem& problem, const Attempt& wanted, double looseness);

// All of them, side by side but for those that smooth the flights along their own way, or are large.
std::vector<Tried> attempts(const Problem& problem, const std::vector<Attempt>& wanted, double looseness);

}  // namespace atmos
