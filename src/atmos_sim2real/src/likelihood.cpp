#include "atmos_sim2real/likelihood.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <thread>

namespace atmos {

Eigen::VectorXd innovations(const Flight& flight, const ForceIntegrals& forces, const NoiseModel& noise,
                            double* log_determinant) {
  const auto n = static_cast<Eigen::Index>(flight.frames());
  Eigen::VectorXd all(kAxes * n);
  double sum = 0.0;
  const auto whiteners = flight.whiteners(noise);
  for (int axis = 0; axis < kAxes; ++axis) {
    const Whitener& whitener = (*whiteners)[static_cast<std::size_t>(axis)];
    whitener.whiten(forces.measured[axis].data(), forces.dv[axis].data(), forces.dp[axis].data(),
                    all.data() + axis * n);
    sum += whitener.log_determinant();
  }
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
      const auto& poses = flight.recording().poses;
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

NoiseModel fit_noise(const std::vector<Flight>& flights, const std::vector<ForceIntegrals>& forces,
                     NoiseModel start, bool thorough) {
  const auto axis_score = [&](const NoiseModel& noise, int first, int last) {
    std::vector<double> sums(flights.size() * kAxes, 0.0);
    in_parallel(flights.size() * kAxes, [&](std::size_t job) {
      const std::size_t f = job / kAxes;
      const int axis = static_cast<int>(job % kAxes);
      if (axis < first || axis > last) return;
      const Flight& flight = flights[f];
      const Whitener whitener(flight.times(), flight.scatter_variance()[axis], flight.travel(), noise,
                              static_cast<Axis>(axis));
      Eigen::VectorXd e(static_cast<Eigen::Index>(flight.frames()));
      whitener.whiten(forces[f].measured[axis].data(), forces[f].dv[axis].data(), forces[f].dp[axis].data(),
                      e.data());
      sums[job] = log_likelihood(e, whitener.log_determinant());
    });
    double total = 0.0;
    for (const double sum : sums) total += sum;
    return total;
  };

  // Each level is scaled up and down by a factor that shrinks; translation and yaw have levels of their own.
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
         clamp(n.distortion[kX], f, 1e-6, 0.01);
         n.distortion[kY] = n.distortion[kX];
       },
       kX, kY},
      {[&](NoiseModel& n, double f) { clamp(n.distortion[kYaw], f, 1e-6, 0.05); }, kYaw, kYaw},
  };
  const std::vector<double> factors =
      thorough ? std::vector<double>{4.0, 2.0, 1.4, 1.15} : std::vector<double>{2.0, 1.25};
  for (const double factor : factors) {
    for (int round = 0; round < (thorough ? 2 : 1); ++round) {
      for (const Level& level : levels) {
        double score = axis_score(best, level.first, level.last);
        for (const double f : {factor, 1.0 / factor}) {
          for (int repeat = 0; repeat < 6; ++repeat) {
            NoiseModel trial = best;
            level.scale(trial, f);
            const double trial_score = axis_score(trial, level.first, level.last);
            if (trial_score <= score + 1e-6) break;
            best = trial;
            score = trial_score;
          }
        }
      }
    }
  }
  return best;
}

void in_parallel(std::size_t count, const std::function<void(std::size_t)>& work) {
  const std::size_t workers = std::min<std::size_t>(count, std::max(1u, std::thread::hardware_concurrency()));
  if (workers <= 1) {
    for (std::size_t i = 0; i < count; ++i) work(i);
    return;
  }
  std::atomic<std::size_t> next{0};
  std::vector<std::thread> threads;
  for (std::size_t w = 0; w < workers; ++w) {
    threads.emplace_back([&] {
      for (std::size_t i = next++; i < count; i = next++) work(i);
    });
  }
  for (std::thread& thread : threads) thread.join();
}

}  // namespace atmos
