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

std::optional<FlightModel> model_of(const Vehicle& vehicle, const ControllerConfig& config) {
  if (config.model.empty()) return std::nullopt;
  return FlightModel(vehicle, config.model);
}

}  // namespace

Controller::Controller(const Vehicle& vehicle, const ControllerConfig& config, bool lockstep,
                       Stopwatch stopwatch)
    : model_(model_of(vehicle, config)),
      vehicle_(model_ ? model_->vehicle() : vehicle),
      config_(config),
      thrusters_(thruster_matrices(vehicle_)),
      allocator_(vehicle_),
      law_(make_control_law(vehicle_, config, !lockstep, std::move(stopwatch))),
      commands_(static_cast<int>(vehicle.thrusters.size()), model_ ? model_->timing() : ValveTiming{},
                vehicle.actuation) {
  if (config.observer) observer_.emplace(vehicle_, *config.observer);
  if (lockstep) config_.lead_s = 0.0;
  decision_.command.duty.reserve(vehicle.thrusters.size());
  decision_.path.reserve(static_cast<std::size_t>(law_->stages()) + 1);
  task_.reference.reserve(static_cast<std::size_t>(law_->stages()) + 1);
  task_.disturbance.reserve(static_cast<std::size_t>(law_->stages()));
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
  insert(std::move(accepted));
}

void Controller::add_trajectory(std::vector<TrajectoryPoint> points) {
  const bool over = !points.empty() && last_period_ &&
                    points.back().time_s <= static_cast<double>(*last_period_) * period_s();
  if (!trajectory_fault(points).empty() || over) {
    ++counters_.rejected_goals;
    return;
  }
  Goal goal{points.front().time_s, points.front().p_WB, points.front().q_WB};
  goal.trajectory = std::make_shared<const Trajectory>(std::move(points));
  insert(std::move(goal));
}

void Controller::insert(Goal goal) {
  // What is asked for the past holds at once, and takes the place of what holds now.
  if (last_period_) {
    const double now_s = static_cast<double>(*last_period_) * period_s();
    const Goal* in_force = goal_at(now_s);
    goal.stamp_s = std::max({goal.stamp_s, now_s, in_force == nullptr ? now_s : in_force->stamp_s});
  }
  const auto later = std::upper_bound(goals_.begin(), goals_.end(), goal.stamp_s,
                                      [](double stamp, const Goal& other) { return stamp < other.stamp_s; });
  goals_.insert(later, std::move(goal));
}

void Controller::see_robot(const std::string& name, double stamp_s, const Eigen::Vector2d& p_W,
                           const Eigen::Vector2d& v_W) {
  if (std::isfinite(stamp_s) && p_W.allFinite() && v_W.allFinite()) robots_[name] = {stamp_s, p_W, v_W};
}

Disc Controller::predicted_robot(const OtherRobot& robot, double start_s) const {
  const double age_s = start_s - robot.stamp_s;
  const bool seen = age_s <= config_.limits.odometry_lost_s + kStampTolerance;
  const Eigen::Vector2d v_W = seen ? robot.v_W : Eigen::Vector2d::Zero();
  return {robot.p_W + age_s * v_W, config_.robot_distance_m, period_s() * v_W};
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
  decision_.yaw_rate = 0.0;
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
  if (observer_) observer_->predict_ahead(exposed(start_s - config_.lead_s), commands_);
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
    if (model_) model_->forget();
    braking_since_s_.reset();
    return;
  }
  motion_ = model_ ? model_->from_measured(odometry_->x) : odometry_->x;
  const double seen_s = exposed(odometry_->stamp_s);
  if (observer_ && (!observer_->started() || observer_->stamp_s() < seen_s))
    observer_->update(seen_s, motion_, commands_);
  if (model_) model_->observe(seen_s, motion_, commands_);
  const ObserverState now = estimate(start_s);
  if (observer_) {
    decision.disturbance = {now.d, observer_->covariance().bottomRightCorner<6, 6>()};
  }
  if (goal == nullptr) return;
  solve(now, *goal, decision);
  if (decision.mode != ControlMode::kSolved) fall_back(now.x, decision);
}

