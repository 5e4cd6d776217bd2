#include "atmos_sim2real/search.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "atmos_sim2real/crossvalidation.h"
#include "atmos_sim2real/discover.h"
#include "atmos_sim2real/floor_map.h"
#include "atmos_sim2real/force_field.h"
#include "atmos_sim2real/map_prior.h"
#include "atmos_sim2real/merge.h"
#include "atmos_sim2real/onset.h"
#include "atmos_sim2real/patch.h"
#include "atmos_sim2real/simpler_form.h"

namespace atmos {

double indistinct(double gain) { return std::clamp(0.05 * gain, 3.0, 10.0); }

double SearchOptions::needed(const Hypothesis& hypothesis) const {
  if (hypothesis.map) return accept_gain_of_map;
  return hypothesis.local ? accept_gain_of_local : accept_gain;
}

bool is_claimed(const std::vector<Claim>& claims, const Hypothesis& hypothesis) {
  return std::any_of(claims.begin(), claims.end(),
                     [&](const Claim& claim) { return same_subject(claim.hypothesis, hypothesis); });
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

// What replacing one fit by another at the same noise gains once the noise is fitted again, roughly: the
// level of each axis falls with what is left there. [nats]
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

// One screened hypothesis beside one model.
struct Attempt {
  const Fit* beside;
  const Screened* candidate;
  double least = 0.0;  // nats to expect, or it is not worth fitting further
};

// Fits the model with the hypothesis. The flights are smoothed under the model before and after.
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

// Bytes of the columns of a fit.
double size_of_columns(const Problem& problem, const Attempt& attempt) {
  double rows = 0.0;
  for (const Flight& flight : *problem.flights) rows += static_cast<double>(kAxes * flight.frames());
  return sizeof(double) * rows *
         static_cast<double>(attempt.beside->free.size() + attempt.candidate->hypothesis->free.size());
}

// All of them, side by side but for those that smooth the flights along their own way, or are large.
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

// How far open-loop motion over 5 s strays from the recording when it starts on the smoothed motion: root
// mean square of position [m] and of yaw [rad]. Quick enough to judge every candidate by.
struct OpenLoopError {
  double position_m;
  double yaw_rad;
};

OpenLoopError open_loop_error(const Problem& problem, const std::vector<Effect>& effects) {
  constexpr double kHorizon = 5.0, kEvery = 1.0;
  double squares[kAxes] = {0, 0, 0};
  double windows = 0.0;
  for (std::size_t f = 0; f < problem.flights->size(); ++f) {
    const Flight& flight = (*problem.flights)[f];
    const Plant plant = problem.plant(effects, f);
    const ForceIntegrals forces = flight.integrate(plant);
    const std::vector<double>& t = flight.times();
    for (std::size_t begin = 0, end = 0; begin < t.size(); ++begin) {
      if (begin > 0 && std::floor(t[begin] / kEvery) == std::floor(t[begin - 1] / kEvery)) continue;
      while (end < t.size() && t[end] < t[begin] + kHorizon) ++end;
      if (end == t.size()) break;
      const PlanarState<double> start = plant.from_measured(flight.motion()[begin]);
      const double p0[kAxes] = {start.p_WC.x(), start.p_WC.y(), start.yaw};
      const double v0[kAxes] = {start.v_WC.x(), start.v_WC.y(), start.yaw_rate};
      for (int axis = 0; axis < kAxes; ++axis) {
        double p = p0[axis], v = v0[axis];
        for (std::size_t i = begin; i < end; ++i) {
          p += v * (t[i + 1] - t[i]) + forces.dp[static_cast<std::size_t>(axis)][i];
          v += forces.dv[static_cast<std::size_t>(axis)][i];
        }
        const double error = p - forces.measured[static_cast<std::size_t>(axis)][end];
        squares[axis] += error * error;
      }
      windows += 1.0;
    }
  }
  windows = std::max(windows, 1.0);
  return {std::sqrt((squares[kX] + squares[kY]) / windows), std::sqrt(squares[kYaw] / windows)};
}

// Whether going from `before` to `after` wins back a share of what the nominal model gets wrong.
bool wins_back(double share, const OpenLoopError& nominal, const OpenLoopError& before,
               const OpenLoopError& after) {
  return before.position_m - after.position_m > share * nominal.position_m ||
         before.yaw_rad - after.yaw_rad > share * nominal.yaw_rad;
}

std::string label(const Hypothesis& hypothesis) {
  return hypothesis.kind + (hypothesis.thruster > 0 ? " " + std::to_string(hypothesis.thruster) : "") +
         (hypothesis.law.empty() ? "" : " (" + hypothesis.law + ")");
}

bool by_gain(const Tried& a, const Tried& b) { return a.gain > b.gain; }

// Velocities smoothed under the model so far favour candidates that resemble it: where the best are close,
// each is judged along the motion that it implies itself. `tried`: best first, before and after.
void play_off(const Problem& problem, const Fit& current, std::vector<Tried>& tried, double looseness,
              const SearchOptions& options) {
  if (tried.size() < 2) return;
  const double close = std::max(10.0, 0.15 * tried.front().gain);
  const auto end = std::find_if(tried.begin(), tried.end(), [&](const Tried& t) {
    return t.gain < tried.front().gain - close || t.gain <= 0.0;
  });
  const bool contest = std::any_of(tried.begin(), end, [&](const Tried& t) {
    return !same_subject(t.hypothesis, tried.front().hypothesis);
  });
  if (!contest) return;
  const double reference = tried.front().gain;
  std::vector<double> evidence;
  for (auto t = tried.begin(); t != end; ++t) {
    smooth_all(problem, t->fit.effects, t->fit.noise, looseness);
    t->fit = fit(problem, t->fit.effects, t->fit.free, t->fit.noise);
    if (!t->hypothesis.map) add_covariance(problem, t->fit);
    t->fit.linearisation.reset();
    evidence.push_back(t->fit.evidence - choices_of(t->hypothesis));
  }
  for (auto t = tried.begin(); t != end; ++t) {
    t->gain = reference + evidence[static_cast<std::size_t>(t - tried.begin())] - evidence.front();
    options.progress("  " + label(t->hypothesis) + " along its own motion: " + std::to_string(t->gain) +
                     " nats");
  }
  std::sort(tried.begin(), end, by_gain);
  smooth_all(problem, current.effects, current.noise, looseness);
}

// Numbers that an effect takes; of a map so many, whatever its nodes, that one field is simpler than two.
std::size_t complexity(const Hypothesis& hypothesis) {
  constexpr std::size_t kField = 1000;
  return hypothesis.map ? kField * hypothesis.starts.front().linear.size() : hypothesis.free.size();
}

// Whether an effect of this gain is a wind that is but the slopes of a floor: one without curl would be rare.
bool blows_as_slopes(const Effect& effect, double gain, double gain_of_floor) {
  constexpr double kNoCurl = 0.1, kNearlyItsGain = 0.85;  // of its variation; of the wind's gain
  const auto* wind = std::get_if<Airflow>(&effect);
  return wind != nullptr && share_with_curl(*wind) < kNoCurl && gain_of_floor > kNearlyItsGain * gain;
}

// Of candidates that explain the flights equally well, the simplest is named: friction everywhere and not in
// a patch that happens to cover all that was visited, an uneven floor and not a wind that blows as its
// slopes, what has a name before a law that has none; of an inseparable set its first.
void simplest_of_equals_first(std::vector<Tried>& tried) {
  if (tried.empty()) return;
  const auto floor = std::find_if(tried.begin(), tried.end(), [](const Tried& other) {
    return other.hypothesis.kind == FloorUnevenness::kKind;
  });
  if (floor != tried.end() &&
      blows_as_slopes(tried.front().fit.effects.back(), tried.front().gain, floor->gain))
    std::rotate(tried.begin(), floor, floor + 1);
  const double least = tried.front().gain - indistinct(tried.front().gain);
  const auto end =
      std::find_if(tried.begin(), tried.end(), [&](const Tried& other) { return other.gain < least; });
  const auto simplest = std::min_element(tried.begin(), end, [](const Tried& a, const Tried& b) {
    return std::pair(!a.hypothesis.law.empty(), complexity(a.hypothesis)) <
           std::pair(!b.hypothesis.law.empty(), complexity(b.hypothesis));
  });
  std::rotate(tried.begin(), simplest, simplest + 1);
  for (const std::vector<std::string>& same : inseparable()) {
    if (std::find(same.begin(), same.end(), tried.front().hypothesis.kind) == same.end()) continue;
    const auto first = std::find_if(
        tried.begin(), end, [&](const Tried& other) { return other.hypothesis.kind == same.front(); });
    if (first != end) std::rotate(tried.begin(), first, first + 1);
  }
}

// The best starts of the best hypotheses, and of those that are sure of a fit: maps if they are not hopeless,
// others once wherever something asks to be explained.
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

bool is_plain(const Hypothesis& hypothesis) {
  return !hypothesis.map && !hypothesis.local && hypothesis.law.empty();
}

// What a map that comes first must win back of the nominal model's error, over nothing and over a plain
// effect: a motion capture that is distorted over the floor looks like a map of small forces too.
constexpr double kShareOfFirstMap = 0.2;

// A plain effect of so few parameters stands before a map that has not much more evidence.
constexpr std::size_t kFew = 2;
constexpr double kNearly = 0.8;  // of the map's gain

// A map imitates one or two effects of few parameters, and a little of everything else. Where one alone
// predicts the motion nearly as well, or two explain the flights as well as the best map does, the first goes
// to the front. A law outside the vocabulary, and what happened once or in one place, gives way to two plain
// effects that explain more.
void plain_before_strange(const Problem& problem, const std::vector<Hypothesis>& open,
                          std::vector<Tried>& tried, const OpenLoopError& nominal_error, double looseness,
                          const SearchOptions& options) {
  constexpr double kShareOfFirst = 0.2;  // of the gain of what is in front
  constexpr double kMore = 3.0;          // nats
  constexpr std::size_t kFirsts = 2, kSeconds = 3;
  if (tried.empty() || is_plain(tried.front().hypothesis)) return;
  const bool map = tried.front().hypothesis.map;
  const auto to_front = [&](std::size_t first) {
    std::rotate(tried.begin(), tried.begin() + static_cast<long>(first),
                tried.begin() + static_cast<long>(first) + 1);
  };
  const double gain_in_front = tried.front().gain;
  std::vector<std::size_t> firsts;
  for (std::size_t t = 0; t < tried.size() && firsts.size() < kFirsts; ++t) {
    const bool known = std::any_of(firsts.begin(), firsts.end(), [&](std::size_t other) {
      return same_subject(tried[other].hypothesis, tried[t].hypothesis);
    });
    if (is_plain(tried[t].hypothesis) && tried[t].gain > kShareOfFirst * gain_in_front && !known)
      firsts.push_back(t);
  }
  if (firsts.empty()) return;
  const OpenLoopError error_in_front =
      map ? open_loop_error(problem, tried.front().fit.effects) : OpenLoopError{};
  const auto as_good = [&](double gain, const Fit& plain) {
    if (!map) return gain > gain_in_front + kMore;
    return gain > kNearly * gain_in_front &&
           !wins_back(kShareOfFirstMap, nominal_error, open_loop_error(problem, plain.effects),
                      error_in_front);
  };
  const std::size_t one = firsts.front();
  if (complexity(tried[one].hypothesis) <= kFew && as_good(tried[one].gain, tried[one].fit))
    return to_front(one);
  std::optional<std::size_t> first_of_best;
  double best = -std::numeric_limits<double>::infinity();
  for (const std::size_t first : firsts) {
    std::vector<Hypothesis> others;
    for (const Hypothesis& hypothesis : open) {
      if (is_plain(hypothesis) && !same_subject(hypothesis, tried[first].hypothesis))
        others.push_back(hypothesis);
    }
    for (const Screened& candidate :
         shortlist(screen(problem, tried[first].fit, others), kSeconds, options)) {
      const Tried second = attempt(problem, {&tried[first].fit, &candidate}, looseness);
      const double together = tried[first].gain + second.gain;
      options.progress("  " + label(tried[first].hypothesis) + " with " + label(second.hypothesis) + ": " +
                       std::to_string(together) + " nats");
      if (together <= best || !as_good(together, second.fit)) continue;
      best = together;
      first_of_best = first;
    }
  }
  if (first_of_best) to_front(*first_of_best);
}

constexpr const char* kDoesNotHold = "does not hold on unseen data";

// What happened once, or lies in one place, cannot help where a fit has not seen it.
bool holds_on_unseen_data(const Hypothesis& hypothesis, const BlockEvidence& blocks,
                          const SearchOptions& options) {
  return hypothesis.local || (blocks.heldout_gain > 0.0 && blocks.inclusion >= options.least_inclusion);
}

// Why a candidate with enough evidence is not named all the same; empty when it is.
std::string objection_to(const Problem& problem, const Tried& candidate, const BlockEvidence& blocks,
                         const std::vector<Claim>& claims, const OpenLoopError& nominal_error,
                         const OpenLoopError& present_error, const SearchOptions& options) {
  if (candidate.gain < options.needed(candidate.hypothesis)) return "has too little evidence for its freedom";
  if (!holds_on_unseen_data(candidate.hypothesis, blocks, options)) return kDoesNotHold;
  const OpenLoopError error = open_loop_error(problem, candidate.fit.effects);
  constexpr double kShare = 0.03;
  if (claims.empty()) {
    const bool too_little =
        candidate.hypothesis.map && !wins_back(kShareOfFirstMap, nominal_error, present_error, error);
    return too_little ? "changes the motion too little to be named" : "";
  }
  // A little of what is left can be had by anything flexible, or by anything at all that is nearly collinear.
  const bool flexible = candidate.hypothesis.map || !candidate.hypothesis.law.empty();
  if ((flexible || candidate.gain < options.plain_gain) &&
      !wins_back(kShare, nominal_error, present_error, error))
    return "changes the motion too little to be named";
  return "";
}

// The priors of all maps but the newest effect were chosen beside less: weighs them again.
Fit with_priors_again(const Problem& problem, Fit current) {
  for (std::size_t i = 0; i + 1 < current.effects.size(); ++i) {
    if (over_the_floor(current.effects[i])) current = with_best_prior(problem, std::move(current), i);
  }
  return current;
}

// Noise in which a valve that stays open over several commands makes one pulse of them, or one of each: as
// the flights have it under these effects. They are smoothed under the noise that is returned.
NoiseModel with_likelier_pulses(const Problem& problem, const std::vector<Effect>& effects,
                                const NoiseModel& present, double looseness) {
  constexpr double kClear = 3.0;  // nats
  const auto smoothed = [&](NoiseModel noise) {
    smooth_all(problem, effects, noise, looseness);
    noise = profile_noise(problem, effects, noise, true);
    return std::pair(evaluate(problem, effects, {}, noise).log_likelihood, noise);
  };
  NoiseModel other = present;
  other.joins_pulses = !present.joins_pulses;
  const auto [other_likelihood, other_noise] = smoothed(other);
  const auto [likelihood, noise] = smoothed(present);
  if (other_likelihood < likelihood + kClear) return noise;
  smooth_all(problem, effects, other_noise, looseness);
  return other_noise;
}

// Fits along the motion that the model itself implies, until that no longer changes: friction that nearly
// holds the robot shows itself only step by step.
Fit settled(const Problem& problem, Fit current, double looseness) {
  constexpr int kMost = 4;
  constexpr double kEnough = 2.0;  // nats
  const auto newest = std::prev(current.effects.end());
  const bool earlier_map = std::any_of(current.effects.begin(), newest, over_the_floor);
  const bool map = earlier_map || over_the_floor(*newest);
  for (int round = 0; round < kMost; ++round) {
    for (std::size_t i = 0; round == 0 && i < current.effects.size(); ++i) {
      current = refine_onset(problem, std::move(current), i);
      current = refine_patch(problem, std::move(current), i, looseness);
    }
    if (round == 0)
      current.noise = with_likelier_pulses(problem, current.effects, current.noise, looseness);
    else
      smooth_all(problem, current.effects, current.noise, looseness);
    const double before = current.log_likelihood;
    current = fit(problem, current.effects, current.free, current.noise,
                  round == 0 ? FitEffort::kThorough : FitEffort::kQuick);
    if (round == 0 && earlier_map)
      current = with_priors_again(problem, std::move(current));
    else if (map)
      break;  // costly, and what it pushes does not depend on the velocity
    if (round > 0 && std::abs(current.log_likelihood - before) < kEnough) break;
  }
  return current;
}

// Pushes were claimed when less was known, which may have hidden some and made up others.
Fit with_pushes_reviewed(const Problem& problem, Fit current, double looseness,
                         const SearchOptions& options) {
  for (std::size_t i = 0; i < current.effects.size(); ++i) {
    if (!std::holds_alternative<ExternalImpulse>(current.effects[i])) continue;
    const auto reviewed = with_pushes_again(problem, current, i, options.accept_gain_of_local);
    if (!reviewed) continue;
    const auto count = [i](const Fit& fit) {
      return std::to_string(std::get<ExternalImpulse>(fit.effects[i]).events.size());
    };
    options.progress("  pushes: " + count(*reviewed) + " instead of " + count(current));
    smooth_all(problem, reviewed->effects, reviewed->noise, looseness);
    current = fit(problem, reviewed->effects, reviewed->free, reviewed->noise, FitEffort::kQuick);
  }
  return current;
}

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

std::vector<Hypothesis> unclaimed(const std::vector<Hypothesis>& all, const std::vector<Claim>& claims) {
  std::vector<Hypothesis> open;
  for (const Hypothesis& hypothesis : all) {
    if (!is_claimed(claims, hypothesis)) open.push_back(hypothesis);
  }
  return open;
}

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

// What came earlier must still be needed beside what came later, or else the worse of the two goes; where
// that is the newest, it has had its turn. Whether any went.
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

// What took an effect's place is the last of its fit; the claim goes there too.
void move_to_end(std::vector<Claim>& claims, std::size_t index) {
  const auto claim = claims.begin() + static_cast<long>(index);
  std::rotate(claim, claim + 1, claims.end());
}

// Names effects by their simpler forms (simpler_form.h). Whether one was renamed.
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

// An effect was named before its neighbours were known, and may have stood for several: tries the best rivals
// of each in its place, beside all others. `screening`: of the final model. `without_each`: that model
// without each effect. Whether one was replaced.
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
      return tried.gain > reference + kClearlyBetter && !imitates && !slopes;
    });
    if (rival == claim.rivals.end()) continue;
    const std::size_t last = rival->fit.effects.size() - 1;
    const BlockEvidence blocks = block_evidence(problem, without_each[i], rival->fit, last, options.seed);
    if (!holds_on_unseen_data(rival->hypothesis, blocks, options)) {
      options.progress("  " + label(rival->hypothesis) + " " + kDoesNotHold);
      continue;
    }
    options.progress("  " + label(rival->hypothesis) + " takes the place of " + label(claim.hypothesis));
    Tried better = std::move(*rival);
    claim.rivals.erase(rival);
    claim.hypothesis = better.hypothesis;
    claim.gain = claim.rival_reference = better.gain;
    current = std::move(better.fit);
    move_to_end(claims, i);
    return true;
  }
  return false;
}

