// Solve time of the direct-allocation NMPC in closed loop, in thread CPU time, by the stage structure and, in
// the same run on the same states, by Ipopt's general factorisation (MUMPS).
//
// The problem, fixed so that figures can be compared between solvers: the paper's vehicle and attitude error,
// |u| <= 1.5 N, hard boxes |p| <= 5, |v| <= 1, |w| <= 1, Q = (50, 10, 8000, 10), terminal 20 Q, R = 10, one
// step of 0.1 s a stage; 80 s (800 solves) over four set-points, plant = model, seeded measurement noise of
// 1 mm, 2 mm/s, 0.5e-3 per quaternion component, 2e-3 rad/s. A step is the warm start's shift, the solve, u0.
#include <time.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "atmos_model/benchmark_row.h"
#include "atmos_nmpc/config.h"
#include "atmos_nmpc/direct_allocation.h"
#include "atmos_nmpc/solver.h"
#include "closed_loop.h"

namespace {

using namespace atmos;
using State = State13<double>;

constexpr int kSteps = 800;
constexpr double kColdStartMu = 1.0;  // as the controller's, at the start and at every new set-point

double thread_cpu_seconds() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

DirectAllocation make_problem(int stages) {
  const std::string folder = ATMOS_CONFIG_DIR;
  const Vehicle vehicle = load_vehicle(folder + "/vehicle/atmos.yaml");
  ControllerConfig config = load_controller(folder + "/controller/direct_allocation.yaml", vehicle);
  config.stages = stages;
  config.attitude_error = AttitudeError::kPaper;
  config.weights.position.setConstant(50.0);
  config.weights.velocity.setConstant(10.0);
  config.weights.attitude.setConstant(8e3);
  config.weights.rate.setConstant(10.0);
  config.weights.terminal_factor = 20.0;
  config.force_weight = 10.0;
  config.pair_force_n = 1.5;
  config.bounds.linear = config.bounds.quadratic = 0.0;
  config.objective_scale = 0.05;
  DirectAllocation problem = make_direct_allocation(vehicle, config);
  State limit = State::Constant(std::numeric_limits<double>::infinity());
  limit.segment<3>(state13::kPosition).setConstant(5.0);
  limit.segment<3>(state13::kVelocity).setConstant(1.0);
  limit.segment<3>(state13::kAngularVelocity).setConstant(1.0);
  problem.set_state_bounds(-limit, limit);
  return problem;
}

State reference_at(int step) {
  constexpr double kPoses[4][3] = {{1, 0, 0}, {1, 1, 0}, {1, 1, M_PI / 4}, {0, 0, 0}};
  const double* pose = kPoses[std::min(3, step / 200)];
  State reference = State::Zero();
  reference.head<2>() << pose[0], pose[1];
  reference[state13::kQuaternion] = std::cos(0.5 * pose[2]);
  reference[state13::kQuaternion + 3] = std::sin(0.5 * pose[2]);
  return reference;
}

State measured(const State& x, double scale, std::mt19937& random) {
  std::normal_distribution<double> normal;
  constexpr double kDeviation[13] = {1e-3,   1e-3,   1e-3,   2e-3, 2e-3, 2e-3, 0.5e-3,
                                     0.5e-3, 0.5e-3, 0.5e-3, 2e-3, 2e-3, 2e-3};
  State seen = x;
  for (int i = 0; i < 13; ++i) seen[i] += scale * kDeviation[i] * normal(random);
  seen.segment<4>(state13::kQuaternion).normalize();
  return seen;
}

// One controller: its own problem, solver and warm start.
class Runner {
 public:
  Runner(int stages, const SolverOptions& options)
      : problem_(make_problem(stages)), solver_(problem_, options, thread_cpu_seconds) {
    // Sets up Ipopt's structures, which belongs to the start of a controller.
    iterate_ = problem_.cold_start(kColdStartMu);
    solver_.solve(iterate_);
  }

  Eigen::Vector4d step(int k, const State& x0) {
    const double begin = thread_cpu_seconds();
    problem_.cost().set_reference(reference_at(k), x0.segment<4>(state13::kQuaternion),
                                  TrackingCost::PlanarWeight::Zero());
    problem_.set_initial_state(x0);
    const bool jump = k == 0 || reference_at(k) != reference_at(k - 1);
    iterate_ = warm_ && !jump ? problem_.shifted(iterate_) : problem_.cold_start(kColdStartMu);
    const SolveResult result = solver_.solve(iterate_);
    const Eigen::Vector4d u0 = problem_.input(iterate_.z, 0);
    ms_.push_back(1e3 * (thread_cpu_seconds() - begin));
    warm_ = is_success(result.status);
    failures_ += warm_ ? 0 : 1;
    iterations_ += result.iterations;
    most_iterations_ = std::max(most_iterations_, result.iterations);
    return u0;
  }

  const DirectAllocation& problem() const { return problem_; }
  int failures() const { return failures_; }
  double median() const {
    std::vector<double> ms = ms_;
    std::sort(ms.begin(), ms.end());
    return ms[ms.size() / 2];
  }

  void report(const std::string& name) const {
    print_row(name, "ms", ms_);
    std::fprintf(stderr, "%s: %s, iterations mean %.2f, most %d; failures %d\n", name.c_str(),
                 solver_.uses_riccati() ? "Riccati" : "MUMPS", iterations_ / static_cast<double>(ms_.size()),
                 most_iterations_, failures_);
  }

