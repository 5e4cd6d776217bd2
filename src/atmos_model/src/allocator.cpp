#include "atmos_model/allocator.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <stdexcept>
#include <string>

#include "atmos_model/allocation.h"

namespace atmos {

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kSameDirection = 1e-9;  // relative to columns of length about 1
constexpr double kResidual = 1e-13;      // in units of Allocator::unit_
constexpr double kDutyResolution = 1e-12;
constexpr int kMaxIterations = 200;  // a handful is usual

double unit_interval(double value) { return std::min(1.0, std::max(0.0, value)); }

std::string listed(const std::set<int>& numbers) {
  std::string text;
  for (const int number : numbers) text += (text.empty() ? "" : ", ") + std::to_string(number);
  return text;
}

}  // namespace

Allocator::Allocator(const Vehicle& vehicle, const std::vector<int>& failed)
    : thruster_count_(vehicle.thrusters.size()), min_duty_(vehicle.pwm.min_on_time_s / vehicle.pwm.period_s) {
  const std::set<int> dead(failed.begin(), failed.end());
  for (const int number : dead) {
    if (number < 1 || number > static_cast<int>(thruster_count_))
      throw std::invalid_argument("there is no thruster " + std::to_string(number));
  }

  const AllocationMatrices matrices = thruster_matrices(vehicle);
  // A propeller is two thrusters back to back, of which the least-norm duties use at most one.
  const bool both_ways = vehicle.actuation == Actuation::kContinuous;
  B_.resize(3, static_cast<Eigen::Index>((both_ways ? 2 : 1) * (thruster_count_ - dead.size())));
  for (std::size_t i = 0; i < thruster_count_; ++i) {
    if (dead.count(static_cast<int>(i) + 1) > 0) continue;
    const auto column = static_cast<Eigen::Index>(i);
    const BodyWrench full = vehicle.thrusters[i].force_n *
                            BodyWrench(matrices.D(0, column), matrices.D(1, column), matrices.L(2, column));
    for (const double sense : {1.0, -1.0}) {
      if (sense < 0.0 && !both_ways) break;
      B_.col(static_cast<Eigen::Index>(healthy_.size())) = sense * full;
      healthy_.push_back({i, sense});
    }
  }
  if (both_ways) min_duty_ = 0.0;
  const double force = B_.size() > 0 ? B_.topRows<2>().cwiseAbs().maxCoeff() : 0.0;
  const double torque = B_.size() > 0 ? B_.row(2).cwiseAbs().maxCoeff() : 0.0;
  const bool pushes_and_turns = force > 0.0 && torque > 0.0;
  if (pushes_and_turns) {
    unit_ = {force, force, torque};
    B_ = unit_.cwiseInverse().asDiagonal() * B_;
  }

  for (Eigen::Index i = 0; i < B_.cols(); ++i) {
    for (Eigen::Index j = i + 1; j < B_.cols(); ++j) {
      const Eigen::Vector3d normal = B_.col(i).head<3>().cross(B_.col(j).head<3>());
      if (normal.norm() < kSameDirection) continue;
      for (const double side : {1.0, -1.0}) {
        const Eigen::Vector3d outward = side * normal.normalized();
        facets_.push_back({outward, (outward.transpose() * B_).cwiseMax(0.0).sum()});
      }
    }
  }
  // The zero wrench is a corner or on the rim of the set exactly when some facet passes through it.
  const bool surrounds_zero = std::all_of(facets_.begin(), facets_.end(),
                                          [](const Facet& facet) { return facet.support > kSameDirection; });
  if (!pushes_and_turns || facets_.empty() || !surrounds_zero) {
    throw std::invalid_argument(dead.empty()
                                    ? "the thrusters cannot push and turn the robot in every direction"
                                    : "without thruster " + listed(dead) +
                                          " the others cannot push and turn the robot in every direction");
  }
  for (int axis = 0; axis < 3; ++axis) {
    const BodyWrench along = BodyWrench::Unit(axis);
    max_wrench_[axis] = std::min(attainable_scale(along), attainable_scale(-along));
  }
}

double Allocator::attainable_scale(const BodyWrench& wrench) const {
  const Eigen::Vector3d scaled = wrench.cwiseQuotient(unit_);
  double scale = kInfinity;
  for (const Facet& facet : facets_) {
    const double outward = facet.normal.dot(scaled);
    if (outward > 0.0) scale = std::min(scale, facet.support / outward);
  }
  return scale;
}

Eigen::Matrix<double, Eigen::Dynamic, 3> Allocator::facet_normals() const {
  Eigen::Matrix<double, Eigen::Dynamic, 3> normals(static_cast<Eigen::Index>(facets_.size()), 3);
  for (std::size_t i = 0; i < facets_.size(); ++i)
    normals.row(static_cast<Eigen::Index>(i)) = facets_[i].normal.cwiseQuotient(unit_).transpose();
  return normals;
}

