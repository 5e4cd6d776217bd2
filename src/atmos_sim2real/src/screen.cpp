#include "atmos_sim2real/screen.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

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

// Base columns in information form, so that a candidate costs one Schur complement.
struct Base {
  std::shared_ptr<const Linearisation> linearisation;  // none without free parameters
  Eigen::LDLT<Eigen::MatrixXd> posterior;
  // Columns of maps change slowly from frame to frame and are many: sums over a few frames are kept of them.
  std::vector<Eigen::Index> sharp, smooth;
  std::vector<Eigen::MatrixXd> sharp_columns, smooth_sums;  // per flight
};

constexpr Eigen::Index kTogether = 4;  // frames

Eigen::MatrixXd sums_of_frames(const Eigen::MatrixXd& rows) {
  Eigen::MatrixXd sums(rows.rows() / kTogether, rows.cols());
  for (Eigen::Index column = 0; column < rows.cols(); ++column) {
    const double* value = rows.col(column).data();
    for (Eigen::Index i = 0; i < sums.rows(); ++i, value += kTogether)
      sums(i, column) = value[0] + value[1] + value[2] + value[3];
  }
  return sums;
}

Base prepare(const Problem& problem, const Fit& fit) {
  Base base;
  if (fit.free.empty()) return base;
  base.linearisation = linearisation_of(problem, fit);
  base.posterior = (prior_precision(fit.free) + base.linearisation->information).ldlt();
  for (std::size_t p = 0; p < fit.free.size(); ++p)
    (fit.free[p].linear ? base.smooth : base.sharp).push_back(static_cast<Eigen::Index>(p));
  for (const Eigen::MatrixXd& J : base.linearisation->columns) {
    base.sharp_columns.emplace_back(J(Eigen::all, base.sharp));
    base.smooth_sums.push_back(sums_of_frames(J(Eigen::all, base.smooth)));
  }
  return base;
}

// Scores columns of a hypothesis over all flights beside the base, whose own columns take what they can.
struct Normal {
  Eigen::MatrixXd H, cross;
  Eigen::MatrixXd g;  // a column for the flights, then one for every imagined set of innovations

  Normal(const Base& base, Eigen::Index n)
      : H(Eigen::MatrixXd::Zero(n, n)),
        cross(Eigen::MatrixXd::Zero(base.linearisation == nullptr ? 0 : base.posterior.rows(), n)),
        g(Eigen::MatrixXd::Zero(n, 1)) {}

  void add(const Base& base, const Fit& fit, const Eigen::MatrixXd& Z, std::size_t flight,
           const NoiseAlone* imagined = nullptr) {
    add_products(Z, H);
    g.col(0).noalias() -= Z.transpose() * fit.innovations[flight];
    if (imagined != nullptr) {
      const NoiseAlone::Flips& flips = imagined->flights[flight];
      if (g.cols() == 1) g.conservativeResizeLike(Eigen::MatrixXd::Zero(g.rows(), 1 + flips.signs.cols()));
      Eigen::MatrixXd of_stretch(Z.cols(), flips.signs.rows());
      for (Eigen::Index s = 0; s < of_stretch.cols(); ++s) {
        const Eigen::Index first = flips.begins[static_cast<std::size_t>(s)];
        const Eigen::Index count = flips.begins[static_cast<std::size_t>(s) + 1] - first;
        of_stretch.col(s).noalias() =
            Z.middleRows(first, count).transpose() * fit.innovations[flight].segment(first, count);
      }
      g.rightCols(flips.signs.cols()).noalias() -= of_stretch * flips.signs;
    }
    if (cross.rows() == 0) return;
    cross(base.sharp, Eigen::all) += base.sharp_columns[flight].transpose() * Z;
    if (base.smooth.empty()) return;
    cross(base.smooth, Eigen::all) +=
        base.smooth_sums[flight].transpose() * sums_of_frames(Z) / static_cast<double>(kTogether);
  }
  // At the base's optimum its own gradient is the prior's; only what the candidate adds counts.
  void project(const Base& base) {
    if (cross.rows() > 0) H.noalias() -= cross.transpose() * base.posterior.solve(cross);
  }
};

// An effect that is there or not: no prior width says how likely it is to be half there.
constexpr double kPresencePrice = 3.0;  // nats

double presence_gain(const Normal& normal, Eigen::Index column = 0) {
  const double g = normal.g(0, column), H = normal.H(0, 0);
  const double amplitude = std::clamp(g / std::max(H, 1e-12), 0.0, 1.0);
  return amplitude * g - 0.5 * amplitude * amplitude * H;
}

Screened score_presence(const Problem& problem, const Fit& fit, const Base& base,
                        const Hypothesis& hypothesis, const Start& start, const NoiseAlone* imagined) {
  Normal normal(base, 1);
  for (std::size_t f = 0; f < problem.flights->size(); ++f)
    normal.add(base, fit, presence_column(problem, fit, start.effect, f), f, imagined);
  normal.project(base);
  const double gain = presence_gain(normal);
  const double choices = choices_of(hypothesis) + std::log(static_cast<double>(hypothesis.starts.size()));
  Screened out;
  out.hypothesis = &hypothesis;
  out.start = start;
  out.score = gain - kPresencePrice - choices;
  for (Eigen::Index draw = 1; draw < normal.g.cols(); ++draw)
    out.score_of_noise.push_back(presence_gain(normal, draw) - kPresencePrice - choices);
  out.gain = gain;
  out.presence = 0.5 * normal.H(0, 0);
  return out;
}

