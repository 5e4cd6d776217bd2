#include "atmos_sim2real/simpler_form.h"

#include <algorithm>

namespace atmos {

namespace {

std::optional<Effect> comes_down_to(const Effect& effect) {
  constexpr double kNoThrust = 0.02;  // of the thrust when healthy
  if (const auto* valves = std::get_if<ValveDelay>(&effect))
    return CommandDelay{{}, 0.5 * (valves->open_s + valves->close_s)};
  const auto* weak = std::get_if<ThrusterEfficiency>(&effect);
  if (weak == nullptr || weak->factor > kNoThrust) return std::nullopt;
  ThrusterDead dead;
  dead.thruster = weak->thruster;
  return dead;
}

}  // namespace

std::optional<SimplerForm> simpler_form(const Problem& problem, const Fit& current, std::size_t index,
                                        const Hypothesis& claimed, const std::vector<Hypothesis>& library) {
  const std::optional<Effect> simple = comes_down_to(current.effects[index]);
  if (!simple) return std::nullopt;
  const auto named = std::find_if(library.begin(), library.end(), [&](const Hypothesis& hypothesis) {
    return hypothesis.kind == kind_of(*simple) && hypothesis.thruster == claimed.thruster;
  });
  if (named == library.end()) return std::nullopt;
  Fit simpler = current;
  simpler.take_out(index);
  simpler.effects.push_back(*simple);
  for (const FreeParameter& free : at_effect(named->free, simpler.effects.size() - 1))
    simpler.free.push_back(free);
  simpler = fit(problem, std::move(simpler.effects), std::move(simpler.free), current.noise);
  const double gain = simpler.evidence - choices_of(*named) - current.evidence + choices_of(claimed);
  if (gain < 0.0) return std::nullopt;
  return SimplerForm{*named, std::move(simpler), gain};
}

}  // namespace atmos
