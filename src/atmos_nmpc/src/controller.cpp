#include "atmos_nmpc/controller.h"

#include <Eigen/QR>
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
constexpr double kColdStartMu = 1e-4;         // barrier parameter of a cold start, as mu_init
constexpr double kActiveTolerance = 1e-4;     // N, m, m/s, rad/s (NmpcStatus.active_constraints)

SolverOptions solver_options(const ControllerConfig& config, bool lockstep) {
  SolverOptions options = config.solver;
  if (lockstep) options.time_limit_s.reset();
  return options;
}

bool is_attitude(const Quaternion4<double>& q) { return std::abs(q.norm() - 1.0) < kQuaternionTolerance; }

Eigen::Matrix<double, 4, 3> pair_forces_of_wrench(const Vehicle& vehicle,
                                                  const std::vector<ThrusterPair>& pairs) {
  const AllocationMatrices matrices = pair_matrices(vehicle, pairs);
  Eigen::Matrix<double, 3, 4> effect;
  effect << matrices.D.topRows<2>(), matrices.L.row(2);
  return effect.completeOrthogonalDecomposition().pseudoInverse();
}

}  // namespace

Controller::Controller(const Vehicle& vehicle, const ControllerConfig& config, bool lockstep,
                       Stopwatch stopwatch)
    : vehicle_(vehicle),
      config_(config),
      pairs_(thruster_pairs(vehicle)),
      thrusters_(thruster_matrices(vehicle)),
      wrench_to_pairs_(pair_forces_of_wrench(vehicle, pairs_)),
      problem_(make_direct_allocation(vehicle, config)),
      solver_(problem_, solver_options(config, lockstep), std::move(stopwatch)),
      commands_(static_cast<int>(vehicle.thrusters.size())) {
  if (lockstep) config_.lead_s = 0.0;
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

const Goal* Controller::goal_at(double time_s) {
  while (goals_.size() > 1 && goals_[1].stamp_s <= time_s + kStampTolerance) goals_.pop_front();
  return !goals_.empty() && goals_.front().stamp_s <= time_s + kStampTolerance ? &goals_.front() : nullptr;
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

std::optional<ControlDecision> Controller::on_odometry(const OdometrySample& sample, double now_s) {
  const bool accepted = accept(sample, now_s);
  // Odometry that cannot be used still says that a frame was due: the period gets its decision all the same.
  if (!accepted && (!std::isfinite(sample.stamp_s) || sample.stamp_s > now_s + kFutureTolerance))
    return std::nullopt;
  silent_ = false;
  return step(sample.stamp_s);
}

std::optional<ControlDecision> Controller::on_missing_frame(double stamp_s) {
  if (!std::isfinite(stamp_s)) return std::nullopt;
  silent_ = false;
  return step(stamp_s);
}

std::optional<ControlDecision> Controller::on_silence(double now_s) {
  if (last_period_ && period_of(now_s) < *last_period_ + (silent_ ? 1 : 2)) return std::nullopt;
  silent_ = true;
  return step(now_s);
}

std::optional<ControlDecision> Controller::step(double event_s) {
  const std::int64_t period = period_of(event_s);
  if (last_period_ && period <= *last_period_) return std::nullopt;
  last_period_ = period;

  ControlDecision decision;
  decision.command.stamp_s = static_cast<double>(period) * period_s();
  decision.command.period_s = period_s();
  decision.command.duty.assign(vehicle_.thrusters.size(), 0.0);
  decide(decision);
  commands_.add(decision.command);
  commands_.forget_before(decision.command.stamp_s - config_.limits.odometry_lost_s - 2.0 * period_s());
  return decision;
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
    warm_ = have_plan_ = at_rest_ = false;
    braking_since_s_.reset();
    return;
  }
  if (goal == nullptr) return;
  const State13<double> x0 =
      predict(vehicle_, thrusters_, commands_, odometry_->x, odometry_->stamp_s, start_s);
  solve(x0, *goal, decision);
  if (!is_success(decision.solve.status)) fall_back(x0, decision);
}

void Controller::solve(const State13<double>& measured, const Goal& goal, ControlDecision& decision) {
  State13<double> x0 = measured;
  if (warm_) {
    // q and -q are the same attitude: stay on the side of the previous solution, which is the starting point.
    if (x0.segment<4>(kQuaternion).dot(problem_.initial_state().segment<4>(kQuaternion)) < 0.0)
      x0.segment<4>(kQuaternion) = -x0.segment<4>(kQuaternion);
    for (std::int64_t k = iterate_period_; k < *last_period_ && k < iterate_period_ + problem_.stages(); ++k)
      iterate_ = problem_.shifted(iterate_);
  }
  State13<double> reference = State13<double>::Zero();
  reference.segment<3>(kPosition) = goal.p_WB;
  reference.segment<4>(kQuaternion) = goal.q_WB;
  const Quaternion4<double>& q = goal.q_WB;
  const double yaw = std::atan2(2.0 * (q[0] * q[3] + q[1] * q[2]), 1.0 - 2.0 * (q[2] * q[2] + q[3] * q[3]));
  if (config_.attitude_error == AttitudeError::kVector && terminal_yaw_ != yaw) {
    terminal_ = planar_terminal_weight(problem_.dynamics(), config_.weights, config_.force_weight, yaw);
    terminal_yaw_ = yaw;
  }
  problem_.cost().set_reference(reference, x0.segment<4>(kQuaternion), terminal_);
  problem_.set_initial_state(x0);
  if (!warm_) iterate_ = problem_.cold_start(kColdStartMu);

  decision.solve = solver_.solve(iterate_);
  iterate_period_ = *last_period_;
  ++counters_.solves;
  // A failed solve leaves no good starting point: the next one starts cold.
  warm_ = is_success(decision.solve.status);
  if (!warm_) {
    ++counters_.solver_failures;
    return;
  }
  plan_ = iterate_.z;
  plan_period_ = *last_period_;
  have_plan_ = true;
  at_rest_ = false;
  braking_since_s_.reset();
  decision.mode = ControlMode::kSolved;
  decision.command.duty = duties_from_pairs(vehicle_, pairs_, problem_.input(plan_, 0));
  decision.active_constraints = problem_.active_constraints(plan_, kActiveTolerance);
  decision.path.reserve(static_cast<std::size_t>(problem_.stages()) + 1);
  for (int k = 0; k <= problem_.stages(); ++k) decision.path.push_back(problem_.state(plan_, k));
}

void Controller::fall_back(const State13<double>& x0, ControlDecision& decision) {
  const double start_s = decision.command.stamp_s;
  const std::int64_t stage = *last_period_ - plan_period_;
  if (have_plan_ && stage < problem_.stages() &&
      static_cast<double>(stage) * period_s() <= config_.limits.plan_reuse_s + kStampTolerance) {
    decision.mode = ControlMode::kPreviousPlan;
    decision.command.duty =
        duties_from_pairs(vehicle_, pairs_, problem_.input(plan_, static_cast<int>(stage)));
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
  const Eigen::Vector3d wrench(gain * vehicle_.mass_kg * v_B[0], gain * vehicle_.mass_kg * v_B[1],
                               gain * vehicle_.inertia_kg_m2[2] * yaw_rate);
  // Beyond the thrusters' limits the whole wrench shrinks, so that it still opposes the motion.
  Eigen::Vector4d u = wrench_to_pairs_ * wrench;
  for (int j = 0; j < 4; ++j) {
    const double limit = std::min(problem_.upper_bounds()[j], -problem_.lower_bounds()[j]);
    if (std::abs(u[j]) > limit) u *= limit / std::abs(u[j]);
  }
  decision.command.duty = duties_from_pairs(vehicle_, pairs_, u);
}

}  // namespace atmos
