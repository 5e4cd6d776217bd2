// What a motion-capture system shows of a robot that fires its thrusters: truth from the model's own
// integrator.
#pragma once

#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "atmos_mocap_bridge/pose_filter.h"
#include "atmos_model/predictor.h"

namespace atmos::test {

inline constexpr double kStart = 1234.5;
inline constexpr double kRate_hz = 100.0;
inline constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

inline std::string config_path(const std::string& name) { return std::string(ATMOS_CONFIG_DIR) + "/" + name; }
inline Vehicle nominal_vehicle() { return load_vehicle(config_path("vehicle/atmos.yaml")); }
inline MocapConfig nominal_config() { return load_mocap_config(config_path("mocap/topic.yaml")); }

struct Sample {
  PoseFrame frame;            // noisy
  PlanarState<double> truth;  // at its stamp
};

struct FlightOptions {
  unsigned seed = 1;
  double duration_s = 10.0;
  double noise_m = 0.0003;
  double noise_rad = 0.05 * M_PI / 180.0;
  double thrust_error = 0.0;  // 1 sigma of each thruster's true force, relative to the vehicle file
  bool common_error = false;  // every thruster is stronger by thrust_error instead
  bool fire = true;
};

// One seeded flight in which every PWM period one thruster of each pair fires for a random share of the
// period.
class SensorSimulator {
 public:
  SensorSimulator(const Vehicle& vehicle, const FlightOptions& options) : random_(options.seed) {
    Vehicle actual = vehicle;
    for (Thruster& thruster : actual.thrusters)
      thruster.force_n *= 1.0 + options.thrust_error * (options.common_error ? 1.0 : normal());
    const Plant plant(actual, {}, kStart);
    const std::vector<ThrusterPair> pairs = thruster_pairs(vehicle);
    ValveSchedule valves(plant.thruster_count());
    PlantState state{kStart, {}, plant.initial_hidden()};
    state.body.yaw = 0.7;

    const int frames = static_cast<int>(std::lround(options.duration_s * kRate_hz));
    const int frames_per_period = static_cast<int>(std::lround(vehicle.pwm.period_s * kRate_hz));
    for (int k = 0; k <= frames; ++k) {
      const double stamp = kStart + k / kRate_hz;
      if (k > 0) advance(plant, valves, stamp, state);
      if (k % frames_per_period == 0) {
        ThrusterCommand command{stamp, vehicle.pwm.period_s,
                                std::vector<double>(vehicle.thrusters.size(), 0.0)};
        for (const ThrusterPair& pair : pairs) {
          const double u = uniform();
          const int fired = u > 0.0 ? pair.positive : pair.negative;
          if (options.fire) command.duty[static_cast<std::size_t>(fired)] = std::abs(u);
        }
        valves.add(command);
        commands.push_back(command);
      }
      PoseFrame frame{stamp, {state.body.p_WC.x(), state.body.p_WC.y(), 0.0}, {}};
      frame.p_WB += options.noise_m * Eigen::Vector3d(normal(), normal(), normal());
      const Eigen::Vector3d turn = options.noise_rad * Eigen::Vector3d(normal(), normal(), normal());
      frame.q_WB =
          Eigen::AngleAxisd(state.body.yaw, Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(turn.norm(), turn.norm() > 0.0 ? turn.normalized() : Eigen::Vector3d::UnitX());
      samples.push_back({frame, state.body});
    }
  }

  // Feeds every command that acts before the frame, as the bridge does.
  void feed_commands(PoseFilter& filter, double before_s) {
    for (; next_command_ < commands.size() && commands[next_command_].stamp_s < before_s - 1e-6;
         ++next_command_)
      filter.take_command(commands[next_command_]);
  }

  std::vector<Sample> samples;
  std::vector<ThrusterCommand> commands;

 private:
  double normal() { return normal_(random_); }
  double uniform() { return std::uniform_real_distribution<double>(-1.0, 1.0)(random_); }
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  std::size_t next_command_ = 0;
};

// Estimate minus truth in the order of the error state.
inline Eigen::Matrix<double, 12, 1> error_of(const PoseEstimate& estimate, const Eigen::Vector3d& p,
                                             const Eigen::Quaterniond& q, const Eigen::Vector3d& v,
                                             const Eigen::Vector3d& w) {
  const Eigen::AngleAxisd turn(estimate.q_WB.conjugate() * q);
  const double angle = std::remainder(turn.angle(), 2.0 * M_PI);
  Eigen::Matrix<double, 12, 1> error;
  error << p - estimate.p_WB, angle * turn.axis(), v - estimate.v_WB, w - estimate.w_WB_B;
  return error;
}

inline Eigen::Matrix<double, 12, 1> error_of(const PoseEstimate& estimate, const PlanarState<double>& truth) {
  return error_of(estimate, {truth.p_WC.x(), truth.p_WC.y(), 0.0},
                  Eigen::Quaterniond(Eigen::AngleAxisd(truth.yaw, Eigen::Vector3d::UnitZ())),
                  {truth.v_WC.x(), truth.v_WC.y(), 0.0}, {0.0, 0.0, truth.yaw_rate});
}

inline double nees(const PoseEstimate& estimate, const Eigen::Matrix<double, 12, 1>& error) {
  return error.dot(estimate.covariance.ldlt().solve(error));
}

// Quantile of chi-square with `degrees` of freedom at `z` standard normal deviations (Wilson and Hilferty,
// 1931).
inline double chi_square(double degrees, double z) {
  const double c = 2.0 / (9.0 * degrees);
  return degrees * std::pow(1.0 - c + z * std::sqrt(c), 3.0);
}

}  // namespace atmos::test
