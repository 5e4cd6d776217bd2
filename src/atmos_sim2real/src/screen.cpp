#include "atmos_sim2real/screen.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <limits>
#include <optional>

namespace atmos {

std::vector<FreeParameter> named(const std::vector<FreeParameter>& all,
                                 const std::vector<std::string>& names) {
  std::vector<FreeParameter> chosen;
  for (const FreeParameter& free : all) {
    if (std::find(names.begin(), names.end(), free.name) != names.end()) chosen.push_back(free);
  }
  return chosen;
}

std::vector<FreeParameter> at_effect(std::vector<FreeParameter> free, std::size_t effect) {
  for (FreeParameter& parameter : free) parameter.effect = effect;
  return free;
}

double choices_of(const Hypothesis& hypothesis) {
  return hypothesis.penalty + std::log(std::max(1.0, hypothesis.onsets));
}

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// The model's own columns in information form, so that a candidate costs one Schur complement.
struct Base {
  std::shared_ptr<const Linearisation> linearisation;  // none without free parameters
  MatrixXd precision;                                  // of the free parameters: prior and flights
  Eigen::LDLT<MatrixXd> posterior;
  // Columns of maps change slowly from frame to frame and are many: sums over a few frames are kept of them.
  std::vector<Index> sharp, smooth;
  std::vector<MatrixXd> sharp_columns, smooth_sums;  // per flight
};

constexpr Index kTogether = 2;  // frames

MatrixXd sums_of_frames(const MatrixXd& rows) {
  MatrixXd sums(rows.rows() / kTogether, rows.cols());
  for (Index column = 0; column < rows.cols(); ++column) {
    const double* value = rows.col(column).data();
    for (Index i = 0; i < sums.rows(); ++i, value += kTogether) sums(i, column) = value[0] + value[1];
  }
  return sums;
}

Base prepare(const Problem& problem, const Fit& fit) {
  Base base;
  if (fit.free.empty()) return base;
  base.linearisation = linearisation_of(problem, fit);
  base.precision = prior_precision(fit.free) + base.linearisation->information;
  base.posterior = base.precision.ldlt();
  for (std::size_t p = 0; p < fit.free.size(); ++p)
    (fit.free[p].linear ? base.smooth : base.sharp).push_back(static_cast<Index>(p));
  for (const MatrixXd& J : base.linearisation->columns) {
    base.sharp_columns.emplace_back(J(Eigen::all, base.sharp));
    base.smooth_sums.push_back(sums_of_frames(J(Eigen::all, base.smooth)));
  }
  return base;
}

// The model when one effect is taken out and the others move as far as the flights are linear.
struct Absence {
  std::vector<VectorXd> innovations;  // per flight, before the others move
  std::vector<Index> others;          // their free parameters
  Eigen::LDLT<MatrixXd> posterior;
  VectorXd step;       // of them
  double worth = 0.0;  // nats that the effect gains beside the others
};

Absence without(const Problem& problem, const Fit& fit, const Base& base, std::size_t effect) {
  Absence absence;
  std::vector<Effect> effects = fit.effects;
  effects.erase(effects.begin() + static_cast<long>(effect));
  absence.innovations = evaluate(problem, std::move(effects), {}, fit.noise).innovations;
  for (std::size_t f = 0; f < fit.innovations.size(); ++f)
    absence.worth += 0.5 * (absence.innovations[f].squaredNorm() - fit.innovations[f].squaredNorm());
  for (std::size_t p = 0; p < fit.free.size(); ++p) {
    if (fit.free[p].effect != effect) absence.others.push_back(static_cast<Index>(p));
  }
  if (absence.others.empty()) return absence;
  VectorXd g = -prior_precision(fit.free) * from_prior_mean(fit.effects, fit.free);
  for (std::size_t f = 0; f < fit.innovations.size(); ++f)
    g.noalias() -= base.linearisation->columns[f].transpose() * absence.innovations[f];
  const VectorXd of_others = g(absence.others);
  absence.posterior = MatrixXd(base.precision(absence.others, absence.others)).ldlt();
  absence.step = absence.posterior.solve(of_others);
  absence.worth -= 0.5 * of_others.dot(absence.step);
  return absence;
}

// All that candidates are held against.
struct Beside {
  const Problem& problem;
  const Fit& fit;
  Base base;
  std::vector<Absence> absences;  // per effect of the model
  const NoiseAlone* imagined;
  std::vector<MatrixXd> innovations;  // per flight: those of the model, then those without each effect
  std::optional<Fit> unpushed;        // the model without what pushes from outside, for thrusters' columns
};

// One hypothesis at one start, with its normal equations over all flights.
struct Candidate {
  const Hypothesis* hypothesis = nullptr;
  Start start;
  std::vector<FreeParameter> linear;  // of the start's effect; none of one that is there or not
  MatrixXd H;
  MatrixXd cross;       // with the model's own columns
  MatrixXd g;           // for the innovations of Beside
  MatrixXd g_of_noise;  // a column for every imagined set of innovations
};

// Adds one flight to the normal equations of candidates, whose columns stand side by side.
void add_flight(const Beside& beside, std::size_t flight, const MatrixXd& columns,
                std::vector<Candidate>& candidates) {
  const Base& base = beside.base;
  const MatrixXd g = -columns.transpose() * beside.innovations[flight];
  MatrixXd g_of_noise;
  if (beside.imagined != nullptr) {
    const NoiseAlone::Flips& flips = beside.imagined->flights[flight];
    MatrixXd of_stretch(columns.cols(), flips.signs.rows());
    for (Index s = 0; s < of_stretch.cols(); ++s) {
      const Index first = flips.begins[static_cast<std::size_t>(s)];
      const Index count = flips.begins[static_cast<std::size_t>(s) + 1] - first;
      of_stretch.col(s).noalias() = -columns.middleRows(first, count).transpose() *
                                    beside.fit.innovations[flight].segment(first, count);
    }
    g_of_noise.noalias() = of_stretch * flips.signs;
  }
  MatrixXd cross(base.precision.rows(), columns.cols());
  if (!base.sharp.empty()) cross(base.sharp, Eigen::all) = base.sharp_columns[flight].transpose() * columns;
  if (!base.smooth.empty())
    cross(base.smooth, Eigen::all) =
        base.smooth_sums[flight].transpose() * sums_of_frames(columns) / static_cast<double>(kTogether);

  Index begin = 0;
  for (Candidate& candidate : candidates) {
    const auto n = std::max<Index>(1, static_cast<Index>(candidate.linear.size()));
    const auto add = [](MatrixXd& sum, const auto& part) {
      if (sum.size() == 0)
        sum = part;
      else
        sum += part;
    };
    if (candidate.H.size() == 0) candidate.H = MatrixXd::Zero(n, n);
    add_products(columns.middleCols(begin, n), candidate.H);
    add(candidate.cross, cross.middleCols(begin, n));
    add(candidate.g, g.middleRows(begin, n));
    if (g_of_noise.size() > 0) add(candidate.g_of_noise, g_of_noise.middleRows(begin, n));
    begin += n;
  }
}

// Starts whose columns are worked on together, so that the model's own columns are gone through once for
// many.
constexpr Index kColumnsTogether = 16;

void fill(const Beside& beside, std::vector<Candidate>& candidates) {
  for (std::size_t f = 0; f < beside.problem.flights->size(); ++f) {
    std::vector<MatrixXd> parts;
    Index wide = 0;
    for (const Candidate& candidate : candidates) {
      const Fit& fit =
          beside.unpushed && acts_through_thrusters(candidate.start.effect) ? *beside.unpushed : beside.fit;
      if (candidate.linear.empty()) {
        parts.emplace_back(presence_column(beside.problem, fit, candidate.start.effect, f));
      } else {
        Fit at;
        at.effects = fit.effects;
        at.effects.push_back(candidate.start.effect);
        at.noise = fit.noise;
        parts.push_back(column_block(beside.problem, at, fit.innovations[f],
                                     at_effect(candidate.linear, fit.effects.size()), f));
      }
      wide += parts.back().cols();
    }
    if (parts.size() == 1) {
      add_flight(beside, f, parts.front(), candidates);
      continue;
    }
    MatrixXd columns(parts.front().rows(), wide);
    Index begin = 0;
    for (const MatrixXd& part : parts) {
      columns.middleCols(begin, part.cols()) = part;
      begin += part.cols();
    }
    add_flight(beside, f, columns, candidates);
  }
}

// An effect that is there or not: no prior width says how likely it is to be half there.
constexpr double kPresencePrice = 3.0;  // nats

double presence_gain(double g, double H) {
  const double amplitude = std::clamp(g / std::max(H, 1e-12), 0.0, 1.0);
  return amplitude * g - 0.5 * amplitude * amplitude * H;
}

// Of a candidate whose equations are projected: beside the model, or in an effect's place.
Screened scored(const Candidate& candidate, const MatrixXd& H, const VectorXd& g,
                const MatrixXd& g_of_noise) {
  const Hypothesis& hypothesis = *candidate.hypothesis;
  Screened out;
  out.hypothesis = &hypothesis;
  out.start = candidate.start;
  const double choices = std::log(static_cast<double>(hypothesis.starts.size()));
  if (candidate.linear.empty()) {
    const double price = kPresencePrice + choices_of(hypothesis) + choices;
    out.gain = presence_gain(g[0], H(0, 0));
    out.score = out.gain - price;
    for (Index draw = 0; draw < g_of_noise.cols(); ++draw)
      out.score_of_noise.push_back(presence_gain(g_of_noise(0, draw), H(0, 0)) - price);
    out.presence = 0.5 * H(0, 0);
    return out;
  }
  const std::vector<FreeParameter>& linear = candidate.linear;
  const auto n = static_cast<Index>(linear.size());
  out.widths.resize(n);
  for (Index p = 0; p < n; ++p) out.widths[p] = linear[static_cast<std::size_t>(p)].prior_width;
  const MatrixXd prior = prior_precision(linear);
  const MatrixXd S = H + prior;
  const Eigen::LLT<MatrixXd> factor(S);
  out.deviation = factor.solve(MatrixXd::Identity(n, n)).diagonal().cwiseSqrt();
  out.chance = 0.5 * factor.solve(H).trace();
  if (hypothesis.map)
    out.information = Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd>(H, prior, Eigen::EigenvaluesOnly)
                          .eigenvalues()
                          .cwiseMax(0.0);
  // What the bounds forbid earns nothing.
  std::vector<Effect> alone{candidate.start.effect};
  const auto allowed = [&](VectorXd amplitude) {
    for (Index p = 0; p < n; ++p) {
      const FreeParameter& free = linear[static_cast<std::size_t>(p)];
      double& value = parameter(alone, free);
      const double neutral = value;
      value += amplitude[p];
      clamp_to_bounds(alone, {free});
      amplitude[p] = value - neutral;
      value = neutral;
    }
    return amplitude;
  };
  const double price = occam_factor(prior, S, linear) + hypothesis.penalty + choices;
  const auto score = [&](const VectorXd& amplitude, const auto& gradient) {
    return amplitude.dot(gradient) - 0.5 * amplitude.dot(S * amplitude) - price;
  };
  out.amplitude = allowed(factor.solve(g));
  out.gain = out.amplitude.dot(g) - 0.5 * out.amplitude.dot(H * out.amplitude);
  out.score = score(out.amplitude, g);
  for (Index draw = 0; draw < g_of_noise.cols(); ++draw)
    out.score_of_noise.push_back(score(allowed(factor.solve(g_of_noise.col(draw))), g_of_noise.col(draw)));
  return out;
}

// At the model's optimum its own gradient is the prior's; only what the candidate adds counts.
Screened beside_all(const Beside& beside, const Candidate& candidate) {
  MatrixXd H = candidate.H;
  if (candidate.cross.rows() > 0)
    H.noalias() -= candidate.cross.transpose() * beside.base.posterior.solve(candidate.cross);
  return scored(candidate, H, candidate.g.col(0), candidate.g_of_noise);
}

Screened in_place(const Absence& absence, std::size_t effect, const Candidate& candidate) {
  MatrixXd H = candidate.H;
  VectorXd g = candidate.g.col(static_cast<Index>(effect) + 1);
  if (!absence.others.empty()) {
    const MatrixXd cross = candidate.cross(absence.others, Eigen::all);
    H.noalias() -= cross.transpose() * absence.posterior.solve(cross);
    g.noalias() -= cross.transpose() * absence.step;
  }
  return scored(candidate, H, g, MatrixXd());
}

// The best second for a thruster to die: what it adds to the motion is cut off there.
constexpr double kCoarse = 4.0;      // s
constexpr double kWorthALook = 3.0;  // nats

Candidate scan_onsets(const Beside& beside, const Hypothesis& hypothesis) {
  const std::vector<Flight>& flights = *beside.problem.flights;
  const Fit& fit = beside.unpushed ? *beside.unpushed : beside.fit;
  std::vector<ForceIntegrals> lost;  // per flight: motion with the thruster dead minus motion with it
  std::vector<MatrixXd> whole;
  std::vector<Effect> effects = fit.effects;
  effects.push_back(hypothesis.starts.front().effect);
  for (std::size_t f = 0; f < flights.size(); ++f) {
    lost.push_back(flights[f].integrate(beside.problem.plant(effects, f)));
    const ForceIntegrals healthy = flights[f].integrate(beside.problem.plant(fit.effects, f));
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      for (std::size_t i = 0; i < flights[f].frames(); ++i) {
        lost[f].measured[axis][i] -= healthy.measured[axis][i];
        lost[f].dv[axis][i] -= healthy.dv[axis][i];
        lost[f].dp[axis][i] -= healthy.dp[axis][i];
      }
    }
    whole.emplace_back(innovations(flights[f], lost[f], fit.noise));
  }
  Candidate best;
  double best_gain = -1.0;
  // Dead from some time in flight f on, and in all later flights.
  const auto try_onsets = [&](std::size_t f, const std::vector<double>& onsets) {
    if (onsets.empty()) return;
    const auto count = static_cast<Index>(onsets.size());
    const std::vector<double>& times = flights[f].times();
    MatrixXd columns(whole[f].rows(), count);
    std::vector<Candidate> candidates(onsets.size());
    for (Index k = 0; k < count; ++k) {
      const double since_s = onsets[static_cast<std::size_t>(k)];
      Candidate& candidate = candidates[static_cast<std::size_t>(k)];
      candidate.hypothesis = &hypothesis;
      candidate.start = hypothesis.starts.front();
      std::get<ThrusterDead>(candidate.start.effect).since_s = since_s;
      ForceIntegrals rest = lost[f];
      for (std::size_t frame = 0; times[frame] < since_s; ++frame) {
        for (std::size_t axis = 0; axis < kAxes; ++axis) rest.dv[axis][frame] = rest.dp[axis][frame] = 0.0;
      }
      columns.col(k) = innovations(flights[f], rest, fit.noise);
    }
    add_flight(beside, f, columns, candidates);
    for (std::size_t other = 0; other < flights.size(); ++other) {
      if (other != f && flights[other].times().front() > onsets.front())
        add_flight(beside, other, whole[other].replicate(1, count), candidates);
    }
    for (Candidate& candidate : candidates) {
      const double gain = beside_all(beside, candidate).gain;
      if (gain <= best_gain) continue;
      best_gain = gain;
      best = std::move(candidate);
    }
  };
  try_onsets(0, {0.0});
  for (std::size_t f = 0; f < flights.size(); ++f) {
    const std::vector<double>& times = flights[f].times();
    std::vector<double> onsets;
    for (double since = times.front() + 1.0; since < times.back() - 2.0; since += kCoarse) {
      onsets.push_back(since);
      if (static_cast<Index>(onsets.size()) < kColumnsTogether) continue;
      try_onsets(f, onsets);
      onsets.clear();
    }
    try_onsets(f, onsets);
  }
  // Evidence grows until the onset and falls after it, so that every second is tried around the best alone.
  const double best_since = std::get<ThrusterDead>(best.start.effect).since_s;
  for (std::size_t f = 0; f < flights.size() && best_gain > kWorthALook; ++f) {
    const std::vector<double>& times = flights[f].times();
    std::vector<double> onsets;
    for (double away = 1.0 - kCoarse; away < kCoarse; away += 1.0) {
      const double since = best_since + away;
      if (since > times.front() + 0.5 && since < times.back() - 2.0) onsets.push_back(since);
    }
    try_onsets(f, onsets);
  }
  best.g_of_noise.resize(0, 0);  // the draws know of no onset
  return best;
}

