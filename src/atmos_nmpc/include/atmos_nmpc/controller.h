// The controller without ROS: odometry, missing frames and set-points in, one command per PWM period out,
// with the timing and loss rules of docs/architecture.md. Times are ROS seconds.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "atmos_model/valve_schedule.h"
#include "atmos_nmpc/control_law.h"
#include "atmos_nmpc/disturbance_observer.h"
#include "atmos_nmpc/flight_model.h"
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

// What holds from `stamp_s` on, until another goal does: a pose at rest or a trajectory, which is followed
// with preview over the horizon. A stamp that has passed: at once.
struct Goal {
  double stamp_s;
  Vec3<double> p_WB;  // not used with a trajectory
  Quaternion4<double> q_WB;
  std::shared_ptr<const Trajectory> trajectory = nullptr;

  // The reference at a ROS time.
  ReferencePoint at(double time_s) const { return trajectory ? trajectory->at(time_s) : at_rest(p_WB, q_WB); }
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
  BodyWrench wrench = BodyWrench::Zero();  // what is sent at CommandLevel::kWrench, its force at kRate
  double yaw_rate = 0.0;                   // what is sent at CommandLevel::kRate
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
  // Takes a trajectory that holds from its first point on. One that breaks a rule of trajectory_fault(), or
  // is over, is counted and ignored: what holds goes on to hold.
  void add_trajectory(std::vector<TrajectoryPoint> points);
  bool has_goal() const { return !goals_.empty(); }

  // Takes where another robot is [m] and how it moves [m/s, world]. It is predicted to go on so; once its
  // odometry is lost it stands where it was seen last.
  void see_robot(const std::string& name, double stamp_s, const Eigen::Vector2d& p_W,
                 const Eigen::Vector2d& v_W);

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
  struct OtherRobot {
    double stamp_s;
    Eigen::Vector2d p_W, v_W;
  };

  bool accept(const OdometrySample& sample, double now_s);
  // Number of the period whose solve an event at this time belongs to.
  std::int64_t period_of(double stamp_s) const;
  const ControlDecision* step(double event_s);
  void decide(ControlDecision& decision);
  // State and disturbance at the start of the period.
  ObserverState estimate(double start_s) const;
  const ControlTask& task_for(std::int64_t period, const ObserverState& now, const Goal& goal);
  void add_model_disturbance(std::int64_t period, const ObserverState& now);
  void insert(Goal goal);
  Disc predicted_robot(const OtherRobot& robot, double start_s) const;
  void solve(const ObserverState& now, const Goal& goal, ControlDecision& decision);
  void count(const SolveResult& result);
  void fall_back(const State13<double>& x0, ControlDecision& decision);
  // Input k of the law's plan.
  void ask(int k, ControlDecision& decision);
  const Goal* goal_at(double time_s) const;

  // Time at which the command stamped so acts, and the one for which odometry of this stamp holds.
  double acting(double stamp_s) const { return stamp_s + (model_ ? model_->delay_s() : 0.0); }
  double exposed(double stamp_s) const { return stamp_s - (model_ ? model_->latency_s() : 0.0); }

  std::optional<FlightModel> model_;  // before the vehicle, which is its
  Vehicle vehicle_;
  ControllerConfig config_;
  AllocationMatrices thrusters_;
  Allocator allocator_;
  std::unique_ptr<ControlLaw> law_;
  std::optional<DisturbanceObserver> observer_;

  std::deque<Goal> goals_;  // ascending; the first is in force once its stamp has come
  std::map<std::string, OtherRobot> robots_;
  std::optional<OdometrySample> odometry_;
  State13<double> motion_;  // what the newest odometry says of the centre of mass
  ValveSchedule commands_;  // our own, as sent
  std::optional<std::int64_t> last_period_;
  bool silent_ = false;  // the last decision was the watchdog's

  ControlDecision decision_;
  ActuatorInput input_;     // scratch
  ControlTask task_;        // scratch
  SolveResult prepared_;    // of the newest prepare()
  bool have_plan_ = false;  // the law's plan may be followed when the solver fails
  std::int64_t plan_period_ = 0;
  std::optional<double> braking_since_s_;
  bool at_rest_ = false;  // braking has ended: closed until a solve succeeds
  ControllerCounters counters_;
};

}  // namespace atmos