// The best second for a thruster to die: what it adds to the motion is cut off there.
constexpr double kCoarse = 4.0;      // s
constexpr double kWorthALook = 3.0;  // nats

Screened scan_onsets(const Problem& problem, const Fit& fit, const Base& base, const Hypothesis& hypothesis) {
  const std::vector<Flight>& flights = *problem.flights;
  ThrusterDead dead = std::get<ThrusterDead>(hypothesis.starts.front().effect);
  std::vector<ForceIntegrals> lost;  // per flight: motion with the thruster dead minus motion with it
  std::vector<Eigen::MatrixXd> whole;
  std::vector<Effect> effects = fit.effects;
  effects.push_back(dead);
  for (std::size_t f = 0; f < flights.size(); ++f) {
    lost.push_back(flights[f].integrate(problem.plant(effects, f)));
    const ForceIntegrals healthy = flights[f].integrate(problem.plant(fit.effects, f));
    for (std::size_t axis = 0; axis < kAxes; ++axis) {
      for (std::size_t i = 0; i < flights[f].frames(); ++i) {
        lost[f].measured[axis][i] -= healthy.measured[axis][i];
        lost[f].dv[axis][i] -= healthy.dv[axis][i];
        lost[f].dp[axis][i] -= healthy.dp[axis][i];
      }
    }
    whole.emplace_back(innovations(flights[f], lost[f], fit.noise));
  }
  Screened best;
  best.hypothesis = &hypothesis;
  best.start = hypothesis.starts.front();
  best.gain = -1.0;
  const auto consider = [&](double since_s, std::size_t first, const Eigen::MatrixXd* first_column) {
    Normal normal(base, 1);
    for (std::size_t f = 0; f < flights.size(); ++f) {
      const bool later = flights[f].times().front() > since_s;
      if (f == first && first_column != nullptr)
        normal.add(base, fit, *first_column, f);
      else if (later)
        normal.add(base, fit, whole[f], f);
    }
    normal.project(base);
    const double gain = presence_gain(normal);
    if (gain <= best.gain) return;
    best.gain = gain;
    std::get<ThrusterDead>(best.start.effect).since_s = since_s;
  };
  consider(0.0, flights.size(), nullptr);
  const auto try_onset = [&](std::size_t f, double since) {
    ForceIntegrals rest = lost[f];
    const std::vector<double>& times = flights[f].times();
    for (std::size_t frame = 0; times[frame] < since; ++frame) {
      for (std::size_t axis = 0; axis < kAxes; ++axis) rest.dv[axis][frame] = rest.dp[axis][frame] = 0.0;
    }
    const Eigen::MatrixXd column = innovations(flights[f], rest, fit.noise);
    consider(since, f, &column);
  };
  for (std::size_t f = 0; f < flights.size(); ++f) {
    const std::vector<double>& times = flights[f].times();
    for (double since = times.front() + 1.0; since < times.back() - 2.0; since += kCoarse)
      try_onset(f, since);
  }
  // Evidence grows until the onset and falls after it, so that every second is tried around the best alone.
  const double best_since = std::get<ThrusterDead>(best.start.effect).since_s;
  for (std::size_t f = 0; f < flights.size() && best.gain > kWorthALook; ++f) {
    const std::vector<double>& times = flights[f].times();
    for (double away = 1.0 - kCoarse; away < kCoarse; away += 1.0) {
      const double since = best_since + away;
      if (since > times.front() + 0.5 && since < times.back() - 2.0) try_onset(f, since);
    }
  }
  best.score = best.gain - kPresencePrice - choices_of(hypothesis);
  return best;
}

