// Accuracy and consistency: velocities while thrusters fire, NEES and NIS inside their chi-square bounds.
#include <gtest/gtest.h>

#include <cstdio>

#include "sensor_simulator.h"

namespace atmos::test {
namespace {

constexpr double kSettled_s = 1.0;
constexpr double kZ999 = 3.29;  // 99.9 %, two-sided

struct Rms {
  double velocity = 0.0;  // m/s, per axis of the plane
  double yaw_rate = 0.0;  // rad/s
  double nees = 0.0;      // mean, 12 degrees of freedom
  int samples = 0;
};

Rms fly(FlightOptions options, bool with_commands, int flights) {
  Rms rms;
  for (int flight = 0; flight < flights; ++flight) {
    options.seed = static_cast<unsigned>(flight + 1);
    SensorSimulator simulator(nominal_vehicle(), options);
    PoseFilter filter(nominal_config(), nominal_vehicle());
    for (const Sample& sample : simulator.samples) {
      if (with_commands) simulator.feed_commands(filter, sample.frame.stamp_s);
      EXPECT_TRUE(filter.take_frame(sample.frame).published);
      if (sample.frame.stamp_s < kStart + kSettled_s) continue;
      const auto error = error_of(filter.estimate(), sample.truth);
      rms.velocity += 0.5 * error.segment<2>(pose_error::kVelocity).squaredNorm();
      rms.yaw_rate += error[pose_error::kAngularVelocity + 2] * error[pose_error::kAngularVelocity + 2];
      rms.nees += nees(filter.estimate(), error);
      ++rms.samples;
    }
    EXPECT_EQ(filter.counters().rejected_gate, 0u);
    EXPECT_EQ(filter.counters().reinitialisations, 0u);
    if (options.noise_m > 0.0) {
      EXPECT_EQ(filter.nis_monitor().verdict(), NisMonitor::Verdict::kConsistent);
    }
  }
  rms.velocity = std::sqrt(rms.velocity / rms.samples);
  rms.yaw_rate = std::sqrt(rms.yaw_rate / rms.samples);
  rms.nees /= rms.samples;
  std::printf("velocity %.2f mm/s, yaw rate %.4f rad/s, NEES %.2f\n", 1e3 * rms.velocity, rms.yaw_rate,
              rms.nees);
  return rms;
}

TEST(PoseFilterAccuracy, FromPoseAlone) {
  const Rms rms = fly({}, false, 10);
  EXPECT_LE(rms.velocity, 8e-3);
  EXPECT_LE(rms.yaw_rate, 0.04);
  EXPECT_LE(rms.nees, chi_square(12.0 * rms.samples, kZ999) / rms.samples);
}

TEST(PoseFilterAccuracy, WithCommandsAndThrustersEachOffByFivePercent) {
  FlightOptions options;
  options.thrust_error = 0.05;
  const Rms rms = fly(options, true, 10);
  EXPECT_LE(rms.velocity, 2e-3);
  EXPECT_LE(rms.yaw_rate, 0.01);
  EXPECT_LE(rms.nees, chi_square(12.0 * rms.samples, kZ999) / rms.samples);
}

TEST(PoseFilterAccuracy, WithCommandsAndAllThrustersFivePercentStrong) {
  FlightOptions options;
  options.thrust_error = 0.05;
  options.common_error = true;
  const Rms rms = fly(options, true, 10);
  EXPECT_LE(rms.velocity, 2e-3);
  EXPECT_LE(rms.yaw_rate, 0.01);
}

TEST(PoseFilterAccuracy, ExactCommandsLeaveNoTransient) {
  // Sub-frame pulses are integrated between their edges: without noise and thrust error the filter follows
  // exactly, and a filter that smears a pulse over its frame would be off by millimetres per second.
  FlightOptions options;
  options.noise_m = options.noise_rad = 0.0;
  const Rms rms = fly(options, true, 1);
  EXPECT_LE(rms.velocity, 2e-5);
  EXPECT_LE(rms.yaw_rate, 2e-4);
}

TEST(PoseFilterAccuracy, AWrongVarianceIsFoundWhileThrustersFire) {
  for (const double factor : {0.4, 2.5}) {
    FlightOptions options;
    options.noise_m *= factor;
    options.noise_rad *= factor;
    SensorSimulator simulator(nominal_vehicle(), options);
    PoseFilter filter(nominal_config(), nominal_vehicle());
    for (const Sample& sample : simulator.samples) {
      simulator.feed_commands(filter, sample.frame.stamp_s);
      filter.take_frame(sample.frame);
    }
    EXPECT_EQ(filter.nis_monitor().verdict(),
              factor > 1.0 ? NisMonitor::Verdict::kUnderstated : NisMonitor::Verdict::kOverstated)
        << factor << ", ratio " << filter.nis_monitor().ratio();
  }
}

// Truth drawn from the filter's own model: white accelerations, and white errors of the thrust of each open
// valve.
class OwnModelFlight {
 public:
  OwnModelFlight(const MocapConfig& config, const Vehicle& vehicle, unsigned seed, bool with_commands)
      : config_(config),
        vehicle_(vehicle),
        with_commands_(with_commands),
        matrices_(thruster_matrices(vehicle)),
        valves_(static_cast<int>(vehicle.thrusters.size())),
        random_(seed) {
    x_.setZero();
    x_.segment<3>(state13::kPosition) << 1.0, 2.0, 3.0;
    x_.segment<3>(state13::kVelocity) = config.initial_velocity_m_s * normal3();
    x_.segment<4>(state13::kQuaternion) << normal(), normal(), normal(), normal();
    x_.segment<4>(state13::kQuaternion).normalize();
    x_.segment<3>(state13::kAngularVelocity) = config.initial_angular_velocity_rad_s * normal3();
  }

