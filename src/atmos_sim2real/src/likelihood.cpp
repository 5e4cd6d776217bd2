#include "atmos_sim2real/likelihood.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace atmos {

Eigen::VectorXd innovations(const Flight& flight, const ForceIntegrals& forces, const NoiseModel& noise,
                            double* log_determinant) {
  const auto n = static_cast<Eigen::Index>(flight.frames());
  Eigen::VectorXd all(kAxes * n);
  double sum = 0.0;
  const auto whiteners = flight.whiteners(noise);
  std::array<Whitener::Track, kAxes> tracks;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    tracks[axis] = {forces.measured[axis].data(), forces.dv[axis].data(), forces.dp[axis].data(),
                    all.data() + static_cast<Eigen::Index>(axis) * n};
    sum += (*whiteners)[axis].log_determinant();
  }
  Whitener::whiten(*whiteners, tracks);
  if (log_determinant != nullptr) *log_determinant = sum;
  return all;
}

double log_likelihood(const Eigen::VectorXd& innovations, double log_determinant) {
  return -0.5 * (innovations.squaredNorm() + log_determinant);
}

NoiseModel initial_noise(const std::vector<Flight>& flights) {
  NoiseModel noise;
  for (int axis = 0; axis < kAxes; ++axis) {
    std::vector<double> differences;
    for (const Flight& flight : flights) {
      const auto& poses = flight.poses();
      const auto value = [&](std::size_t i) {
        return axis == kX ? poses[i].x_m : axis == kY ? poses[i].y_m : poses[i].yaw_rad;
      };
      for (std::size_t i = 3; i < poses.size(); ++i) {
        differences.push_back(std::abs(value(i) - 3 * value(i - 1) + 3 * value(i - 2) - value(i - 3)));
      }
    }
    std::nth_element(differences.begin(), differences.begin() + static_cast<long>(differences.size() / 2),
                     differences.end());
    // 1.4826 MAD is a standard deviation; a third difference of white noise has variance 20.
    noise.mocap[axis] = std::max(1.4826 * differences[differences.size() / 2] / std::sqrt(20.0), 1e-7);
  }
  noise.mocap[kX] = noise.mocap[kY] = 0.5 * (noise.mocap[kX] + noise.mocap[kY]);
  return noise;
}

namespace {

// One axis under a trial noise.
struct Trial {
  NoiseModel noise;
  int axis;
};

constexpr int kLanes = 4;
using Lanes = Eigen::Array<double, kLanes, 1>;

// Log likelihoods of one flight under up to kLanes trials, side by side: each is a chain of operations that
// wait for one another. The trials' correlation time and length are those of `transitions`.
void score(const Flight& flight, const ForceIntegrals& forces, const std::vector<Transition>& transitions,
           const Trial* trials, int count, double* scores) {
  Lanes mocap, slow, rough, distortion, scatter;
  const double *measured[kLanes], *dv[kLanes], *dp[kLanes], *variance[kLanes];
  for (int k = 0; k < kLanes; ++k) {
    const Trial& trial = trials[std::min(k, count - 1)];
    const int axis = trial.axis;
    mocap[k] = trial.noise.mocap[axis];
    slow[k] = trial.noise.slow[axis];
    rough[k] = trial.noise.rough[axis];
    distortion[k] = trial.noise.distortion[axis];
    scatter[k] = trial.noise.scatter;
    measured[k] = forces.measured[axis].data();
    dv[k] = forces.dv[axis].data();
    dp[k] = forces.dp[axis].data();
    variance[k] = flight.scatter_variance()[axis].data();
  }
  const auto at = [](const double* const* tracks, std::size_t i) {
    return Lanes(tracks[0][i], tracks[1][i], tracks[2][i], tracks[3][i]);
  };
  CovarianceOf<Lanes> covariance(mocap, slow, rough, distortion, scatter);
  const Lanes none = Lanes::Zero();
  Lanes p = at(measured, 0), v = none, d = none, r = none, b = none, c = none, squares = none,
        log_determinant = none;
  Lanes product = Lanes::Ones();  // of a few variances: one logarithm for all of them
  const std::size_t n = flight.frames();
  for (std::size_t i = 0; i < n; ++i) {
    const Lanes e = at(measured, i) - p - r - b;
    if (i >= static_cast<std::size_t>(Whitener::kBurnIn)) {
      const Lanes shown = covariance.shown_variance();
      product *= shown;
      squares += e * e / shown;
    }
    if (i % 16 == 0 || i + 1 == n) {
      log_determinant += product.log();
      product = Lanes::Ones();
    }
    const std::array<Lanes, 6> gain = covariance.see();
    const Transition& to = transitions[i];
    covariance.advance(to, at(variance, i));
    v += gain[1] * e;
    d += gain[2] * e;
    p += gain[0] * e + v * to.dt + d * to.slow_to_p + at(dp, i);
    v += d * to.slow_to_v + at(dv, i);
    d *= to.slow_decay;
    r = (r + gain[3] * e) * to.rough_decay;
    const Lanes seen_b = b + gain[4] * e, seen_c = c + gain[5] * e;
    to.distort(seen_b, seen_c, b, c);
  }
  for (int k = 0; k < count; ++k) scores[k] = -0.5 * (squares[k] + log_determinant[k]);
}

}  // namespace