ObserverState Controller::estimate(double start_s) const {
  if (observer_) return observer_->predicted(acting(start_s), commands_);
  if (model_) return {model_->predict(acting(start_s), commands_), {}};
  return {predict(vehicle_, thrusters_, commands_, odometry_->x, odometry_->stamp_s, start_s), {}};
}

void Controller::ask(int k, ControlDecision& decision) {
  law_->input(k, input_);
  if (model_) model_->compensate(decision.command.stamp_s, input_.duty);
  decision.command.duty = input_.duty;
  decision.wrench = input_.wrench;
  decision.yaw_rate = input_.yaw_rate;
}

const ControlTask& Controller::task_for(std::int64_t period, const ObserverState& now, const Goal& goal) {
  const double start_s = static_cast<double>(period) * period_s();
  task_.period = period;
  task_.x0 = now.x;
  task_.reference.clear();
  for (int k = 0; k <= (goal.trajectory ? law_->stages() : 0); ++k) {
    task_.reference.push_back(goal.at(acting(start_s) + static_cast<double>(k) * period_s()));
    if (model_) task_.reference.back() = model_->of_center_of_mass(task_.reference.back());
  }
  task_.robots.clear();
  for (const auto& robot : robots_) task_.robots.push_back(predicted_robot(robot.second, start_s));
  task_.disturbance.assign(1, now.d);
  if (model_) add_model_disturbance(period, now);
  if (observer_ || model_) {
    // The prediction holds forces over the period, for which a robot held at rest has no velocity.
    const Quaternion4<double> q_WB = task_.reference.front().x.segment<4>(kQuaternion);
    law_->holding_input(q_WB, task_.disturbance.front(), input_);
    const auto pulses = pulse_velocity(vehicle_, thrusters_, input_.duty, q_WB);
    task_.x0.segment<3>(kVelocity) -= pulses.head<3>();
    task_.x0.segment<3>(kAngularVelocity) -= pulses.tail<3>();
  }
  return task_;
}

void Controller::add_model_disturbance(std::int64_t period, const ObserverState& now) {
  const double start_s = acting(static_cast<double>(period) * period_s());
  const Disturbance here = model_->disturbance(start_s, now.x, task_.reference_at(0).x);
  task_.disturbance.clear();
  for (int k = 0; k < law_->stages(); ++k) {
    // Where the last plan will be; it was made for an earlier period.
    const std::int64_t of_plan = k + period - plan_period_;
    const bool known = have_plan_ && of_plan > 0 && of_plan <= law_->stages();
    const State13<double> there = k == 0 || !known ? now.x : law_->state(static_cast<int>(of_plan));
    Disturbance disturbance =
        model_->disturbance(start_s + static_cast<double>(k) * period_s(), there, task_.reference_at(k).x);
    if (observer_) {
      // The observer has found what acts here, the model says how it differs there.
      disturbance.acceleration_W += now.d.acceleration_W - here.acceleration_W;
      disturbance.angular_acceleration_B += now.d.angular_acceleration_B - here.angular_acceleration_B;
    }
    task_.disturbance.push_back(disturbance);
  }
}

void Controller::count(const SolveResult& result) {
  ++counters_.solves;
  if (!is_success(result.status)) ++counters_.solver_failures;
}

void Controller::solve(const ObserverState& now, const Goal& goal, ControlDecision& decision) {
  const ControlTask& task = task_for(*last_period_, now, goal);
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
  for (int k = 0; k <= law_->stages(); ++k)
    decision.path.push_back(model_ ? model_->shown(law_->state(k)) : law_->state(k));
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
  if (level() == CommandLevel::kRate) decision.wrench.head<2>() = wrench.head<2>();  // and no rate
}

}  // namespace atmos