bool by_score(const Screened& a, const Screened& b) { return a.score > b.score; }

std::vector<Screened> all_scored(const std::vector<Candidate>& candidates,
                                 const std::function<Screened(const Candidate&)>& score) {
  std::vector<Screened> all(candidates.size());
  in_parallel(all.size(), [&](std::size_t c) {
    all[c] = score(candidates[c]);
    // Columns that these flights do not determine at all.
    if (std::isnan(all[c].score)) all[c].score = -std::numeric_limits<double>::infinity();
  });
  std::sort(all.begin(), all.end(), by_score);
  return all;
}

}  // namespace

struct Screening::Made {
  Beside beside;
  std::vector<Candidate> candidates;
};

Screening::Screening(const Problem& problem, const Fit& fit, const std::vector<Hypothesis>& library,
                     const NoiseAlone* imagined)
    : made_(new Made{{problem, fit, prepare(problem, fit), {}, imagined, {}, without_outside(problem, fit)},
                     {}}) {
  Beside& beside = made_->beside;
  for (std::size_t i = 0; i < fit.effects.size(); ++i)
    beside.absences.push_back(without(problem, fit, beside.base, i));
  for (std::size_t f = 0; f < fit.innovations.size(); ++f) {
    beside.innovations.emplace_back(fit.innovations[f].size(), 1 + beside.absences.size());
    beside.innovations.back().col(0) = fit.innovations[f];
    for (std::size_t i = 0; i < beside.absences.size(); ++i)
      beside.innovations.back().col(static_cast<Index>(i) + 1) = beside.absences[i].innovations[f];
  }

  std::vector<std::vector<Candidate>> batches;
  Index wide = kColumnsTogether;  // the columns of the last batch
  for (const Hypothesis& hypothesis : library) {
    for (const Start& start : hypothesis.starts) {
      Candidate candidate;
      candidate.hypothesis = &hypothesis;
      candidate.start = start;
      candidate.linear = named(hypothesis.free, start.linear);
      const auto columns = hypothesis.onsets > 0.0
                               ? kColumnsTogether
                               : std::max<Index>(1, static_cast<Index>(candidate.linear.size()));
      if (wide + columns > kColumnsTogether) {
        batches.emplace_back();
        wide = 0;
      }
      wide += columns;
      batches.back().push_back(std::move(candidate));
    }
  }
  in_parallel(batches.size(), [&](std::size_t b) {
    if (batches[b].front().hypothesis->onsets > 0.0)
      batches[b] = {scan_onsets(beside, *batches[b].front().hypothesis)};
    else
      fill(beside, batches[b]);
  });
  for (std::vector<Candidate>& batch : batches)
    std::move(batch.begin(), batch.end(), std::back_inserter(made_->candidates));
}

Screening::~Screening() = default;

std::vector<Screened> Screening::beside() const {
  return all_scored(made_->candidates,
                    [&](const Candidate& candidate) { return beside_all(made_->beside, candidate); });
}

std::vector<Screened> Screening::in_place_of(std::size_t effect) const {
  return all_scored(made_->candidates, [&](const Candidate& candidate) {
    return in_place(made_->beside.absences[effect], effect, candidate);
  });
}

double Screening::worth(std::size_t effect) const { return made_->beside.absences[effect].worth; }

std::vector<Screened> screen(const Problem& problem, const Fit& base, const std::vector<Hypothesis>& library,
                             const NoiseAlone* imagined) {
  return Screening(problem, base, library, imagined).beside();
}

}  // namespace atmos
