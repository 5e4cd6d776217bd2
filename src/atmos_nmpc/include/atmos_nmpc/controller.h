// The controller without ROS: odometry, missing frames and set-points in, one command per PWM period out,
// with the timing and loss rules of docs/architecture.md. Times are ROS seconds.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "atmos_model/valve_schedule.h"
#include "atmos_nmpc/control_law.h"
#include "atmos_nmpc/disturbance_observer.h"
#include "atmos_nmpc/solver.h"

namespace atmos {

// Numbers as in atmos_msgs/NmpcStatus.
enum class ControlMode { kSolved = 0, kPreviousPlan = 1, kBraking = 2, kClosed = 3, kWaiting = 4 };
enum class OdometryState { kFresh = 0, kPredicted = 1, kLost = 2, kNone = 3 };

struct OdometrySample {
  double stamp_s;
  State13<double> x;         // of base_link
  bool frames_match = true;  // pose in the world, twist in this robot's body
};

// A pose at rest that holds from `stamp_s` on; a stamp that has passed: at once.
struct Goal {
  double stamp_s;
  Vec3<double> p_WB;
  Quaternion4<double> q_WB;
};

struct ControllerCounters {
  std::uint64_t solves = 0;
  std::uint64_t solver_failures = 0;
  std::uint64_t feedbacks = 0;            // commands from a prepared solution
  std::uint64_t rejected_not_finite = 0;  // odometry, also of a quaternion that is none
  std::uint64_t rejected_order = 0;
  std::uint64_t rejected_frame = 0;
  std::uint64_t rejected_goals = 0;
};

struct DisturbanceEstimate {
  Disturbance mean;
  Eigen::Matrix<double, 6, 6> covariance;  // of d_v (world) and d_w (body)
};

// What the controller did for one period.
struct ControlDecision {
  // Stamped with the start of the period. What is sent at CommandLevel::kThrusters and whenever the valves
  // are closed; at the other levels what the flight controller will make of it.
  ThrusterCommand command;
  BodyWrench wrench = BodyWrench::Zero();  // what is sent at CommandLevel::kWrench
  ControlMode mode = ControlMode::kWaiting;
  OdometryState odometry = OdometryState::kNone;
  double odometry_age_s = 0.0;
  SolveResult solve;      // what the command rests on; with feedback done before the measurement came
  bool feedback = false;  // kSolved, by a first-order update of a prepared solution
  ActiveBounds active;
  std::optional<DisturbanceEstimate> disturbance;  // with an observer that has started
  std::vector<State13<double>> path;  // predicted states at the ends of the stages; empty unless kSolved
};

class Controller {
 public:
  // `lead_s` and the time limit come from the configuration; in lockstep both are off: odometry stamped with
  // the start of a period triggers its solve, and only the iteration cap ends it, so that a run repeats.
  Controller(const Vehicle& vehicle, const ControllerConfig& config, bool lockstep, Stopwatch stopwatch);

  // Takes a set-point; one that is not finite or has no attitude is counted and ignored.
  void add_goal(const Goal& goal);
  bool has_goal() const { return !goals_.empty(); }

  // Each returns a decision when it is the first of a new period, in which case the command is to be sent and
  // then prepare() called; null otherwise. The decision lives until the next call. Where a prepared solution
  // serves, nothing is allocated on the way to it.
  // `now_s`: odometry stamped more than 1 s after it is out of order.
  const ControlDecision* on_odometry(const OdometrySample& sample, double now_s);
  // A frame stamped `stamp_s` in which the robot was not seen.
  const ControlDecision* on_missing_frame(double stamp_s);
  // Watchdog, to be called several times a period: acts when a whole period has passed in which nothing came,
  // and then in each period until something comes.
  const ControlDecision* on_silence(double now_s);

  // After the command has been sent: solves for the state predicted at the next period, so that its
  // measurement is answered at once (config: feedback).
  void prepare();

  const ControllerCounters& counters() const { return counters_; }
  double period_s() const { return vehicle_.pwm.period_s; }
  CommandLevel level() const { return law_->level(); }

 private:
  bool accept(const OdometrySample& sample, double now_s);
  // Number of the period whose solve an event at this time belongs to.
  std::int64_t period_of(double stamp_s) const;
  const ControlDecision* step(double event_s);
  void decide(ControlDecision& decision);
  // State and disturbance at the start of the period.
  ObserverState estimate(double start_s) const;
  ControlTask task_for(std::int64_t period, const ObserverState& now, const Goal& goal);
  void solve(const ObserverState& now, const Goal& goal, ControlDecision& decision);
  void count(const SolveResult& result);
  void fall_back(const State13<double>& x0, ControlDecision& decision);
  // Input k of the law's plan.
  void ask(int k, ControlDecision& decision);
  const Goal* goal_at(double time_s) const;

  Vehicle vehicle_;
  ControllerConfig config_;
  AllocationMatrices thrusters_;
  Allocator allocator_;
  std::unique_ptr<ControlLaw> law_;
  std::optional<DisturbanceObserver> observer_;

  std::deque<Goal> goals_;  // ascending; the first is in force once its stamp has come
  std::optional<OdometrySample> odometry_;
  ValveSchedule commands_;  // our own, as sent
  std::optional<std::int64_t> last_period_;
  bool silent_ = false;  // the last decision was the watchdog's

  ControlDecision decision_;
  ActuatorInput input_;     // scratch
  SolveResult prepared_;    // of the newest prepare()
  bool have_plan_ = false;  // the law's plan may be followed when the solver fails
  std::int64_t plan_period_ = 0;
  std::optional<double> braking_since_s_;
  bool at_rest_ = false;  // braking has ended: closed until a solve succeeds
  ControllerCounters counters_;
};

}  // namespace atmos
