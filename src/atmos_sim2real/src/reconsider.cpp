#include "atmos_sim2real/reconsider.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <optional>
#include <utility>

#include "atmos_sim2real/attempts.h"
#include "atmos_sim2real/force_field.h"
#include "atmos_sim2real/settle.h"
#include "atmos_sim2real/simpler_form.h"

namespace atmos {

bool blows_as_slopes(const Effect& effect, double gain, double gain_of_floor) {
  constexpr double kNoCurl = 0.1, kNearlyItsGain = 0.85;  // of its variation; of the wind's gain
  const auto* wind = std::get_if<Airflow>(&effect);
  return wind != nullptr && share_with_curl(*wind) < kNoCurl && gain_of_floor > kNearlyItsGain * gain;
}

std::vector<Hypothesis> unclaimed(const std::vector<Hypothesis>& all, const std::vector<Claim>& claims) {
  std::vector<Hypothesis> open;
  for (const Hypothesis& hypothesis : all) {
    if (!is_claimed(claims, hypothesis)) open.push_back(hypothesis);
  }
  return open;
}

bool holds_on_unseen_data(const Hypothesis& hypothesis, const BlockEvidence& blocks,
                          const SearchOptions& options) {
  return hypothesis.local || (blocks.heldout_gain > 0.0 && blocks.inclusion >= options.least_inclusion);
}

namespace {

// The model without effect `index`, refitted.
Fit without(const Problem& problem, Fit rest, std::size_t index) {
  rest.linearisation.reset();
  rest.take_out(index);
  return fit(problem, std::move(rest.effects), std::move(rest.free), rest.noise, FitEffort::kQuick);
}

// Whether an effect is so many deviations away from its absence that a refit without it need not be asked.
bool plainly_there(const Fit& fit, std::size_t index) {
  constexpr double kPlain = 10.0;  // deviations: 50 nats
  const Effect& effect = fit.effects[index];
  // Of these not every number is a size: a time or a place is away from its prior's mean anyway.
  if (std::holds_alternative<Tether>(effect) || std::holds_alternative<FrictionPatch>(effect) ||
      std::holds_alternative<Slosh>(effect) || std::holds_alternative<FloorVibration>(effect) ||
      std::holds_alternative<SupplyDroop>(effect) || std::holds_alternative<Unmodelled>(effect))
    return false;
  for (std::size_t p = 0; p < fit.free.size(); ++p) {
    const FreeParameter& free = fit.free[p];
    if (free.effect != index || free.joint != nullptr) continue;
    const auto at = static_cast<Eigen::Index>(p);
    if (std::abs(parameter(fit.effects, free) - free.prior_mean) > kPlain * std::sqrt(fit.covariance(at, at)))
      return true;
  }
  return false;
}

}  // namespace

std::vector<Fit> leave_one_out(const Problem& problem, const Fit& current, const Fit& nominal) {
  std::vector<Fit> fits;
  if (current.effects.size() == 1) {
    NoiseModel noise = nominal.noise;
    noise.joins_pulses = current.noise.joins_pulses;
    fits.push_back(fit(problem, nominal.effects, {}, noise, FitEffort::kQuick));
    return fits;
  }
  for (std::size_t i = 0; i < current.effects.size(); ++i) fits.push_back(without(problem, current, i));
  return fits;
}

bool drop_needless(const Problem& problem, Fit& current, std::vector<Claim>& claims,
                   std::vector<Claim>& refused, double looseness, const SearchOptions& options) {
  bool dropped = false;
  for (std::size_t i = 0; i + 1 < claims.size();) {
    if (current.covariance.size() == 0) add_covariance(problem, current);
    if (plainly_there(current, i)) {
      ++i;
      continue;
    }
    Fit reduced = without(problem, current, i);
    const double worth = current.evidence - reduced.evidence - choices_of(claims[i].hypothesis);
    if (worth >= options.needed(claims[i].hypothesis)) {
      ++i;
      continue;
    }
    const Hypothesis& newest = claims.back().hypothesis;
    Fit as_before = without(problem, current, claims.size() - 1);
    const bool newest_goes =
        as_before.evidence - choices_of(claims[i].hypothesis) > reduced.evidence - choices_of(newest);
    options.progress("dropped " + label(newest_goes ? newest : claims[i].hypothesis));
    dropped = true;
    if (newest_goes) {
      refused.push_back(std::move(claims.back()));
      claims.pop_back();
      current = settled(problem, std::move(as_before), looseness);
    } else {
      current = std::move(reduced);
      claims.erase(claims.begin() + static_cast<long>(i));
    }
  }
  return dropped;
}

namespace {

// What took an effect's place is the last of its fit; the claim goes there too.
void move_to_end(std::vector<Claim>& claims, std::size_t index) {
  const auto claim = claims.begin() + static_cast<long>(index);
  std::rotate(claim, claim + 1, claims.end());
}

// The same fit with one effect as the last, as fits of candidates have theirs.
Fit with_last(Fit fit, std::size_t index) {
  const auto effect = fit.effects.begin() + static_cast<long>(index);
  std::rotate(effect, effect + 1, fit.effects.end());
  for (FreeParameter& free : fit.free) {
    if (free.effect == index)
      free.effect = fit.effects.size() - 1;
    else if (free.effect > index)
      --free.effect;
  }
  fit.linearisation.reset();
  return fit;
}

}  // namespace

bool simplify(const Problem& problem, const std::vector<Hypothesis>& library, Fit& current,
              std::vector<Claim>& claims, const SearchOptions& options) {
  const std::vector<Hypothesis> open = unclaimed(library, claims);
  bool renamed = false;
  for (std::size_t i = 0; i < claims.size();) {
    std::optional<SimplerForm> form = simpler_form(problem, current, i, claims[i].hypothesis, open);
    if (!form) {
      ++i;
      continue;
    }
    options.progress("  " + label(form->hypothesis) + " says the same as " + label(claims[i].hypothesis));
    current = std::move(form->fit);
    claims[i].hypothesis = std::move(form->hypothesis);
    claims[i].rival_reference += form->gain;
    move_to_end(claims, i);
    renamed = true;
  }
  return renamed;
}

bool reconsider(const Problem& problem, Fit& current, std::vector<Claim>& claims, const Screening& screening,
                const std::vector<Fit>& without_each, double looseness, const SearchOptions& options) {
  constexpr double kClearlyBetter = 3.0;               // nats
  constexpr double kLeastShare = 0.7, kLeeway = 10.0;  // of the claim's gain; nats
  constexpr std::size_t kRivals = 3;
  std::vector<std::vector<Screened>> promising;  // per claim
  for (std::size_t i = 0; i < claims.size(); ++i) {
    // Screens shrink differences, but not to less than half.
    promising.push_back(shortlist(screening.in_place_of(i), kRivals, options));
    const double least = 0.5 * (screening.worth(i) - choices_of(claims[i].hypothesis));
    promising.back().erase(std::remove_if(promising.back().begin(), promising.back().end(),
                                          [&](const Screened& rival) { return rival.score < least; }),
                           promising.back().end());
  }
  std::vector<Attempt> wanted;
  for (std::size_t i = 0; i < claims.size(); ++i) {
    const Fit& rest = without_each[i];
    const Fit claimed = evaluate(problem, current.effects, {}, rest.noise);
    const double least = kLeastShare * gain_to_expect(rest, claimed) - kLeeway;
    for (const Screened& rival : promising[i]) wanted.push_back({&rest, &rival, least});
  }
  std::vector<Tried> tried = attempts(problem, wanted, looseness);
  auto next = tried.begin();
  for (std::size_t i = 0; i < claims.size(); ++i) {
    Claim& claim = claims[i];
    const auto end = next + static_cast<long>(promising[i].size());
    claim.rivals.assign(std::make_move_iterator(next), std::make_move_iterator(end));
    next = end;
    claim.rival_reference = current.evidence - without_each[i].evidence - choices_of(claim.hypothesis);
    std::sort(claim.rivals.begin(), claim.rivals.end(), by_gain);
  }
  for (std::size_t i = 0; i < claims.size(); ++i) {
    Claim& claim = claims[i];
    const auto named = std::find_if(claim.rivals.begin(), claim.rivals.end(),
                                    [](const Tried& tried) { return tried.hypothesis.law.empty(); });
    const double best_named =
        named == claim.rivals.end() ? claim.rival_reference : std::max(claim.rival_reference, named->gain);
    const auto rival = std::find_if(claim.rivals.begin(), claim.rivals.end(), [&](const Tried& tried) {
      // What has no name is asked for by what no name explains.
      const double reference = tried.hypothesis.law.empty() ? claim.rival_reference : best_named;
      const bool floor = tried.hypothesis.kind == FloorUnevenness::kKind;
      if (floor && blows_as_slopes(current.effects[i], claim.rival_reference, tried.gain)) return true;
      const bool imitates = tried.hypothesis.map && complexity(claim.hypothesis) <= kFew &&
                            claim.rival_reference > kNearly * tried.gain;
      const bool slopes = claim.hypothesis.kind == FloorUnevenness::kKind &&
                          blows_as_slopes(tried.fit.effects.back(), tried.gain, claim.rival_reference);
      const bool stranger = is_plain(claim.hypothesis) && !is_plain(tried.hypothesis);
      const double better = stranger ? indistinct(reference) : kClearlyBetter;
      return tried.gain > reference + better && !imitates && !slopes;
    });
    if (rival == claim.rivals.end()) continue;
    const std::size_t last = rival->fit.effects.size() - 1;
    const BlockEvidence blocks = block_evidence(problem, without_each[i], rival->fit, last, options.seed);
    if (!holds_on_unseen_data(rival->hypothesis, blocks, options)) {
      options.progress("  " + label(rival->hypothesis) + " " + kDoesNotHold);
      continue;
    }
    options.progress("  " + label(rival->hypothesis) + " takes the place of " + label(claim.hypothesis));
    Tried better = std::exchange(*rival, {claim.hypothesis, with_last(current, i), claim.rival_reference});
    claim.hypothesis = better.hypothesis;
    claim.gain = claim.rival_reference = better.gain;
    current = std::move(better.fit);
    move_to_end(claims, i);
    return true;
  }
  return false;
}

namespace {

// What a model is worth, for models with other effects.
double evidence_of(const Fit& fit, const std::vector<Claim>& claims) {
  double nats = fit.evidence;
  for (const Claim& claim : claims) nats -= choices_of(claim.hypothesis);
  return nats;
}

bool are_inseparable(const std::string& a, const std::string& b) {
  return std::any_of(inseparable().begin(), inseparable().end(), [&](const std::vector<std::string>& set) {
    const auto in_set = [&](const std::string& kind) {
      return std::find(set.begin(), set.end(), kind) != set.end();
    };
    return in_set(a) && in_set(b);
  });
}

// A rival of one claim.
struct Swap {
  std::size_t claim;
  const Tried* rival;
  double behind;  // nats
};

// The nearest plain rivals of all claims, whose own lists have the best first.
std::vector<Swap> nearest_rivals(const std::vector<Claim>& claims, std::size_t most) {
  constexpr double kShare = 0.5;  // of the claim's gain that a rival must reach
  std::vector<Swap> swaps;
  for (std::size_t i = 0; i < claims.size(); ++i) {
    for (const Tried& rival : claims[i].rivals) {
      const bool other = is_plain(rival.hypothesis) &&
                         !same_subject(rival.hypothesis, claims[i].hypothesis) &&
                         !are_inseparable(rival.hypothesis.kind, claims[i].hypothesis.kind);
      const bool another_start = std::any_of(swaps.begin(), swaps.end(), [&](const Swap& swap) {
        return swap.claim == i && same_subject(swap.rival->hypothesis, rival.hypothesis);
      });
      if (other && !another_start && rival.gain > kShare * claims[i].rival_reference)
        swaps.push_back({i, &rival, claims[i].rival_reference - rival.gain});
    }
  }
  std::sort(swaps.begin(), swaps.end(), [](const Swap& a, const Swap& b) { return a.behind < b.behind; });
  swaps.resize(std::min(swaps.size(), most));
  return swaps;
}

}  // namespace

bool reconsider_together(const Problem& problem, const std::vector<Hypothesis>& library, const Fit& nominal,
                         Fit& current, std::vector<Claim>& claims, double looseness,
                         const SearchOptions& options) {
  constexpr double kClearlyBetter = 3.0;  // nats
  constexpr std::size_t kMost = 3;
  if (claims.size() < 2) return false;
  for (const Swap& swap : nearest_rivals(claims, kMost)) {
    Fit other = swap.rival->fit;
    std::vector<Claim> others = claims;
    others[swap.claim].hypothesis = swap.rival->hypothesis;
    move_to_end(others, swap.claim);
    std::vector<Hypothesis> open = unclaimed(library, others);
    open.erase(std::remove_if(open.begin(), open.end(), std::not_fn(is_plain)), open.end());
    const Screening screening(problem, other, open);
    const std::vector<Fit> without_each = leave_one_out(problem, other, nominal);
    options.progress("  with " + label(swap.rival->hypothesis) + " in place of " +
                     label(claims[swap.claim].hypothesis) + ":");
    if (!reconsider(problem, other, others, screening, without_each, looseness, options)) continue;
    if (evidence_of(other, others) < evidence_of(current, claims) + kClearlyBetter) continue;
    options.progress("  which explains more");
    current = std::move(other);
    claims = std::move(others);
    return true;
  }
  return false;
}

}  // namespace atmos