  // The command for the period from `stamp` on.
  ThrusterCommand fire(double stamp) {
    ThrusterCommand command{stamp, vehicle_.pwm.period_s, std::vector<double>(vehicle_.thrusters.size())};
    for (double& duty : command.duty) duty = std::uniform_real_distribution<double>(0.0, 1.0)(random_);
    valves_.add(command);
    return command;
  }

  void advance_to(double until) {
    while (time_ < until) {
      double end = std::min(until, time_ + kStep_s);
      if (with_commands_) end = std::min(end, valves_.next_edge(time_));
      step(end - time_);
      time_ = end;
    }
  }

  PoseFrame frame() {
    const Eigen::Vector3d turn = config_.attitude_noise_rad * normal3();
    return {time_, x_.segment<3>(state13::kPosition) + config_.position_noise_m * normal3(),
            attitude() * Eigen::Quaterniond(Eigen::AngleAxisd(turn.norm(), turn.normalized()))};
  }

  Eigen::Matrix<double, 12, 1> error(const PoseEstimate& estimate) const {
    return error_of(estimate, x_.segment<3>(state13::kPosition), attitude(),
                    x_.segment<3>(state13::kVelocity), x_.segment<3>(state13::kAngularVelocity));
  }

 private:
  static constexpr double kStep_s = 5e-4;

  void step(double dt) {
    Eigen::Vector3d force = Eigen::Vector3d::Zero(), torque = force, force_noise = force,
                    torque_noise = force;
    const auto openings = valves_.openings(time_);
    const double white = std::sqrt(config_.correlation_s * dt);
    for (std::size_t i = 0; with_commands_ && i < openings.size(); ++i) {
      const double thrust = openings[i] * vehicle_.thrusters[i].force_n;
      const double error = config_.thrust_error * thrust * white * normal();
      const auto column = static_cast<Eigen::Index>(i);
      force += thrust * matrices_.D.col(column);
      torque += thrust * matrices_.L.col(column);
      force_noise += error * matrices_.D.col(column);
      torque_noise += error * matrices_.L.col(column);
    }
    const AccelerationNoise& noise = with_commands_ ? config_.known_input : config_.unknown_input;
    x_ = rk4_step(x_, dt, [&](const State13<double>& at) {
      return rigid_body_rate<double>(at, force, torque, vehicle_.mass_kg, vehicle_.inertia_kg_m2);
    });
    x_.segment<4>(state13::kQuaternion).normalize();
    x_.segment<3>(state13::kVelocity) +=
        attitude() * force_noise / vehicle_.mass_kg + noise.linear_m_s2 * white * normal3();
    x_.segment<3>(state13::kAngularVelocity) +=
        torque_noise.cwiseQuotient(vehicle_.inertia_kg_m2) + noise.angular_rad_s2 * white * normal3();
  }

  Eigen::Quaterniond attitude() const {
    const auto q = x_.segment<4>(state13::kQuaternion);
    return Eigen::Quaterniond(q[0], q[1], q[2], q[3]);
  }
  double normal() { return normal_(random_); }
  Eigen::Vector3d normal3() {
    const double a = normal(), b = normal(), c = normal();
    return {a, b, c};
  }

