#include "atmos_sim2real/diagnosis.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>

#include "atmos_sim2real/floor_map.h"
#include "atmos_sim2real/map_prior.h"

namespace atmos {

namespace {

// Slow force that real tables and mocap systems show with nothing wrong: a few millinewtons
// (docs/diagnosis.md).
constexpr double kOrdinarySlowForce = 0.012;    // N, standard deviation
constexpr double kOrdinarySlowTorque = 0.0012;  // N m

}  // namespace

std::string text_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::kConsistent:
      return "consistent";
    case Verdict::kExplained:
      return "explained";
    case Verdict::kPartlyExplained:
      return "partly_explained";
    case Verdict::kUnexplained:
      return "unexplained";
  }
  return "";
}

Diagnosis diagnose(const Vehicle& vehicle, const std::vector<Effect>& known, std::vector<Flight>& flights,
                   const SearchOptions& options) {
  const Problem problem{&vehicle, known, &flights};
  const std::vector<Hypothesis> library = hypotheses(vehicle, flights);
  Diagnosis out;
  out.search = search(problem, library, options);
  const SearchResult& found = out.search;

  out.p_value = found.p_value_of_screen.value_or(1.0);
  if (!found.claims.empty()) out.p_value = std::min(out.p_value, std::exp(-found.claims.front().gain));

  const FrameGains gains = gains_of_effects(problem, found.nominal, found.final);
  out.axis_share = axis_shares(gains);
  if (!found.claims.empty()) out.where = locate(problem, gains);

  out.placebo = placebo_checks(problem, found.final, options.seed);
  out.smallest_detectable = smallest_detectable(problem, found.final, library, options);

  for (const Claim& claim : found.claims) {
    std::vector<std::string> same;
    for (const auto& set : inseparable()) {
      if (set.front() == claim.hypothesis.kind) same.assign(set.begin() + 1, set.end());
    }
    const double near_nats = indistinct(claim.rival_reference);
    for (const Tried& rival : claim.rivals) {
      const bool near = claim.rival_reference - rival.gain < near_nats;
      if (near && rival.hypothesis.kind != claim.hypothesis.kind &&
          std::find(same.begin(), same.end(), rival.hypothesis.kind) == same.end())
        same.push_back(rival.hypothesis.kind);
    }
    out.indistinguishable.push_back(std::move(same));
  }

  // Last, as many nodes make everything slow.
  constexpr double kBeyond = 0.6;  // m
  for (std::size_t i = 0; i < found.final.effects.size(); ++i) {
    if (over_the_floor(found.final.effects[i]))
      out.search.final = relaid(problem, std::move(out.search.final), i, kBeyond);
  }
  add_covariance(problem, out.search.final);

  out.unexplained_acceleration_rms = found.final.noise.slow[kX];
  NoiseModel ordinary = found.final.noise;
  const std::array<double, kAxes> most{kOrdinarySlowForce / vehicle.mass_kg,
                                       kOrdinarySlowForce / vehicle.mass_kg,
                                       kOrdinarySlowTorque / vehicle.inertia_kg_m2.z()};
  for (std::size_t axis = 0; axis < kAxes; ++axis)
    ordinary.slow[axis] = std::min(ordinary.slow[axis], most[axis]);
  if (ordinary == found.final.noise) {
    out.verdict = found.claims.empty() ? Verdict::kConsistent : Verdict::kExplained;
    return out;
  }
  out.verdict = found.claims.empty() ? Verdict::kUnexplained : Verdict::kPartlyExplained;
  out.unexplained_where = ordinary.slow[kX] < found.final.noise.slow[kX] ? "translation" : "yaw";
  const FrameGains rest = gains_of_slow_force(problem, found.final, ordinary);
  const std::vector<Place> where = locate(problem, rest);
  for (const Place& place : where) {
    if (place.what != "axis") {
      out.unexplained_where += ", most " + text_of(place);
      break;
    }
  }
  if (found.claims.empty()) {
    out.axis_share = axis_shares(rest);
    out.where = where;
  }
  return out;
}

void judge_by(const Proof& proof, Diagnosis& diagnosis) {
  constexpr double kMost = 3.0;  // times what noise alone would leave
  if (proof.on != kHeldOut || diagnosis.verdict != Verdict::kExplained) return;
  const HorizonProof& shown = proof.horizons.front();
  const auto ratio = [](double error, double noise) { return noise > 0.0 ? error / noise : 0.0; };
  const double worst = std::max(ratio(shown.fitted.position_rms_m, shown.noise_floor.position_rms_m),
                                ratio(shown.fitted.yaw_rms_rad, shown.noise_floor.yaw_rms_rad));
  if (worst < kMost) return;
  diagnosis.verdict = Verdict::kPartlyExplained;
  std::ostringstream where;
  where << "the held-out recordings, predicted " << std::setprecision(2) << worst
        << " times worse than noise alone would";
  diagnosis.unexplained_where = where.str();
}

}  // namespace atmos
