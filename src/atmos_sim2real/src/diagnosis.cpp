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

// What every frame of every flight gains when the nominal model is replaced by the final one, at the final
// noise.
struct FrameGains {
  std::vector<Eigen::VectorXd> total;  // per flight, per frame, nats
  std::array<double, kAxes> by_axis{0, 0, 0};
  double sum = 0.0;
};

FrameGains frame_gains(const Problem& problem, const Fit& nominal, const Fit& final) {
  const Fit before = evaluate(problem, nominal.effects, {}, final.noise);
  FrameGains gains;
  for (std::size_t f = 0; f < problem.flights->size(); ++f) {
    const Eigen::Index n = final.innovations[f].size() / kAxes;
    Eigen::VectorXd total = Eigen::VectorXd::Zero(n);
    for (int axis = 0; axis < kAxes; ++axis) {
      const Eigen::VectorXd gain = 0.5 * (before.innovations[f].segment(axis * n, n).array().square() -
                                          final.innovations[f].segment(axis * n, n).array().square());
      total += gain;
      gains.by_axis[static_cast<std::size_t>(axis)] += gain.sum();
    }
    gains.sum += total.sum();
    gains.total.push_back(std::move(total));
  }
  return gains;
}

std::string number(double value, int digits) {
  std::ostringstream out;
  out << std::setprecision(digits) << value;
  return out.str();
}

// Where the gain is concentrated, relative to how much time was spent there.
std::vector<Place> locate(const Problem& problem, const FrameGains& gains) {
  std::vector<Place> places;
  if (!(gains.sum > 0.0)) return places;
  const auto add = [&](const std::string& what, const std::string& statement, double nats) {
    places.push_back({what, statement, std::clamp(nats / gains.sum, 0.0, 1.0)});
  };

  // Time: the stretch of at least 5 s that holds most of the gain beyond its share of the flight.
  constexpr double kBlock = 5.0;
  for (std::size_t f = 0; f < problem.flights->size(); ++f) {
    const Flight& flight = (*problem.flights)[f];
    const double begin = flight.times().front();
    const auto blocks = static_cast<std::size_t>(std::ceil((flight.times().back() - begin) / kBlock)) + 1;
    std::vector<double> block(blocks, 0.0);
    double flight_sum = 0.0;
    for (std::size_t i = 0; i < flight.frames(); ++i) {
      const double gain = gains.total[f][static_cast<Eigen::Index>(i)];
      block[static_cast<std::size_t>((flight.times()[i] - begin) / kBlock)] += gain;
      flight_sum += gain;
    }
    if (problem.flights->size() > 1) add("recording", flight.recording().name, flight_sum);
    const double mean = flight_sum / static_cast<double>(blocks);
    std::size_t best_first = 0, best_last = 0, first = 0;
    double best = 0.0, run = 0.0;
    for (std::size_t b = 0; b < blocks; ++b) {
      run += block[b] - 1.2 * mean;
      if (run > best) {
        best = run;
        best_first = first;
        best_last = b;
      }
      if (run < 0.0) {
        run = 0.0;
        first = b + 1;
      }
    }
    double held = 0.0;
    for (std::size_t b = best_first; b <= best_last; ++b) held += block[b];
    const double length = static_cast<double>(best_last - best_first + 1) / static_cast<double>(blocks);
    if (held > 0.6 * flight_sum && length < 0.7 && held / gains.sum > length + 0.2)
      add("time",
          flight.recording().name + ": from " + number(kBlock * static_cast<double>(best_first), 4) +
              " s to " +
              number(std::min(kBlock * static_cast<double>(best_last + 1), flight.times().back() - begin),
                     4) +
              " s after its start",
          held);
  }

  // Regime: how many valves were open in the second before, and which.
  std::map<int, double> by_open;
  std::map<int, double> share_of_time;
  std::map<std::pair<int, int>, std::pair<double, double>> by_cell;  // gain, frames
  double frames = 0.0;
  for (std::size_t f = 0; f < problem.flights->size(); ++f) {
    const Flight& flight = (*problem.flights)[f];
    std::size_t command = 0;
    const auto& commands = flight.recording().commands;
    for (std::size_t i = 0; i < flight.frames(); ++i) {
      while (command + 1 < commands.size() && commands[command + 1].stamp_s <= flight.times()[i]) ++command;
      int open = 0;
      for (const double duty : commands[command].duty) open += std::abs(duty) > 0.02;
      const double gain = gains.total[f][static_cast<Eigen::Index>(i)];
      by_open[open] += gain;
      share_of_time[open] += 1.0;
      auto& cell = by_cell[{static_cast<int>(std::floor(flight.motion()[i].p_WC.x() / 0.5)),
                            static_cast<int>(std::floor(flight.motion()[i].p_WC.y() / 0.5))}];
      cell.first += gain;
      cell.second += 1.0;
      frames += 1.0;
    }
  }
  double few = 0.0, few_time = 0.0;
  for (const auto& [open, gain] : by_open) {
    if (open <= 1) {
      few += gain;
      few_time += share_of_time[open] / frames;
    }
  }
  if ((gains.sum - few) / gains.sum > 1.0 - few_time + 0.1)
    add("regime", "while two or more valves are open", gains.sum - few);
  if (few / gains.sum > few_time + 0.1) add("regime", "while at most one valve is open", few);
  auto best_cell = std::max_element(by_cell.begin(), by_cell.end(), [](const auto& a, const auto& b) {
    return a.second.first < b.second.first;
  });
  if (best_cell != by_cell.end() &&
      best_cell->second.first / gains.sum > 2.0 * best_cell->second.second / frames + 0.05)
    add("place",
        "x " + number(0.5 * best_cell->first.first, 3) + " to " +
            number(0.5 * (best_cell->first.first + 1), 3) + " m, y " +
            number(0.5 * best_cell->first.second, 3) + " to " +
            number(0.5 * (best_cell->first.second + 1), 3) + " m",
        best_cell->second.first);

  std::sort(places.begin(), places.end(), [](const Place& a, const Place& b) { return a.share > b.share; });
  return places;
}

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

  const FrameGains gains = frame_gains(problem, found.nominal, found.final);
  if (gains.sum > 0.0) {
    for (int axis = 0; axis < kAxes; ++axis)
      out.axis_share[static_cast<std::size_t>(axis)] =
          std::max(0.0, gains.by_axis[static_cast<std::size_t>(axis)]) / gains.sum;
  }
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

  const double slow = found.final.noise.slow[kX], slow_yaw = found.final.noise.slow[kYaw];
  out.unexplained_acceleration_rms = slow;
  const bool unusual = slow * vehicle.mass_kg > kOrdinarySlowForce ||
                       slow_yaw * vehicle.inertia_kg_m2.z() > kOrdinarySlowTorque;
  if (unusual) {
    out.unexplained_where = slow * vehicle.mass_kg > kOrdinarySlowForce ? "translation" : "yaw";
    out.verdict = found.claims.empty() ? Verdict::kUnexplained : Verdict::kPartlyExplained;
  } else {
    out.verdict = found.claims.empty() ? Verdict::kConsistent : Verdict::kExplained;
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
  diagnosis.unexplained_where =
      "the held-out recordings, predicted " + number(worst, 2) + " times worse than noise alone would";
}

}  // namespace atmos
