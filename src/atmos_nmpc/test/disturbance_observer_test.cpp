// The observer against truth drawn from its own model, against numeric derivatives, and with faults.
#include "atmos_nmpc/disturbance_observer.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>
#include <random>

#include "numeric.h"

namespace atmos {
namespace {

using namespace observer_error;

constexpr double kStart = 1234.5, kPeriod = 0.1;

ObserverVector random_vector(std::mt19937& random, double sigma = 1.0) {
  std::normal_distribution<double> normal(0.0, sigma);
  ObserverVector v;
  for (int i = 0; i < kSize; ++i) v[i] = normal(random);
  return v;
}

class Observer : public ::testing::Test {
 protected:
  const Vehicle vehicle_ = load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml");
  const ObserverConfig config_ =
      load_controller(ATMOS_CONFIG_DIR "/controller/offset_free_wrench.yaml", vehicle_).observer.value();
  const ObserverModel model_{vehicle_, config_};

  ObserverState at_rest() const {
    ObserverState state;
    state.x[state13::kQuaternion] = 1.0;
    return state;
  }
  // Truth that moves by the filter's own model, noise included.
  ObserverState drawn(const ObserverState& state, const Openings& openings, double dt,
                      std::mt19937& random) const {
    const ObserverMatrix Q = model_.noise(state, openings, dt);
    const Eigen::LDLT<ObserverMatrix> factor(Q);
    const ObserverVector scaled =
        factor.vectorD().cwiseMax(0.0).cwiseSqrt().cwiseProduct(random_vector(random));
    const ObserverVector noise = factor.transpositionsP().transpose() * (factor.matrixL() * scaled);
    return plus(model_.next(state, openings, dt), noise);
  }
  State13<double> measured(const ObserverState& truth, std::mt19937& random) const {
    std::normal_distribution<double> normal;
    ObserverVector noise = ObserverVector::Zero();
    for (int i = 0; i < 3; ++i) {
      noise[kPosition + i] = config_.position_noise_m * normal(random);
      noise[kAttitude + i] = config_.attitude_noise_rad * normal(random);
    }
    return plus(truth, noise).x;
  }
};

TEST_F(Observer, PlusAndMinusAreInverse) {
  std::mt19937 random(1);
  for (const auto& [name, q] : testing::attitudes(2)) {
    const ObserverState state{testing::moving_state(q, 3), {{0.1, 0.2, 0.3}, {0.4, 0.5, 0.6}}};
    const ObserverVector error = random_vector(random, 0.5);
    EXPECT_LT((minus(plus(state, error), state) - error).norm(), 1e-9) << name;
    EXPECT_EQ(minus(state, state).norm(), 0.0) << name;
  }
}

TEST_F(Observer, JacobianAgainstCentralDifferences) {
  Vehicle vehicle = vehicle_;
  vehicle.inertia_kg_m2 = {0.2, 0.25, 0.3};  // so that Euler's coupling shows
  const ObserverModel model(vehicle, config_);
  Openings openings = Openings::Zero(8);
  openings[0] = openings[4] = 1.0;
  for (const auto& [name, q] : testing::attitudes(4)) {
    const ObserverState state{testing::moving_state(q, 5), {{0.1, -0.2, 0.3}, {-0.4, 0.5, 0.6}}};
    const double dt = 0.01;
    const ObserverState after = model.next(state, openings, dt);
    const Eigen::MatrixXd expected = testing::numeric_jacobian(
        [&](const Eigen::VectorXd& error) {
          return Eigen::VectorXd(minus(model.next(plus(state, error), openings, dt), after));
        },
        Eigen::VectorXd::Zero(kSize));
    const double error = (model.jacobian(state, openings, dt) - expected).cwiseAbs().maxCoeff();
    EXPECT_LT(error, 2e-6) << name;  // third order in dt, rates of order 1
  }
}

TEST_F(Observer, ConsistentWithTruthOfItsOwnModel) {
  constexpr int kRuns = 100;
  std::mt19937 random(11);
  ValveSchedule closed(8);
  closed.add({kStart, 1000.0, std::vector<double>(8, 0.0)});
  const Openings openings = Openings::Zero(8);
  double nees = 0.0, disturbance_nees = 0.0, nis = 0.0;
  int outside_3_sigma = 0;
  for (int run = 0; run < kRuns; ++run) {
    DisturbanceObserver observer(vehicle_, config_);
    ObserverState truth = at_rest();
    for (int i = 0; i < 3; ++i) {
      std::normal_distribution<double> normal;
      truth.d.acceleration_W[i] = 0.01 * normal(random);
      truth.d.angular_acceleration_B[i] = 0.02 * normal(random);
    }
    State13<double> first = measured(truth, random);
    std::normal_distribution<double> normal;
    for (int i = 0; i < 3; ++i) {
      first[state13::kVelocity + i] += config_.initial_velocity_m_s * normal(random);
      first[state13::kAngularVelocity + i] += config_.initial_rate_rad_s * normal(random);
    }
    observer.update(kStart, first, closed);
    for (int k = 1; k <= 100; ++k) {
      for (int part = 0; part < 5; ++part) truth = drawn(truth, openings, 0.02, random);
      EXPECT_TRUE(observer.update(kStart + kPeriod * k, measured(truth, random), closed));
      if (k > 50) nis += observer.nis() / (50.0 * kRuns);
    }
    const ObserverVector error = minus(truth, observer.estimate());
    nees += error.dot(observer.covariance().ldlt().solve(error)) / kRuns;
    const Eigen::Matrix<double, 6, 1> d = error.tail<6>();
    const Eigen::Matrix<double, 6, 6> P = observer.covariance().bottomRightCorner<6, 6>();
    disturbance_nees += d.dot(P.ldlt().solve(d)) / kRuns;
    outside_3_sigma += static_cast<int>((d.array().abs() > 3.0 * P.diagonal().array().sqrt()).count());
  }
  // Two-sided 99.9 % bounds of the mean of 100 chi-squared values: n +- 3.29 sqrt(2 n / 100).
  EXPECT_NEAR(nees, 18.0, 3.29 * std::sqrt(2.0 * 18.0 / kRuns));
  EXPECT_NEAR(disturbance_nees, 6.0, 3.29 * std::sqrt(2.0 * 6.0 / kRuns));
  EXPECT_NEAR(nis, 6.0, 3.29 * std::sqrt(2.0 * 6.0 / (50.0 * kRuns)));
  EXPECT_LE(outside_3_sigma, 8);  // of 600, 0.27 % each: 1.6 expected
}

TEST_F(Observer, CautiousWithThrustersFiring) {
  // Pulses of every length; each valve's thrust is off by its own factor in every period.
  std::mt19937 random(12);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  constexpr int kRuns = 100, kPeriods = 50;
  double nees = 0.0;
  for (int run = 0; run < kRuns; ++run) {
    DisturbanceObserver observer(vehicle_, config_);
    ValveSchedule valves(8);
    ObserverState truth = at_rest();
    truth.d.acceleration_W = {0.02, -0.01, 0.0};
    observer.update(kStart, measured(truth, random), valves);
    for (int k = 0; k < kPeriods; ++k) {
      const double t = kStart + kPeriod * k;
      ThrusterCommand command{t, kPeriod, std::vector<double>(8, 0.0)};
      Openings factor = Openings::Ones(8);
      for (int i = 0; i < 8; ++i) {
        if (uniform(random) < 0.5) command.duty[static_cast<std::size_t>(i)] = uniform(random);
        factor[i] += 0.8 * config_.thrust_error * normal(random);
      }
      valves.add(command);
      for (double at = t; at < t + kPeriod - 1e-9;) {
        const double end = std::min({t + kPeriod, valves.next_edge(at), at + 0.02});
        Openings openings(8);
        valves.openings(at, openings.data());
        truth = model_.next(truth, openings.cwiseProduct(factor), end - at);
        at = end;
      }
      observer.update(t + kPeriod, measured(truth, random), valves);
      valves.forget_before(t - 1.0);
    }
    const ObserverVector error = minus(truth, observer.estimate());
    nees += error.dot(observer.covariance().ldlt().solve(error)) / kRuns;
  }
  EXPECT_LT(nees, 18.0 + 3.29 * std::sqrt(2.0 * 18.0 / kRuns));
  EXPECT_GT(nees, 1.0);
}

// From five seconds after the step on, in 100 runs: no bias, within three standard deviations, and no pose
// refused on the way. The filter is tuned to follow what changes with place and thrust, so that a single
// estimate scatters by a fifth of this step.
TEST_F(Observer, FollowsAStepOfForceWithinFiveSeconds) {
  constexpr int kRuns = 100, kStep = 100, kEnd = 200;
  const double step = 0.3 / vehicle_.mass_kg;
  const Openings openings = Openings::Zero(8);
  ValveSchedule closed(8);
  std::vector<double> bias(kEnd + 1, 0.0), square(kEnd + 1, 0.0);
  int outside = 0, seen = 0;
  for (int run = 0; run < kRuns; ++run) {
    std::mt19937 random(1300 + static_cast<std::uint32_t>(run));
    DisturbanceObserver observer(vehicle_, config_);
    ObserverState truth = at_rest();
    observer.update(kStart, truth.x, closed);
    for (int k = 1; k <= kEnd; ++k) {
      truth.d.acceleration_W.x() = k > kStep ? step : 0.0;
      truth = model_.next(truth, openings, kPeriod);
      ASSERT_TRUE(observer.update(kStart + kPeriod * k, measured(truth, random), closed)) << run << ", " << k;
      const Eigen::Vector3d error = observer.estimate().d.acceleration_W - truth.d.acceleration_W;
      const auto at = static_cast<std::size_t>(k);
      bias[at] += error.x() / kRuns;
      square[at] += error.x() * error.x() / kRuns;
      if (k < kStep + 50) continue;
      const double sigma = std::sqrt(observer.covariance()(kLinear, kLinear));
      outside += static_cast<int>((error.head<2>().array().abs() > 3.0 * sigma).count());
      seen += 2;
    }
  }
  for (std::size_t k = kStep + 50; k <= kEnd; ++k) {
    EXPECT_LT(std::abs(bias[k]), 0.07 * step) << k;  // three standard errors of 100 runs
    EXPECT_LT(std::sqrt(square[k]), 0.3 * step) << k;
  }
  EXPECT_LT(outside, 0.01 * seen);
  std::printf("5 s after the step: bias %.2f %%, root mean square %.2f %%; outside of 3 sigma %d of %d\n",
              100.0 * bias[kStep + 50] / step, 100.0 * std::sqrt(square[kStep + 50]) / step, outside, seen);
}

TEST_F(Observer, PredictingAheadChangesNothing) {
  std::mt19937 random(14);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  DisturbanceObserver plain(vehicle_, config_), ahead(vehicle_, config_);
  ValveSchedule valves(8);
  ObserverState truth = at_rest();
  plain.update(kStart, truth.x, valves);
  ahead.update(kStart, truth.x, valves);
  for (int k = 0; k < 30; ++k) {
    const double t = kStart + kPeriod * k;
    ThrusterCommand command{t, kPeriod, std::vector<double>(8, 0.0)};
    for (double& duty : command.duty) duty = uniform(random);
    valves.add(command);
    ahead.predict_ahead(t + kPeriod, valves);
    // Before, at, and after the time predicted to.
    const double stamp = t + kPeriod + 0.005 * (k % 3 - 1);
    const State13<double> pose = measured(truth, random);
    EXPECT_EQ(plain.update(stamp, pose, valves), ahead.update(stamp, pose, valves));
    EXPECT_LT(minus(plain.estimate(), ahead.estimate()).norm(), 2e-4) << k;
    EXPECT_LT((plain.covariance() - ahead.covariance()).norm(), 1e-3 * plain.covariance().norm()) << k;
  }
}

TEST_F(Observer, RefusesAJumpThenStartsAnew) {
  ValveSchedule closed(8);
  DisturbanceObserver observer(vehicle_, config_);
  ObserverState truth = at_rest();
  int k = 0;
  for (; k < 50; ++k) observer.update(kStart + kPeriod * k, truth.x, closed);
  truth.x[0] = 0.5;
  for (int i = 1; i < config_.reset_after; ++i, ++k) {
    EXPECT_FALSE(observer.update(kStart + kPeriod * k, truth.x, closed));
    EXPECT_NEAR(observer.estimate().x[0], 0.0, 0.01);
  }
  observer.update(kStart + kPeriod * k, truth.x, closed);
  EXPECT_EQ(observer.estimate().x[0], 0.5);
  EXPECT_NEAR(observer.covariance()(kLinear, kLinear), std::pow(config_.initial_disturbance_m_s2, 2), 1e-12);
}

TEST_F(Observer, DisturbanceStaysWithinWhatThrustersCouldCancel) {
  ValveSchedule closed(8);
  DisturbanceObserver observer(vehicle_, config_);
  ObserverState truth = at_rest();
  truth.d.acceleration_W.x() = 1.0;  // five times the thrusters'
  const Openings openings = Openings::Zero(8);
  for (int k = 0; k < 30; ++k) {
    observer.update(kStart + kPeriod * k, truth.x, closed);
    EXPECT_LT(observer.estimate().d.acceleration_W.x(), 0.3);
    truth = model_.next(truth, openings, kPeriod);
  }
}

}  // namespace
}  // namespace atmos
