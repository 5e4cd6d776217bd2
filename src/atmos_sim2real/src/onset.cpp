#include "atmos_sim2real/onset.h"

#include <algorithm>
#include <cmath>

namespace atmos {

namespace {

constexpr double kReach = 1.5;  // s around the present stretch: the screen tries every second

// A stretch in which an onset makes the same motion, wherever in it; or a pulse, cut short.
struct Stretch {
  double begin_s, end_s;
  bool pulse = false;
  double middle() const { return 0.5 * (begin_s + end_s); }
};

// The stretches around an onset, pulses among them, in order.
std::vector<Stretch> stretches_near(const std::vector<Flight>& flights, std::size_t valve, double since_s) {
  std::vector<Stretch> found;
  for (const Flight& flight : flights) {
    double shut = flight.recording().start_s();
    for (const ThrusterCommand& command : flight.recording().commands) {
      const double on = std::abs(command.duty[valve]) * command.period_s;
      if (on <= 0.0) continue;
      if (command.stamp_s > shut) found.push_back({shut, command.stamp_s});
      found.push_back({command.stamp_s, command.stamp_s + on, true});
      shut = command.stamp_s + on;
    }
    if (flight.times().back() > shut) found.push_back({shut, flight.times().back()});
  }
  // From the ends of the present stretch: a valve may have rested for long.
  Stretch present{since_s, since_s};
  for (const Stretch& stretch : found) {
    if (stretch.begin_s <= since_s && since_s <= stretch.end_s) present = stretch;
  }
  found.erase(std::remove_if(found.begin(), found.end(),
                             [&](const Stretch& stretch) {
                               return stretch.end_s < present.begin_s - kReach ||
                                      stretch.begin_s > present.end_s + kReach;
                             }),
              found.end());
  return found;
}

double likelihood_at(const Problem& problem, const Fit& fit, std::size_t effect, double since_s) {
  std::vector<Effect> moved = fit.effects;
  std::get<ThrusterDead>(moved[effect]).since_s = since_s;
  return evaluate(problem, std::move(moved), {}, fit.noise).log_likelihood;
}

struct Weighed {
  Stretch stretch;
  double log_likelihood;

  double length_s() const { return stretch.end_s - stretch.begin_s; }
  // All of it together: an onset is as likely in each of its moments, so that a longer stretch is likelier.
  double log_mass() const { return log_likelihood + std::log(length_s()); }
};

std::vector<Weighed> weigh(const Problem& problem, const Fit& fit, std::size_t effect) {
  const ThrusterDead& dead = std::get<ThrusterDead>(fit.effects[effect]);
  std::vector<Weighed> weighed;
  for (const Stretch& stretch :
       stretches_near(*problem.flights, static_cast<std::size_t>(dead.thruster - 1), dead.since_s))
    weighed.push_back({stretch, likelihood_at(problem, fit, effect, stretch.middle())});
  return weighed;
}

// Another onset, 3 s, 6 s, 12 s, ... away, that is likelier than this; else this. Beside what was not known
// when it was found, pulses in between may speak against both.
double likelier_from_afar(const Problem& problem, const Fit& fit, std::size_t effect, double log_likelihood) {
  const double since = std::get<ThrusterDead>(fit.effects[effect]).since_s;
  double first = since, last = since;
  for (const Flight& flight : *problem.flights) {
    first = std::min(first, flight.recording().start_s());
    last = std::max(last, flight.times().back());
  }
  double best = since;
  for (double away = 2.0 * kReach; away < last - first; away *= 2.0) {
    for (const double other : {since - away, since + away}) {
      if (other < first || other > last) continue;
      const double there = likelihood_at(problem, fit, effect, other);
      if (there <= log_likelihood) continue;
      log_likelihood = there;
      best = other;
    }
  }
  return best;
}

bool has_onset(const Fit& fit, std::size_t effect) {
  const ThrusterDead* dead = std::get_if<ThrusterDead>(&fit.effects[effect]);
  return dead != nullptr && dead->since_s > 0.0;
}

}  // namespace

Fit refine_onset(const Problem& problem, Fit fit, std::size_t effect) {
  if (!has_onset(fit, effect)) return fit;
  constexpr int kMostWays = 20;
  double& since = std::get<ThrusterDead>(fit.effects[effect]).since_s;
  Weighed best{{since, since}, 0.0};
  for (int way = 0; way < kMostWays; ++way) {
    const std::vector<Weighed> weighed = weigh(problem, fit, effect);
    if (weighed.empty()) break;
    double highest = -1e300;
    for (const Weighed& w : weighed) highest = std::max(highest, w.log_likelihood);
    best = *std::max_element(weighed.begin(), weighed.end(),
                             [](const auto& a, const auto& b) { return a.log_mass() < b.log_mass(); });
    const double from = since;
    since = best.stretch.middle();
    if (since == from) since = likelier_from_afar(problem, fit, effect, highest);
    if (since == from) break;
  }
  if (best.stretch.pulse) {  // where it was cut short
    for (const double share : {0.1, 0.3, 0.7, 0.9}) {
      const double cut_s = best.stretch.begin_s + share * (best.stretch.end_s - best.stretch.begin_s);
      const double log_likelihood = likelihood_at(problem, fit, effect, cut_s);
      if (log_likelihood <= best.log_likelihood) continue;
      best.log_likelihood = log_likelihood;
      since = cut_s;
    }
  }
  return evaluate(problem, std::move(fit.effects), std::move(fit.free), fit.noise);
}

double onset_deviation(const Problem& problem, const Fit& fit, std::size_t effect) {
  if (!has_onset(fit, effect)) return 0.0;
  const double since = std::get<ThrusterDead>(fit.effects[effect]).since_s;
  const std::vector<Weighed> weighed = weigh(problem, fit, effect);
  double best = -1e300;
  for (const Weighed& w : weighed) best = std::max(best, w.log_mass());
  double sum = 0.0, squares = 0.0;
  for (const Weighed& w : weighed) {
    const double weight = std::exp(w.log_mass() - best);
    const double away = w.stretch.middle() - since;
    sum += weight;
    squares += weight * (away * away + w.length_s() * w.length_s() / 12.0);
  }
  return sum > 0.0 ? std::sqrt(squares / sum) : 0.0;
}

}  // namespace atmos
