#include "atmos_sim2real/detectability.h"

#include <algorithm>
#include <cmath>

#include "atmos_sim2real/discover.h"

namespace atmos {

namespace {

std::string unit_of(const std::string& kind, const std::string& parameter) {
  for (const EffectInfo& info : registered_effects()) {
    if (info.kind != kind) continue;
    for (const ParameterInfo& known : info.parameters) {
      if (known.name == parameter) return known.unit;
    }
  }
  return "";
}

bool claims(const Fit& final, const std::string& kind) {
  return std::any_of(final.effects.begin(), final.effects.end(),
                     [&](const Effect& effect) { return kind_of(effect) == kind; });
}

// The final model without free parameters of one kind: nothing of that kind explains itself away.
Fit beside_others(const Fit& final, const std::string& kind) {
  Fit base = final;
  base.hold([&](const FreeParameter& free) { return kind_of(final.effects[free.effect]) == kind; });
  return base;
}

// Deviation of a random field, relative to its prior's, that brings so many nats on average.
double field_size(const Eigen::VectorXd& information, double nats) {
  const auto gain = [&](double size) {
    return 0.5 * (size * size * information.array() - (1.0 + size * size * information.array()).log()).sum();
  };
  double low = 1e-6, high = 1e3;
  for (int step = 0; step < 60; ++step) {
    const double middle = std::sqrt(low * high);
    (gain(middle) < nats ? low : high) = middle;
  }
  return high;
}

// The parameter by which an effect that is there or not is measured, and its size at the start.
struct Size {
  std::string parameter;
  double value;
};

Size size_of(const Effect& effect, double flown_s) {
  if (const auto* rise = std::get_if<ThrustRise>(&effect)) return {"time_constant_s", rise->time_constant_s};
  if (const auto* swing = std::get_if<FloorVibration>(&effect)) return {"amplitude_n", swing->amplitude_n};
  return {"since_s", flown_s};
}

// Seconds of flight in which a thruster fires once, on average: a valve that was dead for less lost nothing.
double seconds_per_pulse(const std::vector<Flight>& flights, int thruster, double flown_s) {
  double pulses = 0.0;
  for (const Flight& flight : flights) {
    for (const ThrusterCommand& command : flight.recording().commands)
      pulses += command.duty[static_cast<std::size_t>(thruster) - 1] != 0.0;
  }
  return flown_s / pulses;
}

// One of a hypothesis' starts to ask by: of patches one where the robot was, else the middle one, of those
// that measure a size linearly if there are such.
Start typical_start(const Hypothesis& hypothesis, const std::vector<Flight>& flights) {
  const std::vector<Start>& starts = hypothesis.starts;
  if (!std::holds_alternative<FrictionPatch>(starts.front().effect)) {
    const auto presences =
        std::find_if(starts.begin(), starts.end(), [](const Start& start) { return start.linear.empty(); });
    const auto linear = static_cast<std::size_t>(presences - starts.begin());
    return starts[(linear > 0 ? linear : starts.size()) / 2];
  }
  const std::vector<PlanarState<double>>& motion = flights.front().motion();
  const Eigen::Vector2d there = motion[motion.size() / 2].p_WC;
  const auto distance = [&](const Start& start) {
    const FrictionPatch& patch = std::get<FrictionPatch>(start.effect);
    return (Eigen::Vector2d(patch.center_x_m, patch.center_y_m) - there).norm();
  };
  return *std::min_element(starts.begin(), starts.end(),
                           [&](const Start& a, const Start& b) { return distance(a) < distance(b); });
}

}  // namespace

std::map<std::string, Detectable> smallest_detectable(const Problem& problem, const Fit& final,
                                                      const std::vector<Hypothesis>& library,
                                                      const SearchOptions& options) {
  constexpr double kNatsPerNumber = 3.0;  // what finding each further number of an effect costs, roughly
  double flown = 0.0;
  for (const Flight& flight : *problem.flights) flown += flight.recording().duration_s();

  // What is not claimed stands beside the final model; a claimed kind beside what else it holds.
  std::map<std::string, std::vector<Hypothesis>> asked;
  const auto ask = [&](Hypothesis hypothesis) {
    asked[claims(final, hypothesis.kind) ? hypothesis.kind : ""].push_back(std::move(hypothesis));
  };
  for (Hypothesis hypothesis : library) {
    if (hypothesis.kind == Unmodelled::kKind) continue;
    hypothesis.starts = {typical_start(hypothesis, *problem.flights)};
    hypothesis.onsets = 0.0;
    ask(std::move(hypothesis));
  }
  Hypothesis vibration;
  vibration.kind = FloorVibration::kKind;
  vibration.local = true;
  FloorVibration swing;
  swing.amplitude_n = 1.0;
  swing.frequency_hz = 1.0;
  vibration.starts = {{swing, {}}};
  vibration.penalty = std::log(50.0 * flown);  // every frequency that the flights resolve
  ask(std::move(vibration));

  std::map<std::string, Detectable> smallest;
  const auto offer = [&](const std::string& kind, const std::string& parameter, double value) {
    Detectable& best = smallest[kind];
    if (!std::isfinite(value) || (!best.parameter.empty() && best.value <= value)) return;
    best = {parameter, value, unit_of(kind, parameter)};
  };
  for (const auto& [claimed, hypotheses] : asked) {
    for (const Screened& screened : screen(problem, beside_others(final, claimed), hypotheses)) {
      const Hypothesis& hypothesis = *screened.hypothesis;
      const std::string& kind = hypothesis.kind;
      double nats = options.needed(hypothesis) + hypothesis.penalty;
      if (hypothesis.map) {
        offer(kind, screened.start.linear.front(),
              screened.widths[0] * field_size(screened.information, nats));
        continue;
      }
      // What the screen does not price: where, how fast, how damped.
      const std::size_t priced = std::max<std::size_t>(1, screened.start.linear.size());
      if (hypothesis.free.size() > priced)
        nats += kNatsPerNumber * static_cast<double>(hypothesis.free.size() - priced);
      if (screened.start.linear.empty()) {
        const Size size = size_of(screened.start.effect, flown);
        const double share = nats / std::max(screened.presence, 1e-9);
        // A dead valve's evidence grows with time, the others' with the square of their size.
        const bool dead = kind == ThrusterDead::kKind;
        const double least = dead ? seconds_per_pulse(*problem.flights, hypothesis.thruster, flown) : 0.0;
        offer(kind, size.parameter, std::max(least, size.value * (dead ? share : std::sqrt(share))));
      } else {
        for (Eigen::Index p = 0; p < screened.deviation.size(); ++p) {
          const double deviation = screened.deviation[p];
          const double occam = std::log(std::max(1.0, screened.widths[p] / deviation));
          offer(kind, screened.start.linear[static_cast<std::size_t>(p)],
                deviation * std::sqrt(2.0 * (nats + occam)));
        }
      }
    }
  }
  offer(ExternalImpulse::kKind, "events", smallest_push(problem, final, options.accept_gain_of_local));
  return smallest;
}

}  // namespace atmos
