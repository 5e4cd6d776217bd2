// Extended Kalman filter for offset-free control (paper, ctl:disturbance_wrench): position, velocity,
// attitude, angular velocity and the disturbances d_v and d_w out of measured poses and the valves' openings.
// Why the pose alone is measured, and why the offset is zero: docs/offset_free.md.
#pragma once

#include <Eigen/Core>
#include <optional>

#include "atmos_model/allocation.h"
#include "atmos_model/valve_schedule.h"
#include "atmos_model/vehicle.h"
#include "atmos_nmpc/config.h"
#include "atmos_nmpc/prediction.h"
#include "atmos_nmpc/rigid_body_step.h"

namespace atmos {

// Order of the error state: position, velocity (m, m/s, world), attitude (rad, body: R_WB = R_estimated
// Exp(error)), angular velocity (rad/s, body), d_v (m/s^2, world), d_w (rad/s^2, body).
namespace observer_error {
enum Index {
  kPosition = 0,
  kVelocity = 3,
  kAttitude = 6,
  kRate = 9,
  kLinear = 12,
  kAngular = 15,
  kSize = 18
};
}
using ObserverVector = Eigen::Matrix<double, observer_error::kSize, 1>;
using ObserverMatrix = Eigen::Matrix<double, observer_error::kSize, observer_error::kSize>;

struct ObserverState {
  State13<double> x = State13<double>::Zero();
  Disturbance d;
};

// state (+) error, and the error that leads from `from` to `to`.
ObserverState plus(const ObserverState& state, const ObserverVector& error);
ObserverVector minus(const ObserverState& to, const ObserverState& from);

// The motion that the filter believes in: the rigid body under the openings' nominal thrust and constant
// disturbances.
class ObserverModel {
 public:
  ObserverModel(const Vehicle& vehicle, const ObserverConfig& config);

  // The state after dt [s] under constant openings (one per thruster, [0, 1]).
  ObserverState next(const ObserverState& state, const Openings& openings, double dt) const;
  // Jacobian of next() with respect to the error state, to third order in dt.
  ObserverMatrix jacobian(const ObserverState& state, const Openings& openings, double dt) const;
  // Covariance of what next() does not know.
  ObserverMatrix noise(const ObserverState& state, const Openings& openings, double dt) const;

 private:
  Vehicle vehicle_;
  ObserverConfig config_;
  AllocationMatrices thrusters_;
};

// Times are ROS seconds.
class DisturbanceObserver {
 public:
  DisturbanceObserver(const Vehicle& vehicle, const ObserverConfig& config);

  // Takes the pose in `measured` at stamp_s, later than any before; the first one's velocities start the
  // filter. `valves`: the commands since the last update. A pose beyond the gate is refused;
  // config.reset_after of them in a row start the filter anew. Returns whether the pose was taken.
  bool update(double stamp_s, const State13<double>& measured, const ValveSchedule& valves);
  // Does most of the work of the next update() beforehand, if its stamp will not lie before until_s: carries
  // a copy of the estimate to that time. `valves` up to then must not change any more.
  void predict_ahead(double until_s, const ValveSchedule& valves);
  // Nothing is known any more.
  void reset() { started_ = false; }

  bool started() const { return started_; }
  double stamp_s() const { return belief_.stamp_s; }
  const ObserverState& estimate() const { return belief_.state; }
  const ObserverMatrix& covariance() const { return belief_.covariance; }
  // The estimate carried on to until_s >= stamp_s().
  ObserverState predicted(double until_s, const ValveSchedule& valves) const;
  // Normalised innovation squared of the newest pose; 6 degrees of freedom.
  double nis() const { return nis_; }

 private:
  struct Belief {
    double stamp_s = 0.0;
    ObserverState state;
    ObserverMatrix covariance = ObserverMatrix::Zero();
  };

  void start(double stamp_s, const State13<double>& measured);
  void carry(Belief& belief, double until_s, const ValveSchedule& valves) const;
  // Calls visit(openings, dt) for every stretch of constant openings in between, none longer than 20 ms.
  template <class Visit>
  void for_each_stretch(double from_s, double until_s, const ValveSchedule& valves, const Visit& visit) const;

  ObserverConfig config_;
  ObserverModel model_;
  Disturbance limit_;  // what the thrusters could cancel, per axis
  bool started_ = false;
  Belief belief_;
  std::optional<Belief> ahead_;  // the same, carried on
  double nis_ = 0.0;
  int refused_ = 0;  // in a row
};

}  // namespace atmos
