#include "atmos_sim2real/search.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "atmos_sim2real/attempts.h"
#include "atmos_sim2real/crossvalidation.h"
#include "atmos_sim2real/discover.h"
#include "atmos_sim2real/map_prior.h"
#include "atmos_sim2real/merge.h"
#include "atmos_sim2real/onset.h"
#include "atmos_sim2real/reconsider.h"
#include "atmos_sim2real/settle.h"

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

// What a map that comes first must win back of the nominal model's error, over nothing and over a plain
// effect: a motion capture that is distorted over the floor looks like a map of small forces too.
constexpr double kShareOfFirstMap = 0.2;

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
    // What a floor leaves between nodes that are far apart would be named.
    if (std::holds_alternative<FloorUnevenness>(current.effects.back()))
      current = relaid(problem, std::move(current), current.effects.size() - 1, 0.0);
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