  MocapConfig config_;
  Vehicle vehicle_;
  bool with_commands_;
  AllocationMatrices matrices_;
  ValveSchedule valves_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  State13<double> x_;
  double time_ = kStart;
};

class PoseFilterConsistency : public ::testing::TestWithParam<bool> {};

TEST_P(PoseFilterConsistency, NeesAndNisLieInTheirChiSquareBounds) {
  constexpr int kRuns = 100, kFrames = 200, kEvery = 25;
  Vehicle vehicle = nominal_vehicle();
  vehicle.inertia_kg_m2 << 0.25, 0.3, 0.4;  // gyroscopic coupling
  const MocapConfig config = nominal_config();

  std::vector<double> nees_at(kFrames / kEvery, 0.0);
  double nees_sum = 0.0, nis_sum = 0.0;
  int nis_count = 0;
  for (unsigned run = 0; run < kRuns; ++run) {
    OwnModelFlight flight(config, vehicle, 1000 + run, GetParam());
    PoseFilter filter(config, vehicle);
    for (int k = 0; k <= kFrames; ++k) {
      const double stamp = kStart + k / kRate_hz;
      flight.advance_to(stamp);
      ASSERT_TRUE(filter.take_frame(flight.frame()).published);
      if (k % 10 == 0 && GetParam()) filter.take_command(flight.fire(stamp));
      if (k > 0) {
        nis_sum += filter.nis();
        ++nis_count;
      }
      if (k > 0 && k % kEvery == 0) {
        const double value = nees(filter.estimate(), flight.error(filter.estimate()));
        nees_at[static_cast<std::size_t>(k / kEvery - 1)] += value;
        nees_sum += value;
      }
    }
    EXPECT_EQ(filter.counters().rejected_gate, 0u) << "run " << run;
  }
  const double per_instant = 12.0 * kRuns;
  for (const double sum : nees_at) {
    EXPECT_GT(sum, chi_square(per_instant, -kZ999));
    EXPECT_LT(sum, chi_square(per_instant, kZ999));
  }
  const double all = per_instant * static_cast<double>(nees_at.size());
  EXPECT_GT(nees_sum, chi_square(all, -kZ999));
  EXPECT_LT(nees_sum, chi_square(all, kZ999));
  EXPECT_GT(nis_sum, chi_square(6.0 * nis_count, -kZ999));
  EXPECT_LT(nis_sum, chi_square(6.0 * nis_count, kZ999));
  std::printf("mean NEES %.3f of 12, mean NIS %.4f of 6\n", 12.0 * nees_sum / all, nis_sum / nis_count);
}

INSTANTIATE_TEST_SUITE_P(KnownInput, PoseFilterConsistency, ::testing::Bool());

// After `frames` good frames the robot is unseen for 0.3 s: only the error dynamics carry the covariance
// there, so that every coupling in them shows. Returns the sum of NEES at the end over the runs.
double coasted_nees(const MocapConfig& config, int frames, bool with_commands, int runs) {
  constexpr int kCoasted = 30;
  Vehicle vehicle = nominal_vehicle();
  vehicle.inertia_kg_m2 << 0.25, 0.3, 0.4;
  double sum = 0.0;
  for (int run = 0; run < runs; ++run) {
    OwnModelFlight flight(config, vehicle, 2000u + static_cast<unsigned>(run), with_commands);
    PoseFilter filter(config, vehicle);
    for (int k = 0; k < frames + kCoasted; ++k) {
      const double stamp = kStart + k / kRate_hz;
      flight.advance_to(stamp);
      PoseFrame frame = flight.frame();
      if (k >= frames) frame.p_WB.setConstant(kNan);
      filter.take_frame(frame);
      if (k % 10 == 0 && with_commands) filter.take_command(flight.fire(stamp));
    }
    EXPECT_EQ(filter.counters().reinitialisations, 0u);
    sum += nees(filter.estimate(), flight.error(filter.estimate()));
  }
  return sum;
}

TEST(PoseFilterErrorDynamics, FastSpinCouplesAttitudeAndRates) {
  constexpr int kRuns = 100;
  MocapConfig config = nominal_config();
  config.initial_angular_velocity_rad_s = 3.0;
  config.unknown_input = {0.01, 0.01};
  config.nis_gate = 1e6;
  const double sum = coasted_nees(config, 5, false, kRuns);
  EXPECT_GT(sum, chi_square(12.0 * kRuns, -kZ999));
  EXPECT_LT(sum, chi_square(12.0 * kRuns, kZ999));
}

TEST(PoseFilterErrorDynamics, ThrustTurnsAttitudeErrorIntoVelocityError) {
  constexpr int kRuns = 100;
  MocapConfig config = nominal_config();
  config.attitude_noise_rad = 0.02;
  config.initial_velocity_m_s = 1e-4;
  config.initial_angular_velocity_rad_s = 1e-3;
  config.thrust_error = 0.0;
  config.known_input = {1e-3, 1e-3};
  const double sum = coasted_nees(config, 1, true, kRuns);
  EXPECT_GT(sum, chi_square(12.0 * kRuns, -kZ999));
  EXPECT_LT(sum, chi_square(12.0 * kRuns, kZ999));
}

}  // namespace
}  // namespace atmos::test