Eigen::VectorXd Allocator::facet_limits() const {
  Eigen::VectorXd limits(static_cast<Eigen::Index>(facets_.size()));
  for (std::size_t i = 0; i < facets_.size(); ++i) limits[static_cast<Eigen::Index>(i)] = facets_[i].support;
  return limits;
}

double Allocator::line_search(const Eigen::Vector3d& wrench, const Eigen::Vector3d& multipliers,
                              const Eigen::Vector3d& direction) const {
  // Along the line the slope falls and is linear between the points where a duty reaches or leaves 0 or 1.
  const auto slope = [&](double t) {
    double sum = direction.dot(wrench);
    for (Eigen::Index i = 0; i < B_.cols(); ++i)
      sum -=
          B_.col(i).dot(direction) * unit_interval(B_.col(i).dot(multipliers) + t * B_.col(i).dot(direction));
    return sum;
  };
  double t = 0.0, slope_at_t = slope(0.0);
  while (slope_at_t > 0.0) {
    double next = kInfinity;
    for (Eigen::Index i = 0; i < B_.cols(); ++i) {
      const double speed = B_.col(i).dot(direction);
      if (std::abs(speed) < kSameDirection) continue;  // by rounding: its kink would be a huge step away
      for (const double level : {0.0, 1.0}) {
        const double kink = (level - B_.col(i).dot(multipliers)) / speed;
        if (kink > t) next = std::min(next, kink);
      }
    }
    // Past the last kink every duty that moves is at a limit: the slope is that of rounding.
    if (next == kInfinity) return t;
    const double slope_at_next = slope(next);
    if (slope_at_next <= 0.0) return t + (next - t) * slope_at_t / (slope_at_t - slope_at_next);
    t = next;
    slope_at_t = slope_at_next;
  }
  return t;
}

Eigen::Vector3d Allocator::solve(const Eigen::Vector3d& wrench) const {
  // Newton's method on the dual, a concave function made of quadratic pieces: least-norm duties satisfy
  // u = clamp(B' m, 0, 1), and the dual's gradient is the wrench still missing. With an exact line search it
  // ends after finitely many pieces, on the boundary of the set too.
  Eigen::Vector3d multipliers = Eigen::Vector3d::Zero();
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> curvature;
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    Eigen::Vector3d missing = wrench;
    Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
    for (Eigen::Index i = 0; i < B_.cols(); ++i) {
      const double duty = B_.col(i).dot(multipliers);
      missing -= unit_interval(duty) * B_.col(i);
      if (duty > 0.0 && duty < 1.0) hessian += B_.col(i) * B_.col(i).transpose();
    }
    if (missing.lpNorm<Eigen::Infinity>() < kResidual) break;

    curvature.computeDirect(hessian);
    Eigen::Vector3d newton = Eigen::Vector3d::Zero(), flat = Eigen::Vector3d::Zero();
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d axis = curvature.eigenvectors().col(k);
      const double bend = curvature.eigenvalues()[k];
      (bend > kSameDirection ? newton : flat) +=
          axis.dot(missing) * axis / (bend > kSameDirection ? bend : 1.0);
    }
    // Where no duty is free to help, climb until one becomes so.
    const Eigen::Vector3d direction = (flat.norm() > kResidual ? flat : newton).normalized();
    multipliers += line_search(wrench, multipliers, direction) * direction;
  }
  return multipliers;
}

void Allocator::allocate_into(const BodyWrench& wrench, Allocation& result) const {
  result.duty.assign(thruster_count_, 0.0);
  result.achieved.setZero();
  result.scale = 0.0;
  if (!wrench.allFinite()) return;
  const double size = wrench.lpNorm<Eigen::Infinity>();
  result.scale = 1.0;
  if (size == 0.0) return;

  const BodyWrench along = wrench / size;  // so that no product overflows
  const double reach = attainable_scale(along);
  result.scale = std::min(1.0, reach / size);
  const Eigen::Vector3d multipliers = solve((std::min(size, reach) * along).cwiseQuotient(unit_));
  for (std::size_t i = 0; i < healthy_.size(); ++i) {
    const auto column = B_.col(static_cast<Eigen::Index>(i));
    double duty = unit_interval(column.dot(multipliers));
    if (duty < kDutyResolution) duty = 0.0;
    if (duty > 1.0 - kDutyResolution) duty = 1.0;  // a valve that stays open must not blink
    if (duty < min_duty_ - kDutyResolution) duty = 0.0;
    result.duty[healthy_[i].thruster] += healthy_[i].sense * duty;
    result.achieved += duty * unit_.cwiseProduct(Eigen::Vector3d(column));
  }
}

Allocation Allocator::allocate(const BodyWrench& wrench) const {
  Allocation result;
  allocate_into(wrench, result);
  return result;
}

Allocation Allocator::allocate_normalised(const Eigen::Vector3d& wrench) const {
  return allocate(wrench.cwiseProduct(max_wrench_));
}

}  // namespace atmos
