#include "atmos_sim2real/attempts.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "atmos_sim2real/floor_map.h"
#include "atmos_sim2real/map_prior.h"
#include "atmos_sim2real/onset.h"
#include "atmos_sim2real/patch.h"

namespace atmos {

std::string label(const Hypothesis& hypothesis) {
  return hypothesis.kind + (hypothesis.thruster > 0 ? " " + std::to_string(hypothesis.thruster) : "") +
         (hypothesis.law.empty() ? "" : " (" + hypothesis.law + ")");
}

bool by_gain(const Tried& a, const Tried& b) { return a.gain > b.gain; }

std::size_t complexity(const Hypothesis& hypothesis) {
  constexpr std::size_t kField = 1000;
  return hypothesis.map ? kField * hypothesis.starts.front().linear.size() : hypothesis.free.size();
}

bool is_plain(const Hypothesis& hypothesis) {
  return !hypothesis.map && !hypothesis.local && hypothesis.law.empty();
}

namespace {

// Where a fit of the current model with one screened hypothesis starts.
Fit with(const Fit& base, const Hypothesis& hypothesis, const Screened& at) {
  Fit extended;
  extended.effects = base.effects;
  extended.free = base.free;
  const std::size_t index = extended.effects.size();
  const Start& start = at.start;
  extended.effects.push_back(start.effect);
  for (const FreeParameter& free : at_effect(hypothesis.free, index)) extended.free.push_back(free);
  const std::vector<FreeParameter> linear = at_effect(named(hypothesis.free, start.linear), index);
  for (std::size_t p = 0; p < linear.size(); ++p)
    parameter(extended.effects, linear[p]) += at.amplitude[static_cast<Eigen::Index>(p)];
  return extended;
}

// Whether a fit at the present noise tells that nothing is to be gained: not of what is searched for after it
// (a map's prior, a disc, an onset), nor of laws that lie far from all their starts.
bool tells_at_once(const Hypothesis& hypothesis) {
  return !hypothesis.map && !hypothesis.local && !hypothesis.sure_of_a_fit && hypothesis.onsets == 0.0;
}

}  // namespace

double gain_to_expect(const Fit& before, const Fit& after) {
  double gain = 0.0;
  for (int axis = 0; axis < kAxes; ++axis) {
    double frames = 0.0, squares_before = 0.0, squares_after = 0.0;
    for (std::size_t f = 0; f < before.innovations.size(); ++f) {
      const Eigen::Index n = before.innovations[f].size() / kAxes;
      frames += static_cast<double>(n);
      squares_before += before.innovations[f].segment(axis * n, n).squaredNorm();
      squares_after += after.innovations[f].segment(axis * n, n).squaredNorm();
    }
    gain += 0.5 * frames * std::log(squares_before / squares_after);
  }
  return gain;
}

Tried attempt(const Problem& problem, const Attempt& wanted, double looseness) {
  const Fit& current = *wanted.beside;
  const Screened& candidate = *wanted.candidate;
  const Hypothesis& hypothesis = *candidate.hypothesis;
  const auto tried = [&](Fit fitted) {
    const double gain = fitted.evidence - current.evidence - choices_of(hypothesis);
    // Of the linearisation, which may be large, nothing is kept: it can be had again.
    fitted.linearisation.reset();
    return Tried{hypothesis, std::move(fitted),
                 std::isnan(gain) ? -std::numeric_limits<double>::infinity() : gain};
  };
  Fit fitted = with(current, hypothesis, candidate);
  clamp_to_bounds(fitted.effects, fitted.free);
  fitted.linearisation = current.linearisation;
  if (tells_at_once(hypothesis)) {
    Fit start = evaluate(problem, std::move(fitted.effects), std::move(fitted.free), current.noise);
    start.linearisation = std::move(fitted.linearisation);
    fitted = refine(problem, std::move(start), 4);
    if (!(fitted.evidence > current.evidence) || gain_to_expect(current, fitted) < wanted.least)
      return tried(std::move(fitted));
    fitted = with_noise_refitted(problem, std::move(fitted), FitEffort::kThorough);
  } else {
    fitted = fit(problem, std::move(fitted.effects), std::move(fitted.free), current.noise,
                 FitEffort::kThorough, std::move(fitted.linearisation));
  }
  if (std::holds_alternative<FrictionPatch>(fitted.effects.back())) {
    fitted = refine_patch(problem, std::move(fitted), fitted.effects.size() - 1, looseness);
    smooth_all(problem, current.effects, current.noise, looseness);
    fitted = fit(problem, fitted.effects, fitted.free, current.noise);
  }
  if (hypothesis.onsets > 0.0) {
    fitted = refine_onset(problem, std::move(fitted), current.effects.size());
    fitted = fit(problem, fitted.effects, fitted.free, fitted.noise);
  }
  if (over_the_floor(fitted.effects.back()))
    fitted = with_best_prior(problem, std::move(fitted), fitted.effects.size() - 1);
  if (!hypothesis.map) add_covariance(problem, fitted);
  return tried(std::move(fitted));
}

namespace {

// Bytes of the columns of a fit.
double size_of_columns(const Problem& problem, const Attempt& attempt) {
  double rows = 0.0;
  for (const Flight& flight : *problem.flights) rows += static_cast<double>(kAxes * flight.frames());
  return sizeof(double) * rows *
         static_cast<double>(attempt.beside->free.size() + attempt.candidate->hypothesis->free.size());
}

}  // namespace

std::vector<Tried> attempts(const Problem& problem, const std::vector<Attempt>& wanted, double looseness) {
  std::vector<Tried> tried(wanted.size());
  constexpr double kLarge = 100e6;  // bytes
  std::vector<std::size_t> alone, together;
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    const bool patch = std::holds_alternative<FrictionPatch>(wanted[i].candidate->start.effect);
    (patch || size_of_columns(problem, wanted[i]) > kLarge ? alone : together).push_back(i);
  }
  // What takes longest goes first.
  std::stable_sort(together.begin(), together.end(), [&](std::size_t a, std::size_t b) {
    return size_of_columns(problem, wanted[a]) > size_of_columns(problem, wanted[b]);
  });
  const auto make = [&](std::size_t i) { tried[i] = attempt(problem, wanted[i], looseness); };
  in_parallel(together.size(), [&](std::size_t k) { make(together[k]); });
  for (const std::size_t i : alone) make(i);
  return tried;
}