namespace {

// Nats against a distortion, half normal: over a small piece of floor a large one is a change of scale, which
// takes the thrust's place; and a smooth error of a centimetre would take the place of any effect.
double implausible(double distortion, int axis) {
  const double usual = axis == kYaw ? 2e-3 : 5e-4;  // rad, m
  return 0.5 * (distortion / usual) * (distortion / usual);
}

// Whether two noises are the same for these axes, but for what never changes.
bool equal_on(int first, int last, const NoiseModel& a, const NoiseModel& b) {
  bool equal = a.scatter == b.scatter;
  for (int axis = first; axis <= last; ++axis)
    equal = equal && a.mocap[axis] == b.mocap[axis] && a.slow[axis] == b.slow[axis] &&
            a.rough[axis] == b.rough[axis] && a.distortion[axis] == b.distortion[axis];
  return equal;
}

}  // namespace

NoiseModel fit_noise(const std::vector<Flight>& flights, const std::vector<ForceIntegrals>& forces,
                     NoiseModel start, bool thorough) {
  std::vector<std::vector<Transition>> transitions(flights.size());
  for (std::size_t f = 0; f < flights.size(); ++f) {
    const std::vector<double>& times = flights[f].times();
    for (std::size_t i = 0; i < times.size(); ++i)
      transitions[f].emplace_back(start, i + 1 < times.size() ? times[i + 1] - times[i] : 0.0,
                                  flights[f].travel()[i]);
  }
  // Of every noise and each of the axes `first` to `last`, the sum over the flights.
  using AxisScores = std::array<double, kAxes>;
  const auto scores_of = [&](const std::vector<NoiseModel>& noises, int first, int last) {
    std::vector<Trial> trials;
    for (const NoiseModel& noise : noises) {
      for (int axis = first; axis <= last; ++axis) trials.push_back({noise, axis});
    }
    const std::size_t chunks = (trials.size() + kLanes - 1) / kLanes;
    std::vector<double> each(flights.size() * trials.size());
    in_parallel(flights.size() * chunks, [&](std::size_t job) {
      const std::size_t f = job / chunks, begin = job % chunks * kLanes;
      score(flights[f], forces[f], transitions[f], &trials[begin],
            static_cast<int>(std::min<std::size_t>(kLanes, trials.size() - begin)),
            &each[f * trials.size() + begin]);
    });
    std::vector<AxisScores> sums(noises.size(), AxisScores{});
    for (std::size_t k = 0; k < each.size(); ++k) {
      const std::size_t trial = k % trials.size();
      sums[trial * noises.size() / trials.size()][static_cast<std::size_t>(trials[trial].axis)] += each[k];
    }
    for (std::size_t k = 0; k < noises.size(); ++k) {
      for (int axis = first; axis <= last; ++axis)
        sums[k][static_cast<std::size_t>(axis)] -= implausible(noises[k].distortion[axis], axis);
    }
    return sums;
  };

  // Each level is scaled up or down by a factor that shrinks; translation and yaw have levels of their own.
  NoiseModel best = start;
  struct Level {
    std::function<void(NoiseModel&, double)> scale;
    int first, last;
  };
  const auto clamp = [](double& value, double factor, double low, double high) {
    value = std::clamp(std::max(value, low) * factor, low, high);
  };
  const std::vector<Level> levels = {
      {[&](NoiseModel& n, double f) {
         clamp(n.slow[kX], f, 6e-5, 1.0);
         n.slow[kY] = n.slow[kX];
       },
       kX, kY},
      {[&](NoiseModel& n, double f) { clamp(n.slow[kYaw], f, 3e-4, 10.0); }, kYaw, kYaw},
      {[&](NoiseModel& n, double f) {
         clamp(n.mocap[kX], f, 1e-6, 0.1);
         n.mocap[kY] = n.mocap[kX];
       },
       kX, kY},
      {[&](NoiseModel& n, double f) { clamp(n.mocap[kYaw], f, 1e-6, 0.1); }, kYaw, kYaw},
      {[&](NoiseModel& n, double f) { clamp(n.scatter, f, 1e-3, 0.5); }, kX, kYaw},
      {[&](NoiseModel& n, double f) {
         clamp(n.rough[kX], f, 1e-6, 0.01);
         n.rough[kY] = n.rough[kX];
       },
       kX, kY},
      {[&](NoiseModel& n, double f) { clamp(n.rough[kYaw], f, 1e-6, 0.05); }, kYaw, kYaw},
      {[&](NoiseModel& n, double f) {
         clamp(n.distortion[kX], f, 1e-6, 1e-3);
         n.distortion[kY] = n.distortion[kX];
       },
       kX, kY},
      {[&](NoiseModel& n, double f) { clamp(n.distortion[kYaw], f, 1e-6, 5e-3); }, kYaw, kYaw},
  };
  constexpr double kBetter = 1e-6, kWorthTheChange = 0.3;  // nats
  AxisScores scores = scores_of({best}, kX, kYaw).front();
  const AxisScores at_start = scores;
  // Moves there if the axes of the level gain by it.
  const auto take_better = [&](const Level& level, const NoiseModel& trial, const AxisScores& trial_scores) {
    double gain = 0.0;
    for (int axis = level.first; axis <= level.last; ++axis) gain += trial_scores[axis] - scores[axis];
    if (gain <= kBetter) return false;
    best = trial;
    std::copy(&trial_scores[level.first], &trial_scores[level.last] + 1, &scores[level.first]);
    return true;
  };
  const std::vector<double> factors =
      thorough ? std::vector<double>{4.0, 2.0, 1.4, 1.15} : std::vector<double>{2.0, 1.25};
  for (const double factor : factors) {
    std::vector<std::optional<NoiseModel>> stuck(levels.size());  // where neither way was better
    for (int round = 0; round < (thorough ? 2 : 1); ++round) {
      for (std::size_t l = 0; l < levels.size(); ++l) {
        const Level& level = levels[l];
        if (stuck[l] && equal_on(level.first, level.last, *stuck[l], best)) continue;
        std::vector<NoiseModel> ways{best, best};
        level.scale(ways[0], factor);
        level.scale(ways[1], 1.0 / factor);
        const std::vector<AxisScores> found = scores_of(ways, level.first, level.last);
        const bool up = take_better(level, ways[0], found[0]);
        bool better = up || take_better(level, ways[1], found[1]);
        if (!better) stuck[l] = best;
        for (int repeat = 1; repeat < 6 && better; ++repeat) {
          NoiseModel further = best;
          level.scale(further, up ? factor : 1.0 / factor);
          better = take_better(level, further, scores_of({further}, level.first, level.last).front());
        }
      }
    }
  }
  double gain = 0.0;
  for (int axis = 0; axis < kAxes; ++axis) gain += scores[axis] - at_start[axis];
  return gain > kWorthTheChange ? best : start;
}

}  // namespace atmos