Screened score_amplitudes(const Problem& problem, const Fit& fit, const Base& base,
                          const Hypothesis& hypothesis, const Start& start, const NoiseAlone* imagined) {
  Fit at;
  at.effects = fit.effects;
  at.effects.push_back(start.effect);
  at.noise = fit.noise;
  const std::vector<FreeParameter> linear =
      at_effect(named(hypothesis.free, start.linear), fit.effects.size());
  const auto n = static_cast<Eigen::Index>(linear.size());
  Normal normal(base, n);
  for (std::size_t f = 0; f < problem.flights->size(); ++f)
    normal.add(base, fit, column_block(problem, at, fit.innovations[f], linear, f), f, imagined);
  normal.project(base);

  Screened out;
  out.hypothesis = &hypothesis;
  out.start = start;
  out.widths.resize(n);
  for (Eigen::Index p = 0; p < n; ++p) out.widths[p] = linear[static_cast<std::size_t>(p)].prior_width;
  const Eigen::MatrixXd prior = prior_precision(linear);
  const Eigen::MatrixXd S = normal.H + prior;
  const Eigen::LLT<Eigen::MatrixXd> factor(S);
  out.deviation = factor.solve(Eigen::MatrixXd::Identity(n, n)).diagonal().cwiseSqrt();
  out.chance = 0.5 * factor.solve(normal.H).trace();
  if (hypothesis.map)
    out.information =
        Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd>(normal.H, prior, Eigen::EigenvaluesOnly)
            .eigenvalues()
            .cwiseMax(0.0);
  // What the bounds forbid earns nothing.
  const auto allowed = [&](Eigen::VectorXd amplitude) {
    for (Eigen::Index p = 0; p < n; ++p) {
      const FreeParameter& free = linear[static_cast<std::size_t>(p)];
      double& value = parameter(at.effects, free);
      const double neutral = value;
      value += amplitude[p];
      clamp_to_bounds(at.effects, {free});
      amplitude[p] = value - neutral;
      value = neutral;
    }
    return amplitude;
  };
  const double price = occam_factor(prior, S, linear) + hypothesis.penalty +
                       std::log(static_cast<double>(hypothesis.starts.size()));
  const auto score = [&](const Eigen::VectorXd& amplitude, Eigen::Index column) {
    return amplitude.dot(normal.g.col(column)) - 0.5 * amplitude.dot(S * amplitude) - price;
  };
  out.amplitude = allowed(factor.solve(normal.g.col(0)));
  out.gain = out.amplitude.dot(normal.g.col(0)) - 0.5 * out.amplitude.dot(normal.H * out.amplitude);
  out.score = score(out.amplitude, 0);
  for (Eigen::Index draw = 1; draw < normal.g.cols(); ++draw)
    out.score_of_noise.push_back(score(allowed(factor.solve(normal.g.col(draw))), draw));
  return out;
}

}  // namespace

NoiseAlone noise_alone(const Problem& problem, const Fit& fit, int draws, std::uint32_t seed) {
  constexpr double kBlock = 6.0;  // s
  NoiseAlone alone;
  std::mt19937_64 random(seed);
  for (std::size_t f = 0; f < fit.innovations.size(); ++f) {
    const std::vector<double>& times = (*problem.flights)[f].times();
    NoiseAlone::Flips flips;
    double end = 0.0;
    for (Eigen::Index row = 0; row < fit.innovations[f].size(); ++row) {
      const auto frame = static_cast<std::size_t>(row) % times.size();
      if (frame > 0 && times[frame] < end) continue;
      flips.begins.push_back(row);
      end = times[frame] + kBlock;
    }
    flips.signs.resize(static_cast<Eigen::Index>(flips.begins.size()), draws);
    for (double& sign : flips.signs.reshaped()) sign = random() % 2 == 0 ? 1.0 : -1.0;
    flips.begins.push_back(fit.innovations[f].size());
    alone.flights.push_back(std::move(flips));
  }
  return alone;
}

std::vector<Screened> screen(const Problem& problem, const Fit& base_fit,
                             const std::vector<Hypothesis>& library, const NoiseAlone* imagined) {
  const Base base = prepare(problem, base_fit);
  struct Job {
    const Hypothesis* hypothesis;
    const Start* start;
  };
  std::vector<Job> jobs;
  for (const Hypothesis& hypothesis : library) {
    for (const Start& start : hypothesis.starts) jobs.push_back({&hypothesis, &start});
  }
  std::vector<Screened> scored(jobs.size());
  in_parallel(jobs.size(), [&](std::size_t j) {
    const Hypothesis& hypothesis = *jobs[j].hypothesis;
    const Start& start = *jobs[j].start;
    scored[j] = hypothesis.onsets > 0.0 ? scan_onsets(problem, base_fit, base, hypothesis)
                : start.linear.empty()
                    ? score_presence(problem, base_fit, base, hypothesis, start, imagined)
                    : score_amplitudes(problem, base_fit, base, hypothesis, start, imagined);
    // Columns that these flights do not determine at all.
    if (std::isnan(scored[j].score)) scored[j].score = -std::numeric_limits<double>::infinity();
  });
  std::sort(scored.begin(), scored.end(),
            [](const Screened& a, const Screened& b) { return a.score > b.score; });
  return scored;
}

double p_value(const std::vector<Screened>& scored) {
  double best = -std::numeric_limits<double>::infinity();
  Eigen::ArrayXd largest;
  for (const Screened& screened : scored) {
    if (screened.score_of_noise.empty()) continue;
    const Eigen::Map<const Eigen::ArrayXd> draws(screened.score_of_noise.data(),
                                                 static_cast<Eigen::Index>(screened.score_of_noise.size()));
    largest = largest.size() == 0 ? Eigen::ArrayXd(draws) : Eigen::ArrayXd(largest.max(draws));
    best = std::max(best, screened.score);
  }
  if (largest.size() < 2) return 1.0;
  constexpr double kEuler = 0.5772156649;
  const double mean = largest.mean();
  const double deviation =
      std::sqrt((largest - mean).square().sum() / static_cast<double>(largest.size() - 1));
  const double scale = deviation * std::sqrt(6.0) / M_PI;
  return -std::expm1(-std::exp(-(best - mean) / scale - kEuler));
}

}  // namespace atmos
