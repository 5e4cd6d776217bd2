#include "atmos_nmpc/solver.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <limits>
#include <random>
#include <stdexcept>

#include "atmos_nmpc/config.h"
#include "atmos_nmpc/direct_allocation.h"
#include "atmos_nmpc/rate.h"
#include "atmos_nmpc/terminal_weight.h"
#include "atmos_nmpc/wrench.h"
#include "numeric.h"

namespace {
int rusage_calls = 0;
}
// In place of the C library's: who asks for the processor's time.
extern "C" int getrusage(__rusage_who_t, struct rusage* usage) noexcept {
  ++rusage_calls;
  *usage = {};
  return 0;
}

namespace atmos {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
double stopped_clock() { return 1234.5; }

// min f(z) over one variable, with a second, fixed-structure constraint g(z) = 0 over two variables.
struct Toy : NonlinearProgram {
  std::function<double(double)> f = [](double x) { return (x - 1.0) * (x - 1.0); };
  std::function<double(double)> df = [](double x) { return 2.0 * (x - 1.0); };
  std::function<double(double)> ddf = [](double) { return 2.0; };
  // y - c(x) = 0
  std::function<double(double)> c = [](double x) { return x; };
  std::function<double(double)> dc = [](double) { return 1.0; };
  std::function<double(double)> ddc = [](double) { return 0.0; };
  Eigen::VectorXd lower = Eigen::VectorXd::Constant(2, -kInfinity),
                  upper = Eigen::VectorXd::Constant(2, kInfinity);
  Sparsity J, H;
  Toy() {
    J.add(0, 0);
    J.add(0, 1);
    H.add(0, 0);
  }
  int variable_count() const override { return 2; }
  int constraint_count() const override { return 1; }
  const Eigen::VectorXd& lower_bounds() const override { return lower; }
  const Eigen::VectorXd& upper_bounds() const override { return upper; }
  const Sparsity& jacobian_sparsity() const override { return J; }
  const Sparsity& hessian_sparsity() const override { return H; }
  double objective(const double* z) const override { return f(z[0]); }
  void gradient(const double* z, double* out) const override { out[0] = df(z[0]), out[1] = 0.0; }
  void constraints(const double* z, double* out) const override { out[0] = z[1] - c(z[0]); }
  void jacobian(const double* z, double* out) const override { out[0] = -dc(z[0]), out[1] = 1.0; }
  void hessian(const double* z, double factor, const double* lambda, double* out) const override {
    out[0] = factor * ddf(z[0]) - lambda[0] * ddc(z[0]);
  }
  Iterate start(double x) const {
    return {Eigen::Vector2d(x, c(x)), Eigen::VectorXd::Zero(2), Eigen::VectorXd::Zero(2),
            Eigen::VectorXd::Zero(1)};
  }
};

SolveResult solve(const Toy& toy, double from, SolverOptions options = {}, Stopwatch clock = stopped_clock) {
  OptimalControlSolver solver(toy, options, std::move(clock));
  Iterate iterate = toy.start(from);
  return solver.solve(iterate);
}

TEST(SolverStatus, NotRunBeforeASolve) { EXPECT_EQ(SolveResult().status, SolverStatus::kNotRun); }

TEST(SolverStatus, Solved) {
  const SolveResult result = solve(Toy(), 5.0);
  EXPECT_EQ(result.status, SolverStatus::kSolved);
  EXPECT_NEAR(result.objective, 0.0, 1e-8);
}

TEST(SolverClock, NoSystemCallsForTimesThatNobodyWants) {
  rusage_calls = 0;
  solve(Toy(), 5.0);
  EXPECT_EQ(rusage_calls, 0);
  rusage usage;
  getrusage(RUSAGE_SELF, &usage);
  EXPECT_EQ(rusage_calls, 1);  // they would have been seen
}

TEST(SolverStatus, Acceptable) {
  Toy toy;
  toy.ddf = [](double) { return 20.0; };  // steps ten times too short
  SolverOptions options;
  options.max_iterations = 500;
  options.ipopt = {{"tol", "1e-12"}, {"acceptable_tol", "1e-2"}, {"acceptable_iter", "2"}};
  EXPECT_EQ(solve(toy, 1.5, options).status, SolverStatus::kAcceptable);
}

TEST(SolverStatus, IterationLimit) {
  Toy toy;
  toy.f = [](double x) { return std::pow(x, 4); };
  toy.df = [](double x) { return 4.0 * std::pow(x, 3); };
  toy.ddf = [](double x) { return 12.0 * x * x; };
  SolverOptions options;
  options.max_iterations = 2;
  EXPECT_EQ(solve(toy, 100.0, options).status, SolverStatus::kIterationLimit);
}

TEST(SolverStatus, TimeLimit) {
  Toy toy;
  toy.f = [](double x) { return std::pow(x, 4); };
  toy.df = [](double x) { return 4.0 * std::pow(x, 3); };
  toy.ddf = [](double x) { return 12.0 * x * x; };
  SolverOptions options;
  options.time_limit_s = 0.05;
  double now = 0.0;
  const SolveResult result = solve(toy, 100.0, options, [&now] { return now += 0.02; });
  EXPECT_EQ(result.status, SolverStatus::kTimeLimit);
  EXPECT_GT(result.solve_time_s, 0.05);
}

TEST(SolverStatus, Infeasible) {
  Toy toy;  // y = x^2 + 1 with y <= 0
  toy.c = [](double x) { return x * x + 1.0; };
  toy.dc = [](double x) { return 2.0 * x; };
  toy.ddc = [](double) { return 2.0; };
  toy.upper[1] = 0.0;
  SolverOptions options;
  options.max_iterations = 500;
  EXPECT_EQ(solve(toy, 0.5, options).status, SolverStatus::kInfeasible);
}

TEST(SolverStatus, Diverged) {
  Toy toy;
  toy.f = [](double x) { return -x; };
  toy.df = [](double) { return -1.0; };
  toy.ddf = [](double) { return 0.0; };
  SolverOptions options;
  options.max_iterations = 500;
  options.ipopt = {{"diverging_iterates_tol", "1e6"}};
  EXPECT_EQ(solve(toy, 0.0, options).status, SolverStatus::kDiverged);
}

TEST(SolverStatus, InvalidNumber) {
  Toy toy;
  toy.df = [](double) { return std::nan(""); };
  EXPECT_EQ(solve(toy, 5.0).status, SolverStatus::kInvalidNumber);
}

TEST(SolverStatus, ErrorWhenAFunctionThrows) {
  Toy toy;
  toy.f = [](double) -> double { throw std::runtime_error("no value"); };
  EXPECT_EQ(solve(toy, 5.0).status, SolverStatus::kError);
}

TEST(Solver, RecoversAfterAFailure) {
  Toy toy;
  bool broken = true;
  toy.df = [&broken](double x) { return broken ? std::nan("") : 2.0 * (x - 1.0); };
  OptimalControlSolver solver(toy, {}, stopped_clock);
  Iterate iterate = toy.start(5.0);
  EXPECT_EQ(solver.solve(iterate).status, SolverStatus::kInvalidNumber);
  broken = false;
  for (int k = 0; k < 2; ++k) {
    iterate = toy.start(5.0);
    EXPECT_EQ(solver.solve(iterate).status, SolverStatus::kSolved);
    EXPECT_NEAR(iterate.z[0], 1.0, 1e-6);
  }
}

TEST(Solver, RefusesOptionsIpoptDoesNotTake) {
  EXPECT_NE(ipopt_option_fault("no_such_option", "1"), "");
  EXPECT_NE(ipopt_option_fault("tol", "-1"), "");
  EXPECT_NE(ipopt_option_fault("tol", "1e-4 # tight"), "");
  EXPECT_NE(ipopt_option_fault("max_iter", "1.5"), "");
  EXPECT_NE(ipopt_option_fault("mu_strategy", "bold"), "");
  EXPECT_EQ(ipopt_option_fault("tol", "1e-4"), "");
  EXPECT_EQ(ipopt_option_fault("mu_strategy", "adaptive"), "");
  const Toy toy;
  SolverOptions options;
  options.ipopt = {{"no_such_option", "1"}};
  EXPECT_THROW(OptimalControlSolver(toy, options, stopped_clock), std::invalid_argument);
}

TEST(Solver, AnswerDoesNotDependOnTheWarmStart) {
  const Vehicle vehicle = load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml");
  ControllerConfig config = load_controller(ATMOS_CONFIG_DIR "/controller/direct_allocation.yaml", vehicle);
  config.solver.ipopt["tol"] = "1e-10";
  config.solver.max_iterations = 200;
  DirectAllocation problem = make_direct_allocation(vehicle, config);
  State13<double> x0 = State13<double>::Zero();
  x0.head<2>() << -0.6, 0.3;
  x0.segment<4>(state13::kQuaternion) = testing::about_axis({0, 0, 1}, 0.6);
  x0[state13::kVelocity] = 0.1;
  const auto P = planar_terminal_weight(problem.dynamics(), config.weights, problem.input_weight(), 0.0);
  State13<double> reference = State13<double>::Zero();
  reference[state13::kQuaternion] = 1.0;
  problem.cost().set_reference(reference, x0.segment<4>(state13::kQuaternion), P);
  problem.set_initial_state(x0);

  OptimalControlSolver solver(problem, config.solver, stopped_clock);
  Iterate cold = problem.cold_start(1e-4);
  ASSERT_EQ(solver.solve(cold).status, SolverStatus::kSolved);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> input(-1.4, 1.4), state(-0.2, 0.2);
  for (int trial = 0; trial < 10; ++trial) {
    Iterate other = trial % 2 == 0 ? problem.cold_start(1e-2) : problem.shifted(cold);
    for (int k = 0; k < problem.stages(); ++k) {
      for (int i = 0; i < 4; ++i) other.z[17 * k + i] = input(random);
      for (int i = 4; i < 17; ++i) other.z[17 * k + i] += state(random);
    }
    ASSERT_EQ(solver.solve(other).status, SolverStatus::kSolved) << "trial " << trial;
    EXPECT_LT((other.z - cold.z).cwiseAbs().maxCoeff(), 1e-6) << "trial " << trial;
  }
}

// Against multipliers of a solution to high accuracy: an input is at its bound where the bound has a price.
TEST(Solver, ActiveBoundsAreThoseThatHaveAPrice) {
  const Vehicle vehicle = load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml");
  ControllerConfig config = load_controller(ATMOS_CONFIG_DIR "/controller/direct_allocation.yaml", vehicle);
  config.bounds.velocity.setConstant(0.3);
  DirectAllocation problem = make_direct_allocation(vehicle, config);
  State13<double> x0 = State13<double>::Zero(), reference = x0;
  x0[state13::kQuaternion] = reference[state13::kQuaternion] = 1.0;
  problem.cost().set_reference(
      reference, x0.segment<4>(state13::kQuaternion),
      planar_terminal_weight(problem.dynamics(), config.weights, problem.input_weight(), 0.0));
  SolverOptions accurate = config.solver;
  accurate.ipopt["tol"] = "1e-9";
  accurate.max_iterations = 300;
  OptimalControlSolver solver(problem, config.solver, stopped_clock), exact(problem, accurate, stopped_clock);
  for (const double distance : {0.0, 0.3, 1.0, 3.0}) {
    x0[0] = -distance;
    problem.set_initial_state(x0);
    Iterate plan = problem.cold_start(1e-4), truth = plan;
    ASSERT_TRUE(is_success(solver.solve(plan).status));
    ASSERT_TRUE(is_success(exact.solve(truth).status));
    int priced = 0, fast = 0;
    for (int k = 0; k < problem.stages(); ++k) {
      for (int i = 17 * k; i < 17 * k + 4; ++i)
        priced += truth.bound_lower[i] + truth.bound_upper[i] > 1e-3 ? 1 : 0;
      fast += problem.state(truth.z, k + 1)[state13::kVelocity] > 0.3 - config.bounds.width ? 1 : 0;
    }
    const ActiveBounds active = problem.active_bounds(plan.z);
    EXPECT_NEAR(active.inputs, priced, 1) << distance;
    EXPECT_NEAR(active.states, fast, 1) << distance;
    EXPECT_EQ(active.inputs > 0, distance > 0.5) << distance;
    EXPECT_EQ(active.states > 0, distance > 2.0) << distance;
  }
}

ControllerConfig varied(ControllerConfig config, std::uint32_t seed) {
  config.stages = 4 + static_cast<int>(seed % 9);
  config.attitude_error = seed % 2 == 0 ? AttitudeError::kPaper : AttitudeError::kVector;
  return config;
}

// At a random state before a random reference; every third with hard bounds of the velocities too, every
// fourth, as offset-free control has it, with disturbances and the inputs that hold against them.
template <class Problem>
Problem randomised(Problem problem, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  using State = typename Problem::State;
  const auto state = [&](double speed) {
    State13<double> x = State13<double>::Zero();
    for (int i = 0; i < 3; ++i) {
      x[state13::kPosition + i] = 2.0 * unit(random);
      x[state13::kVelocity + i] = speed * unit(random);
      x[state13::kAngularVelocity + i] = speed * unit(random);
    }
    x[state13::kPosition + 2] *= 0.01;
    x.segment<4>(state13::kQuaternion) =
        testing::about_axis({0.1 * unit(random), 0.1 * unit(random), 1.0}, M_PI * unit(random));
    return x;
  };
  const State13<double> x0 = state(0.4), reference = state(0.0);
  if (seed % 3 == 0) {
    State13<double> limit = State13<double>::Constant(kInfinity);
    limit.segment<3>(state13::kVelocity).setConstant(0.6);
    limit.segment<3>(state13::kAngularVelocity).setConstant(0.6);
    const State bound = limit.template head<Problem::kStates>();
    problem.set_state_bounds(-bound, bound);
  }
  problem.cost().set_reference(reference, x0.segment<4>(state13::kQuaternion),
                               TrackingCost::PlanarWeight::Identity());
  problem.set_initial_state(x0.template head<Problem::kStates>());
  if (seed % 4 == 0) {
    Disturbance disturbance;
    disturbance.acceleration_W.head<2>() << 0.05 * unit(random), 0.05 * unit(random);
    disturbance.angular_acceleration_B[2] = 0.3 * unit(random);
    problem.set_disturbance(disturbance);
    problem.set_input_reference(
        problem.dynamics().moving_input(reference.segment<4>(state13::kQuaternion), {}));
  }
  return problem;
}

DirectAllocation random_problem(const Vehicle& vehicle, const ControllerConfig& config, std::uint32_t seed) {
  return randomised(make_direct_allocation(vehicle, varied(config, seed)), seed);
}

// Counts what both solve; then the answers are the same.
template <class Problem>
void compare_with_mumps(const Problem& problem, std::uint32_t seed, int& solved) {
  SolverOptions options;
  options.max_iterations = 300;
  options.ipopt = {{"tol", "1e-9"}};
  SolverOptions general = options;
  general.ipopt["linear_solver"] = "mumps";
  OptimalControlSolver by_stages(problem, options, stopped_clock), by_mumps(problem, general, stopped_clock);
  ASSERT_TRUE(by_stages.uses_riccati());
  ASSERT_FALSE(by_mumps.uses_riccati());
  Iterate a = problem.cold_start(1e-4), b = a;
  const SolveResult result = by_stages.solve(a), expected = by_mumps.solve(b);
  ASSERT_EQ(is_success(result.status), is_success(expected.status)) << "seed " << seed;
  if (!is_success(result.status)) return;
  ++solved;
  EXPECT_LT((a.z - b.z).cwiseAbs().maxCoeff(), 1e-6) << "seed " << seed;
}

// 500 problems over all formulations; ATMOS_LONG_TESTS=1: 500 of each.
TEST(Solver, StageFactorisationGivesTheAnswerOfMumps) {
  if (!riccati_available()) GTEST_SKIP() << "this Ipopt takes no linear solver from outside";
  const Vehicle vehicle = load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml");
  const auto config = [&vehicle](const std::string& name) {
    return load_controller(ATMOS_CONFIG_DIR "/controller/" + name + ".yaml", vehicle);
  };
  const ControllerConfig direct = config("direct_allocation"), wrench = config("wrench"),
                         rate = config("rate");
  ControllerConfig polytope = wrench;
  polytope.polytope = true;
  const bool all = std::getenv("ATMOS_LONG_TESTS") != nullptr;
  constexpr int kFormulations = 4;
  int solved[kFormulations] = {}, compared[kFormulations] = {};
  for (std::uint32_t seed = 1; seed <= 500; ++seed) {
    for (int formulation = 0; formulation < kFormulations; ++formulation) {
      if (!all && static_cast<int>(seed / 4 % kFormulations) != formulation) continue;
      SCOPED_TRACE("formulation " + std::to_string(formulation));
      ++compared[formulation];
      int& count = solved[formulation];
      if (formulation == 0)
        compare_with_mumps(random_problem(vehicle, direct, seed), seed, count);
      else if (formulation == 3)
        compare_with_mumps(randomised(make_rate(vehicle, varied(rate, seed)), seed), seed, count);
      else
        compare_with_mumps(
            randomised(make_wrench(vehicle, varied(formulation == 1 ? wrench : polytope, seed)), seed), seed,
            count);
      if (HasFatalFailure()) return;
    }
  }
  for (int formulation = 0; formulation < kFormulations; ++formulation) {
    std::printf("formulation %d: %d compared, %d solved\n", formulation, compared[formulation],
                solved[formulation]);
    EXPECT_GE(solved[formulation], 99 * compared[formulation] / 100);
  }
}

// Problems without a feasible point, which end in Ipopt's restoration phase: there the rows have a dual
// block.
TEST(Solver, StageFactorisationCarriesTheRestorationPhase) {
  if (!riccati_available()) GTEST_SKIP() << "this Ipopt takes no linear solver from outside";
  const Vehicle vehicle = load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml");
  const ControllerConfig config =
      load_controller(ATMOS_CONFIG_DIR "/controller/direct_allocation.yaml", vehicle);
  SolverOptions options;
  options.max_iterations = 500;
  SolverOptions general = options;
  general.ipopt["linear_solver"] = "mumps";
  int infeasible = 0;
  for (std::uint32_t seed = 1; seed <= 30; ++seed) {
    DirectAllocation problem = random_problem(vehicle, config, seed);
    State13<double> limit = State13<double>::Constant(kInfinity);
    limit.segment<3>(state13::kVelocity).setConstant(0.1);
    problem.set_state_bounds(-limit, limit);
    State13<double> x0 = problem.initial_state();
    x0.segment<3>(state13::kVelocity) << 1.0, 0.0, 0.0;  // no input brakes that within one step
    problem.set_initial_state(x0);
    OptimalControlSolver by_stages(problem, options, stopped_clock),
        by_mumps(problem, general, stopped_clock);
    Iterate a = problem.cold_start(1e-4), b = a;
    const SolverStatus status = by_stages.solve(a).status;
    EXPECT_FALSE(is_success(status)) << "seed " << seed;
    EXPECT_EQ(status, by_mumps.solve(b).status) << "seed " << seed;
    infeasible += status == SolverStatus::kInfeasible ? 1 : 0;

    x0.segment<3>(state13::kVelocity).setZero();
    problem.set_initial_state(x0);
    a = problem.cold_start(1e-4);
    EXPECT_EQ(by_stages.solve(a).status, SolverStatus::kSolved) << "seed " << seed;
  }
  EXPECT_GE(infeasible, 15);
}

}  // namespace
}  // namespace atmos