 private:
  DirectAllocation problem_;
  OptimalControlSolver solver_;
  Iterate iterate_;
  bool warm_ = false;
  std::vector<double> ms_;
  int failures_ = 0, iterations_ = 0, most_iterations_ = 0;
};

SolverOptions options_with(std::map<std::string, std::string> ipopt, int max_iterations = 40) {
  SolverOptions options;
  options.max_iterations = max_iterations;
  options.ipopt = std::move(ipopt);
  return options;
}

struct Loop {
  std::vector<State> x0;  // as measured
  std::vector<Eigen::Vector4d> u0;
};

Loop fly(Runner& runner, double noise) {
  std::mt19937 random(1);
  Loop loop;
  State x = State::Zero();
  x[state13::kQuaternion] = 1.0;
  for (int k = 0; k < kSteps; ++k) {
    loop.x0.push_back(measured(x, noise, random));
    loop.u0.push_back(runner.step(k, loop.x0.back()));
    x = runner.problem().dynamics().next(x, loop.u0.back());
    x.segment<4>(state13::kQuaternion).normalize();
  }
  return loop;
}

void bench(int stages) {
  const std::string name = "nmpc/direct/N" + std::to_string(stages) + "/";
  Runner riccati(stages, options_with({}));
  const Loop loop = fly(riccati, 1.0);
  riccati.report(name + "solve");

  Runner mumps(stages, options_with({{"linear_solver", "mumps"}}));
  for (int k = 0; k < kSteps; ++k) mumps.step(k, loop.x0[static_cast<std::size_t>(k)]);
  mumps.report(name + "solve_mumps");
  std::printf("{\"name\": \"%sratio_to_mumps\", \"unit\": \"1\", \"median\": %.3f}\n", name.c_str(),
              mumps.median() / riccati.median());

  Runner converged(stages, options_with({{"tol", "1e-10"}, {"linear_solver", "mumps"}}, 500));
  double worst = 0.0;
  for (int k = 0; k < kSteps; ++k) {
    const auto at = static_cast<std::size_t>(k);
    worst = std::max(worst, (converged.step(k, loop.x0[at]) - loop.u0[at]).cwiseAbs().maxCoeff());
  }
  std::printf("{\"name\": \"%su0_error\", \"unit\": \"N\", \"max\": %.3g, \"n\": %d}\n", name.c_str(), worst,
              kSteps - converged.failures());

  Runner noisy(stages, options_with({}));
  fly(noisy, 20.0);
  noisy.report(name + "solve_noise20");
  std::printf("{\"name\": \"%snoise20_failures\", \"unit\": \"1\", \"max\": %d, \"n\": %d}\n", name.c_str(),
              noisy.failures(), kSteps);
}

// The controller's whole way from a measurement to its command, observer included, in a flight over four
// set-points with measurement noise on a tilted floor; and, over the same flight, its cost against that of
// the controller that solves to 1e-9 in every period.
void bench_feedback(const std::string& controller_file, const std::string& suffix) {
  const std::string folder = ATMOS_CONFIG_DIR;
  const Vehicle vehicle = load_vehicle(folder + "/vehicle/atmos.yaml");
  const ControllerConfig config = load_controller(folder + "/controller/" + controller_file, vehicle);
  FloorTilt tilt;
  tilt.slope_x = 0.002;
  constexpr double kStart = 1234.5;
  const auto fly = [&](const ControllerConfig& flown, std::vector<double>* ms) {
    Controller controller(vehicle, flown, true, thread_cpu_seconds);
    TrackingCost tracking(config.attitude_error, config.weights, config.bounds);
    testing::Flight robot(vehicle, controller, kStart, {}, {3e-4, 2e-3, 9e-4, 2e-3}, 1, {tilt});
    double cost = 0.0;
    for (int k = 0; k < kSteps; ++k) {
      const State reference = reference_at(k);
      if (k % 200 == 0)
        controller.add_goal({robot.now(), reference.head<3>(), reference.segment<4>(state13::kQuaternion)});
      const State x = testing::state13_of(robot.truth());
      tracking.set_reference(reference, x.segment<4>(state13::kQuaternion),
                             TrackingCost::PlanarWeight::Zero());
      cost += tracking.value(x, 0, false);
      const OdometrySample sample = robot.measure();
      const double begin = thread_cpu_seconds();
      const ControlDecision* decision = controller.on_odometry(sample, robot.now());
      const double end = thread_cpu_seconds();
      if (ms != nullptr && decision->feedback) ms->push_back(1e3 * (end - begin));
      for (const double duty : decision->command.duty) cost += config.force_weight * std::pow(1.7 * duty, 2);
      robot.carry_out(*decision);
    }
    return cost;
  };
  std::vector<double> ms;
  const double cost = fly(config, &ms);
  print_row("nmpc/feedback_latency" + suffix, "ms", ms);
  ControllerConfig converged = config;
  converged.feedback = FeedbackKind::kFull;
  converged.solver.max_iterations = 300;
  converged.solver.ipopt["tol"] = "1e-9";
  std::printf("{\"name\": \"nmpc/feedback_cost_ratio%s\", \"unit\": \"1\", \"median\": %.5f}\n",
              suffix.c_str(), cost / fly(converged, nullptr));
}

}  // namespace

// An argument is a prefix of the rows wanted: what cannot contribute to them is not run.
int main(int argc, char** argv) {
  const std::string prefix = argc > 1 ? argv[1] : "";
  const auto wanted = [&prefix](const std::string& name) {
    return name.compare(0, std::min(prefix.size(), name.size()), prefix, 0, name.size()) == 0;
  };
  if (wanted("nmpc/direct/N20/")) bench(20);
  if (wanted("nmpc/direct/N50/")) bench(50);
  // The offset-free controller does the most work on the way.
  if (wanted("nmpc/feedback_")) {
    bench_feedback("offset_free_direct_allocation.yaml", "");
    bench_feedback("direct_allocation.yaml", "/without_observer");
  }
}