std::vector<Screened> shortlist(const std::vector<Screened>& scored, std::size_t most,
                                const SearchOptions& options) {
  constexpr double kMostGrowth = 5.0;  // from a screen to a fit, over that of the best
  std::vector<Screened> chosen;
  std::map<const Hypothesis*, std::size_t> taken;
  std::size_t kinds = 0;
  for (const Screened& candidate : scored) {
    std::size_t& starts = taken[candidate.hypothesis];
    const bool map = candidate.hypothesis->map;
    const bool sure = candidate.hypothesis->sure_of_a_fit;
    if (starts == 0 ? (kinds >= most && !sure) : starts >= 2) continue;
    // A map's Occam factor is paid with the misfit's noise here, which is unfair to it; but it must gain more
    // than a map of nothing would (three standard deviations of half a chi-square).
    const bool asked_for = sure && starts == 0 && scored.front().score > options.accept_gain;
    const bool hopeless = map ? candidate.gain < candidate.chance + 3.0 * std::sqrt(candidate.chance)
                              : candidate.score < 0.0 && !asked_for;
    // It is costly to fit, and has its turn when what towers over it is known.
    const bool outshone = map && kMostGrowth * candidate.gain < scored.front().score;
    if (hopeless || outshone) continue;
    if (starts == 0 && !sure) ++kinds;
    ++starts;
    chosen.push_back(candidate);
  }
  return chosen;
}

}  // namespace atmos
