#include "atmos_sim/pilot.h"

#include <algorithm>
#include <cmath>

#include "atmos_model/allocator.h"
#include "atmos_sim/simulation.h"

namespace atmos {

namespace {

constexpr double kSameInstant = 1e-6;       // s
constexpr double kDelay = 0.01;             // s from exposure to use
constexpr double kShortest = 0.002;         // s, pulses below are left out
constexpr double kFarthest = 0.6;           // m, rad: errors beyond count as this
constexpr double kLongestPrediction = 0.5;  // s

// Luenberger observer of position and velocity of the measured point under the nominal accelerations.
class Observer {
 public:
  explicit Observer(double bandwidth_rad_s) : bandwidth_(bandwidth_rad_s) {}

  void take(const MocapFrame& frame, double time_s, const Eigen::Vector3d& acceleration) {
    if (!frame.pose.p_W.allFinite()) return;
    const Eigen::Vector3d seen(frame.pose.p_W.x(), frame.pose.p_W.y(), frame.pose.yaw);
    if (!started_) {
      position_ = seen;
      started_ = true;
    } else {
      const double dt = std::min(time_s - time_s_, kLongestPrediction);
      position_ += dt * velocity_ + 0.5 * dt * dt * acceleration;
      velocity_ += dt * acceleration;
      Eigen::Vector3d error = seen - position_;
      error.z() = wrap_angle(error.z());
      position_ += std::min(1.0, 2.0 * bandwidth_ * dt) * error;
      velocity_ += std::min(1.0 / dt, bandwidth_ * bandwidth_ * dt) * error;
    }
    time_s_ = time_s;
  }
  const Eigen::Vector3d& position() const { return position_; }
  const Eigen::Vector3d& velocity() const { return velocity_; }

 private:
  double bandwidth_;
  bool started_ = false;
  double time_s_ = 0.0;
  Eigen::Vector3d position_ = Eigen::Vector3d::Zero(), velocity_ = Eigen::Vector3d::Zero();
};

const SetPoint& set_point_at(const Scenario& scenario, double since_start_s) {
  const auto after =
      std::upper_bound(scenario.set_points.begin(), scenario.set_points.end(), since_start_s,
                       [](double t, const SetPoint& point) { return t < point.time_s - kSameInstant; });
  return after == scenario.set_points.begin() ? *after : *(after - 1);
}

double limited(double error) { return std::clamp(error, -kFarthest, kFarthest); }

}  // namespace

PilotedFlight fly_piloted(const Scenario& scenario, const PilotGains& gains, double start_s) {
  Simulation simulation(scenario, start_s);
  Robot& robot = simulation.robot();
  MocapSensor mocap(scenario.mocap, scenario.seed, start_s);
  const Allocator allocator(scenario.vehicle);
  const double mass = scenario.vehicle.mass_kg, inertia = scenario.vehicle.inertia_kg_m2.z();
  const double stiffness = gains.natural_frequency_rad_s * gains.natural_frequency_rad_s;
  const double damping = 2.0 * gains.damping * gains.natural_frequency_rad_s;
  const double period_s = scenario.vehicle.pwm.period_s;

  PilotedFlight flight;
  Observer observer(gains.observer_rad_s);
  Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();  // world, what the last command should give
  std::size_t used = 0;
  Allocation allocation;
  const auto frames_until = [&](double until_s) {
    while (mocap.next_frame_s() <= until_s + kSameInstant) {
      simulation.advance_to(mocap.next_frame_s());
      const double instant = simulation.time_s() - robot.plant().properties().mocap_latency_s;
      const PlanarState<double> shown = robot.plant().measured(robot.center_of_mass_at(instant));
      flight.rows.push_back({{simulation.time_s(), robot.truth(), mocap.expose(robot)}, shown});
    }
    simulation.advance_to(until_s);
  };
  const auto periods = static_cast<int>(std::floor(scenario.duration_s / period_s + 1e-6));
  for (int k = 0; k < periods; ++k) {
    const double now = start_s + k * period_s;
    frames_until(now);
    for (; used < flight.rows.size() && flight.rows[used].row.time_s <= now - kDelay + kSameInstant; ++used)
      observer.take(flight.rows[used].row.frame, flight.rows[used].row.time_s, acceleration);

    const SetPoint& target = set_point_at(scenario, now - start_s);
    const Eigen::Vector3d at = observer.position();
    const Eigen::Vector3d error(limited(target.x_m - at.x()), limited(target.y_m - at.y()),
                                limited(wrap_angle(target.yaw_rad - at.z())));
    const Eigen::Vector3d wanted = stiffness * error - damping * observer.velocity();
    const Eigen::Matrix2d R_WB = rotation_WB(at.z());
    const Eigen::Vector2d force_B = mass * (R_WB.transpose() * wanted.head<2>());
    allocator.allocate_into({force_B.x(), force_B.y(), inertia * wanted.z()}, allocation);
    ThrusterCommand command{now, period_s, allocation.duty};
    for (double& duty : command.duty) {
      if (duty * period_s < kShortest) duty = 0.0;
    }
    robot.command(command);
    flight.commands.push_back(std::move(command));
    acceleration.head<2>() = R_WB * allocation.achieved.head<2>() / mass;
    acceleration.z() = allocation.achieved.z() / inertia;
  }
  frames_until(start_s + periods * period_s);
  return flight;
}

}  // namespace atmos
