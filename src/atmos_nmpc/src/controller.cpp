#include "atmos_nmpc/controller.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "atmos_nmpc/prediction.h"

namespace atmos {

namespace {

using namespace state13;

constexpr double kStampTolerance = 1e-3;      // s; the grid's own (docs/conventions.md)
constexpr double kFutureTolerance = 1.0;      // s; a stamp further ahead would block all that follow
constexpr double kQuaternionTolerance = 0.1;  // of the norm; further off it is no attitude

bool is_attitude(const Quaternion4<double>& q) { return std::abs(q.norm() - 1.0) < kQuaternionTolerance; }

// What keeps the sampled velocity of a robot at rest on average from zero: its pulses stand at the start of
// the period, so that at a sample it has just been pushed back (docs/offset_free.md). World velocity and body
// rate of a robot with attitude q_WB whose valves repeat `duty`.
Eigen::Matrix<double, 6, 1> pulse_velocity(const Vehicle& vehicle, const AllocationMatrices& thrusters,
                                           const std::vector<double>& duty, const Quaternion4<double>& q_WB) {
  if (vehicle.actuation == Actuation::kContinuous) return Eigen::Matrix<double, 6, 1>::Zero();
  Vec3<double> impulse = Vec3<double>::Zero(), turn = Vec3<double>::Zero();
  for (std::size_t i = 0; i < duty.size(); ++i) {
    const double push =
        -0.5 * vehicle.pwm.period_s * duty[i] * (1.0 - duty[i]) * vehicle.thrusters[i].force_n;
    impulse += push * thrusters.D.col(static_cast<Eigen::Index>(i));
    turn += push * thrusters.L.col(static_cast<Eigen::Index>(i));
  }
  Eigen::Matrix<double, 6, 1> velocity;
  velocity << rotate<double>(q_WB, impulse) / vehicle.mass_kg, turn.cwiseQuotient(vehicle.inertia_kg_m2);
  return velocity;
}

}  // namespace

Controller::Controller(const Vehicle& vehicle, const ControllerConfig& config, bool lockstep,
                       Stopwatch stopwatch)
    : vehicle_(vehicle),
      config_(config),
      thrusters_(thruster_matrices(vehicle)),
      allocator_(vehicle),
      law_(make_control_law(vehicle, config, !lockstep, std::move(stopwatch))),
      commands_(static_cast<int>(vehicle.thrusters.size()), {}, vehicle.actuation) {
  if (config.observer) observer_.emplace(vehicle, *config.observer);
  if (lockstep) config_.lead_s = 0.0;
  decision_.command.duty.reserve(vehicle.thrusters.size());
  decision_.path.reserve(static_cast<std::size_t>(law_->stages()) + 1);
  input_.duty.reserve(vehicle.thrusters.size());
}

void Controller::add_goal(const Goal& goal) {
  if (!std::isfinite(goal.stamp_s) || !goal.p_WB.allFinite() || !goal.q_WB.allFinite() ||
      !is_attitude(goal.q_WB)) {
    ++counters_.rejected_goals;
    return;
  }
  Goal accepted = goal;
  accepted.q_WB.normalize();
  // What is asked for the past holds at once, and takes the place of what holds now.
  if (last_period_) {
    const double now_s = static_cast<double>(*last_period_) * period_s();
    const Goal* in_force = goal_at(now_s);
    accepted.stamp_s = std::max({goal.stamp_s, now_s, in_force == nullptr ? now_s : in_force->stamp_s});
  }
  const auto later = std::upper_bound(goals_.begin(), goals_.end(), accepted.stamp_s,
                                      [](double stamp, const Goal& other) { return stamp < other.stamp_s; });
  goals_.insert(later, accepted);
}

const Goal* Controller::goal_at(double time_s) const {
  const Goal* in_force = nullptr;
  for (const Goal& goal : goals_) {
    if (goal.stamp_s > time_s + kStampTolerance) break;
    in_force = &goal;
  }
  return in_force;
}

bool Controller::accept(const OdometrySample& sample, double now_s) {
  if (!std::isfinite(sample.stamp_s) || !sample.x.allFinite() ||
      !is_attitude(sample.x.segment<4>(kQuaternion))) {
    ++counters_.rejected_not_finite;
  } else if (!sample.frames_match) {
    ++counters_.rejected_frame;
  } else if ((odometry_ && sample.stamp_s <= odometry_->stamp_s) ||
             sample.stamp_s > now_s + kFutureTolerance) {
    ++counters_.rejected_order;
  } else {
    odometry_ = sample;
    odometry_->x.segment<4>(kQuaternion).normalize();
    return true;
  }
  return false;
}

std::int64_t Controller::period_of(double stamp_s) const {
  return static_cast<std::int64_t>(std::floor((stamp_s + config_.lead_s + kStampTolerance) / period_s()));
}

const ControlDecision* Controller::on_odometry(const OdometrySample& sample, double now_s) {
  const bool accepted = accept(sample, now_s);
  // Odometry that cannot be used still says that a frame was due: the period gets its decision all the same.
  if (!accepted && (!std::isfinite(sample.stamp_s) || sample.stamp_s > now_s + kFutureTolerance))
    return nullptr;
  silent_ = false;
  return step(sample.stamp_s);
}

const ControlDecision* Controller::on_missing_frame(double stamp_s) {
  if (!std::isfinite(stamp_s)) return nullptr;
  silent_ = false;
  return step(stamp_s);
}

const ControlDecision* Controller::on_silence(double now_s) {
  if (last_period_ && period_of(now_s) < *last_period_ + (silent_ ? 1 : 2)) return nullptr;
  silent_ = true;
  return step(now_s);
}

const ControlDecision* Controller::step(double event_s) {
  const std::int64_t period = period_of(event_s);
  if (last_period_ && period <= *last_period_) return nullptr;
  last_period_ = period;

  decision_.command.stamp_s = static_cast<double>(period) * period_s();
  decision_.command.period_s = period_s();
  decision_.command.duty.assign(vehicle_.thrusters.size(), 0.0);
  decision_.wrench.setZero();
  decision_.mode = ControlMode::kWaiting;
  decision_.odometry = OdometryState::kNone;
  decision_.odometry_age_s = 0.0;
  decision_.solve = {};
  decision_.feedback = false;
  decision_.active = {};
  decision_.disturbance.reset();
  decision_.path.clear();
  while (goals_.size() > 1 && goals_[1].stamp_s <= decision_.command.stamp_s + kStampTolerance)
    goals_.pop_front();
  decide(decision_);
  commands_.add(decision_.command);
  commands_.forget_before(decision_.command.stamp_s - config_.limits.odometry_lost_s - 2.0 * period_s());
  return &decision_;
}

void Controller::prepare() {
  // A solver in trouble has the whole next period for itself.
  if (config_.feedback == FeedbackKind::kFull || decision_.mode != ControlMode::kSolved) return;
  const std::int64_t next = *last_period_ + 1;
  const double start_s = static_cast<double>(next) * period_s();
  if (observer_) observer_->predict_ahead(start_s - config_.lead_s, commands_);
  prepared_ = law_->prepare(task_for(next, estimate(start_s), *goal_at(start_s)));
  if (prepared_.status == SolverStatus::kNotRun) return;
  count(prepared_);
  if (is_success(prepared_.status)) plan_period_ = next;
}

void Controller::decide(ControlDecision& decision) {
  const double start_s = decision.command.stamp_s;
  const Goal* goal = goal_at(start_s);
  if (!odometry_) return;
  const double age_s = start_s - odometry_->stamp_s;
  decision.odometry_age_s = age_s;
  const bool lost = age_s > config_.limits.odometry_lost_s + kStampTolerance;
  decision.odometry = lost                                                        ? OdometryState::kLost
                      : age_s > config_.limits.odometry_fresh_s + kStampTolerance ? OdometryState::kPredicted
                                                                                  : OdometryState::kFresh;
  if (lost) {
    // Nothing is known of the state any more: neither plan nor braking goes on when odometry returns.
    decision.mode = goal == nullptr ? ControlMode::kWaiting : ControlMode::kClosed;
    have_plan_ = at_rest_ = false;
    law_->forget();
    if (observer_) observer_->reset();
    braking_since_s_.reset();
    return;
  }
  if (observer_ && (!observer_->started() || observer_->stamp_s() < odometry_->stamp_s))
    observer_->update(odometry_->stamp_s, odometry_->x, commands_);
  const ObserverState now = estimate(start_s);
  if (observer_) {
    decision.disturbance = {now.d, observer_->covariance().bottomRightCorner<6, 6>()};
  }
  if (goal == nullptr) return;
  solve(now, *goal, decision);
  if (decision.mode != ControlMode::kSolved) fall_back(now.x, decision);
}

ObserverState Controller::estimate(double start_s) const {
  if (observer_) return observer_->predicted(start_s, commands_);
  return {predict(vehicle_, thrusters_, commands_, odometry_->x, odometry_->stamp_s, start_s), {}};
}

void Controller::ask(int k, ControlDecision& decision) {
  law_->input(k, input_);
  decision.command.duty = input_.duty;
  decision.wrench = input_.wrench;
}

ControlTask Controller::task_for(std::int64_t period, const ObserverState& now, const Goal& goal) {
  ControlTask task{period, now.x, State13<double>::Zero(), now.d};
  task.reference.segment<3>(kPosition) = goal.p_WB;
  task.reference.segment<4>(kQuaternion) = goal.q_WB;
  if (observer_) {
    // The prediction holds forces over the period, for which a robot held at rest has no velocity.
    law_->holding_input(goal.q_WB, now.d, input_);
    const auto pulses = pulse_velocity(vehicle_, thrusters_, input_.duty, goal.q_WB);
    task.x0.segment<3>(kVelocity) -= pulses.head<3>();
    task.x0.segment<3>(kAngularVelocity) -= pulses.tail<3>();
  }
  return task;
}

void Controller::count(const SolveResult& result) {
  ++counters_.solves;
  if (!is_success(result.status)) ++counters_.solver_failures;
}

void Controller::solve(const ObserverState& now, const Goal& goal, ControlDecision& decision) {
  const ControlTask task = task_for(*last_period_, now, goal);
  decision.feedback = law_->feedback(task);
  if (decision.feedback) {
    decision.solve = prepared_;
    ++counters_.feedbacks;
  } else {
    decision.solve = law_->solve(task);
    count(decision.solve);
    if (!is_success(decision.solve.status)) return;
  }
  plan_period_ = *last_period_;
  have_plan_ = true;
  at_rest_ = false;
  braking_since_s_.reset();
  decision.mode = ControlMode::kSolved;
  ask(0, decision);
  decision.active = law_->active_bounds();
  for (int k = 0; k <= law_->stages(); ++k) decision.path.push_back(law_->state(k));
}

void Controller::fall_back(const State13<double>& x0, ControlDecision& decision) {
  const double start_s = decision.command.stamp_s;
  const std::int64_t stage = *last_period_ - plan_period_;
  if (have_plan_ && stage < law_->stages() &&
      static_cast<double>(stage) * period_s() <= config_.limits.plan_reuse_s + kStampTolerance) {
    decision.mode = ControlMode::kPreviousPlan;
    ask(static_cast<int>(stage), decision);
    return;
  }
  if (decision.odometry != OdometryState::kFresh) {  // no braking on a guessed velocity
    decision.mode = ControlMode::kClosed;
    return;
  }
  if (!braking_since_s_) braking_since_s_ = start_s;
  const Quaternion4<double> q = x0.segment<4>(kQuaternion);
  const Quaternion4<double> q_BW(q[0], -q[1], -q[2], -q[3]);
  const Vec3<double> v_B = rotate<double>(q_BW, x0.segment<3>(kVelocity));
  const double yaw_rate = x0[kAngularVelocity + 2];
  const bool slow = v_B.head<2>().norm() < config_.limits.rest_speed_m_s &&
                    std::abs(yaw_rate) < config_.limits.rest_rate_rad_s;
  if (slow || start_s - *braking_since_s_ >= config_.limits.braking_s - kStampTolerance) at_rest_ = true;
  if (at_rest_) {
    decision.mode = ControlMode::kClosed;
    return;
  }
  decision.mode = ControlMode::kBraking;
  const double gain = -1.0 / config_.limits.braking_time_constant_s;
  const BodyWrench wrench(gain * vehicle_.mass_kg * v_B[0], gain * vehicle_.mass_kg * v_B[1],
                          gain * vehicle_.inertia_kg_m2[2] * yaw_rate);
  // Beyond the thrusters' limits the allocator shrinks the whole wrench, so that it still opposes the motion.
  const Allocation allocation = allocator_.allocate(wrench);
  decision.command.duty = allocation.duty;
  if (level() == CommandLevel::kWrench) decision.wrench = wrench;
}

}  // namespace atmos
