// What the controller decides with: one formulation and its solver behind one interface. Timing and loss
// rules are atmos::Controller's.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <memory>
#include <vector>

#include "atmos_model/allocator.h"
#include "atmos_model/rigid_body.h"
#include "atmos_nmpc/config.h"
#include "atmos_nmpc/rigid_body_step.h"
#include "atmos_nmpc/solver.h"
#include "atmos_nmpc/trajectory.h"

namespace atmos {

// What the flight controller is asked for (docs/architecture.md, "Command levels").
enum class CommandLevel { kThrusters, kWrench, kRate };

// What is asked of the actuators for one period. Filling one whose duty has its size already allocates
// nothing.
struct ActuatorInput {
  BodyWrench wrench = BodyWrench::Zero();  // kWrench: as sent; kRate: its force; otherwise zero
  double yaw_rate = 0.0;                   // kRate: as sent
  std::vector<double> duty;  // kThrusters: as sent; otherwise what the flight controller's allocator makes of
                             // it, at kRate without the torque, which is the rate level's own
};

// One period's problem. The lists hold what belongs to the stages from the first on; their last element
// belongs to all stages after it too, so that a set-point is a list of one.
struct ControlTask {
  std::int64_t period = 0;  // its number: the previous plan is shifted by the periods that have passed
  State13<double> x0 = State13<double>::Zero();  // at the start of the period
  std::vector<ReferencePoint> reference;         // at the starts of stages 0 ... N
  std::vector<Disturbance> disturbance;          // over stages 0 ... N-1
  std::vector<Disc> robots;                      // to keep away from

  const ReferencePoint& reference_at(int k) const { return at(reference, k); }
  const Disturbance& disturbance_at(int k) const { return at(disturbance, k); }

 private:
  template <class T>
  static const T& at(const std::vector<T>& list, int k) {
    return list[std::min(static_cast<std::size_t>(k), list.size() - 1)];
  }
};

class ControlLaw {
 public:
  virtual ~ControlLaw() = default;

  virtual CommandLevel level() const = 0;
  // On success the plan below is this task's; on failure it stays that of the last success.
  virtual SolveResult solve(const ControlTask& task) = 0;
  // The same ahead of time, for a period whose state is still a prediction, and whatever feedback() needs.
  // Not every law has a use for it.
  virtual SolveResult prepare(const ControlTask&) { return {}; }
  // At once and without allocation: corrects the first input of what was prepared for this very period, now
  // that its state is known. False, and nothing is changed, when that does not serve: another reference,
  // nothing prepared, or so far from what was predicted that the task must be solved.
  virtual bool feedback(const ControlTask&) { return false; }
  // The next solve starts from nothing known.
  virtual void forget() = 0;

  // The plan: input k acts over period `period of its task` + k, k in [0, stages).
  virtual int stages() const = 0;
  virtual void input(int k, ActuatorInput& result) const = 0;
  // Predicted state at the start of stage k, k in [0, stages].
  virtual State13<double> state(int k) const = 0;
  virtual ActiveBounds active_bounds() const = 0;  // along the plan
  // What holds a body at rest with attitude q_WB against a disturbance, within the inputs' bounds.
  virtual void holding_input(const Quaternion4<double>& q_WB, const Disturbance& disturbance,
                             ActuatorInput& result) = 0;
};

// The law that the configuration names. `time_limit`: whether the configured one holds. Throws
// std::invalid_argument when the vehicle cannot be flown with it.
std::unique_ptr<ControlLaw> make_control_law(const Vehicle& vehicle, const ControllerConfig& config,
                                             bool time_limit, Stopwatch stopwatch);

}  // namespace atmos
