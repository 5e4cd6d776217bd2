// A flight without ROS: the controller against the model's own plant, with seeded measurement noise. For
// tests and benchmarks.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <functional>
#include <random>
#include <utility>
#include <vector>

#include "atmos_model/predictor.h"
#include "atmos_nmpc/controller.h"

namespace atmos::testing {

struct Noise {
  double position_m = 0.0;  // standard deviations per axis
  double velocity_m_s = 0.0;
  double yaw_rad = 0.0;
  double rate_rad_s = 0.0;
};

constexpr double kStart = 1234.5;  // s: stateful code must not rely on a clock that starts at 0
constexpr double kDegree = M_PI / 180.0;
// What a lab's motion capture and the filter behind it leave.
constexpr Noise kLabNoise = {3e-4, 2e-3, 0.05 * kDegree, 2e-3};

// For controllers whose solve times do not matter.
inline double stopped_clock() { return 0.0; }

// Planar pose as a goal and as a state.
inline Goal planar_goal(double stamp_s, double x, double y, double yaw) {
  return {stamp_s, {x, y, 0.0}, {std::cos(0.5 * yaw), 0.0, 0.0, std::sin(0.5 * yaw)}};
}
inline State13<double> state13_of(const PlanarState<double>& body) {
  State13<double> x = State13<double>::Zero();
  x.segment<2>(state13::kPosition) = body.p_WC;
  x.segment<2>(state13::kVelocity) = body.v_WC;
  x[state13::kQuaternion] = std::cos(0.5 * body.yaw);
  x[state13::kQuaternion + 3] = std::sin(0.5 * body.yaw);
  x[state13::kAngularVelocity + 2] = body.yaw_rate;
  return x;
}

struct FlightRow {
  double time_s;  // ROS time, start of the period
  PlanarState<double> truth;
  ControlDecision decision;
};

// The robot under commands of one controller, one odometry a period; on the ideal floor unless there are
// effects.
class Flight {
 public:
  Flight(const Vehicle& vehicle, Controller& controller, double start_s, const PlanarState<double>& start,
         Noise noise, std::uint32_t seed, const std::vector<Effect>& effects = {})
      : plant_(vehicle, effects, start_s),
        valves_(static_cast<int>(vehicle.thrusters.size()), plant_.properties().timing),
        controller_(controller),
        noise_(noise),
        random_(seed) {
    state_.time_s = start_s;
    state_.body = exposed_ = center_of_mass_state(start, plant_.properties().com_B);
    state_.hidden = plant_.initial_hidden();
    period_ = std::llround(start_s / vehicle.pwm.period_s);
  }

  double now() const { return static_cast<double>(period_) * controller_.period_s(); }
  // Motion of base_link.
  PlanarState<double> truth() const { return geometric_center_state(state_.body, plant_.properties().com_B); }

  OdometrySample measure() {
    PlanarState<double> seen = plant_.measured(exposed_);
    seen.p_WC += noise_.position_m * Eigen::Vector2d(normal_(random_), normal_(random_));
    seen.v_WC += noise_.velocity_m_s * Eigen::Vector2d(normal_(random_), normal_(random_));
    seen.yaw += noise_.yaw_rad * normal_(random_);
    seen.yaw_rate += noise_.rate_rad_s * normal_(random_);
    return {now(), state13_of(seen), true};
  }

  // Who makes duties of decisions and the measured yaw rate; otherwise the controller's own allocation, which
  // at rate level has no torque.
  using FlightControllerStub = std::function<ThrusterCommand(const ControlDecision&, double yaw_rate)>;
  void set_flight_controller(FlightControllerStub stub) { flight_controller_ = std::move(stub); }

  // One period with odometry, or with a missing frame.
  FlightRow period(bool seen = true) {
    const ControlDecision* decision =
        seen ? controller_.on_odometry(measure(), now()) : controller_.on_missing_frame(now());
    FlightRow row{now(), truth(), *decision};
    carry_out(row.decision);
    return row;
  }
  // The rest of a period whose decision has been made.
  void carry_out(const ControlDecision& decision) {
    valves_.add(flight_controller_ ? flight_controller_(decision, truth().yaw_rate) : decision.command);
    controller_.prepare();
    ++period_;
    advance(plant_, valves_, now() - plant_.properties().mocap_latency_s, state_);
    exposed_ = state_.body;
    advance(plant_, valves_, now(), state_);
    valves_.forget_before(now() - 1.0);
  }

 private:
  Plant plant_;
  ValveSchedule valves_;
  Controller& controller_;
  FlightControllerStub flight_controller_;
  Noise noise_;
  std::mt19937 random_;
  std::normal_distribution<double> normal_;
  PlantState state_;
  PlanarState<double> exposed_;  // what the newest frame shows of the centre of mass
  std::int64_t period_;
};

}  // namespace atmos::testing