// What a model is worth, for models with other effects.
double worth(const Fit& fit, const std::vector<Claim>& claims) {
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

// Where two effects resemble each other, the wrong one may have been named, and another to make up for it, so
// that only both together can change: tries the nearest rivals with others in place of the rest. Whether
// that is better.
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
    if (worth(other, others) < worth(current, claims) + kClearlyBetter) continue;
    options.progress("  which explains more");
    current = std::move(other);
    claims = std::move(others);
    return true;
  }
  return false;
}

}  // namespace

SearchResult search(const Problem& problem, const std::vector<Hypothesis>& library,
                    const SearchOptions& options) {
  SearchResult result;
  NoiseModel noise = initial_noise(*problem.flights);
  smooth_all(problem, {}, noise, 20.0);
  noise = profile_noise(problem, {}, noise, true);
  double looseness = 5.0;
  noise = with_likelier_pulses(problem, {}, noise, looseness);
  result.nominal = evaluate(problem, {}, {}, noise);
  const OpenLoopError nominal_error = open_loop_error(problem, {});
  Fit current = result.nominal;
  std::vector<Claim>& claims = result.claims;

  constexpr int kDraws = 60;
  std::vector<Claim> refused;  // had their turn
  bool dropped = false;        // what stays was named beside something else
  std::vector<Hypothesis> open;
  std::optional<NoiseAlone> alone;
  std::optional<Screening> screening;
  for (;;) {
    screening.reset();
    open = unclaimed(library, claims);
    for (const auto& found : {find_events(problem, current, options.accept_gain_of_local),
                              find_oscillations(problem, current, options.accept_gain_of_local)}) {
      for (const Hypothesis& hypothesis : unclaimed(found, claims)) open.push_back(hypothesis);
    }
    options.progress("screening " + std::to_string(open.size()) + " hypotheses beside " +
                     std::to_string(claims.size()) + " effects");
    const bool first = !result.p_value_of_screen;
    if (first) alone = noise_alone(problem, current, kDraws, options.seed);
    screening.emplace(problem, current, open, first ? &*alone : nullptr);
    std::vector<Screened> scored = screening->beside();
    if (first) result.p_value_of_screen = p_value(scored);
    if (claims.size() >= options.most_effects) break;
    scored.erase(
        std::remove_if(scored.begin(), scored.end(),
                       [&](const Screened& screened) { return is_claimed(refused, *screened.hypothesis); }),
        scored.end());

    const std::vector<Screened> promising = shortlist(scored, options.fitted_per_step, options);
    std::vector<Attempt> wanted;
    for (const Screened& candidate : promising)
      wanted.push_back({&current, &candidate, 0.5 * options.accept_gain});
    std::vector<Tried> tried = attempts(problem, wanted, looseness);
    for (std::size_t t = 0; t < tried.size(); ++t)
      options.progress("  " + label(tried[t].hypothesis) + ": " + std::to_string(tried[t].gain) +
                       " nats (screen " + std::to_string(promising[t].score) + ")");
    std::sort(tried.begin(), tried.end(), by_gain);
    play_off(problem, current, tried, looseness, options);
    simplest_of_equals_first(tried);
    plain_before_strange(problem, unclaimed(open, refused), tried, nominal_error, looseness, options);

    const OpenLoopError present_error = open_loop_error(problem, current.effects);
    bool accepted = false;
    for (std::size_t t = 0; t < tried.size() && tried[t].gain >= options.accept_gain && !accepted; ++t) {
      const BlockEvidence blocks =
          block_evidence(problem, current, tried[t].fit, current.effects.size(), options.seed);
      const std::string objection =
          objection_to(problem, tried[t], blocks, claims, nominal_error, present_error, options);
      if (!objection.empty()) {
        options.progress("  " + label(tried[t].hypothesis) + " " + objection);
        continue;
      }
      Claim claim{tried[t].hypothesis, tried[t].gain, blocks.heldout_gain, blocks.inclusion, {},
                  tried[t].gain};
      current = tried[t].fit;
      for (std::size_t r = 0; r < tried.size(); ++r) {
        if (r != t) claim.rivals.push_back(std::move(tried[r]));
      }
      options.progress("accepted " + label(claim.hypothesis));
      claims.push_back(std::move(claim));
      accepted = true;
    }
    if (!accepted) {
      result.rejected = std::move(tried);
      break;
    }
    // Velocities under the better model, then everything again at its noise.
    looseness = 4.0;
    current = settled(problem, std::move(current), looseness);
    current = with_pushes_reviewed(problem, std::move(current), looseness, options);

    dropped |= drop_needless(problem, current, claims, refused, looseness, options);
  }

  std::vector<Fit> without_each = leave_one_out(problem, current, result.nominal);
  const bool late_names = claims.size() > 1 || (dropped && !claims.empty());
  if (late_names &&
      (reconsider(problem, current, claims, *screening, without_each, looseness, options) ||
       reconsider_together(problem, library, result.nominal, current, claims, looseness, options))) {
    drop_needless(problem, current, claims, refused, looseness, options);
    current = with_pushes_reviewed(problem, std::move(current), looseness, options);
    without_each = leave_one_out(problem, current, result.nominal);
  }
  if (simplify(problem, library, current, claims, options))
    without_each = leave_one_out(problem, current, result.nominal);
  for (std::size_t i = 0; i < claims.size(); ++i) {
    const BlockEvidence blocks = block_evidence(problem, without_each[i], current, i, options.seed);
    claims[i].gain = current.log_likelihood - without_each[i].log_likelihood;
    claims[i].heldout_gain = blocks.heldout_gain;
    claims[i].inclusion = blocks.inclusion;
  }
  for (std::size_t i = 0; i < claims.size(); ++i)
    claims[i].onset_deviation_s = onset_deviation(problem, current, i);
  merge_laws(current, claims);
  merge_floor(current, claims);
  result.final = std::move(current);
  return result;
}

}  // namespace atmos
