#include "atmos_nmpc/tracking_cost.h"

#include <cmath>

namespace atmos {

namespace {

using namespace state13;

// Rows of x over which the soft bounds run, block by block.
constexpr int kBoundedBlocks[3] = {kPosition, kVelocity, kAngularVelocity};

// A problem without soft bounds does not pay for their square roots.
int bounded_blocks(const SoftBounds& bounds) {
  return bounds.linear == 0.0 && bounds.quadratic == 0.0 ? 0 : 3;
}

const Eigen::Vector3d& limits_of(const SoftBounds& bounds, int block) {
  return block == 0 ? bounds.position : block == 1 ? bounds.velocity : bounds.rate;
}

// Both sides of |y| <= limit.
Penalty box_penalty(const SoftBounds& bounds, double limit, double y) {
  const Penalty above = penalty(bounds, y - limit), below = penalty(bounds, -y - limit);
  return {above.value + below.value, above.slope - below.slope, above.curvature + below.curvature};
}

// 2 vec(q_ref^-1 q) = matrix * q.
Eigen::Matrix<double, 3, 4> vector_error_matrix(const Quaternion4<double>& r) {
  Eigen::Matrix<double, 3, 4> G;
  G << -r[1], r[0], r[3], -r[2], -r[2], -r[3], r[0], r[1], -r[3], r[2], -r[1], r[0];
  return 2.0 * G;
}

}  // namespace

// linear * h + quadratic * h^2 for a violation d.
Penalty penalty(const SoftBounds& bounds, double d) {
  const double root = std::sqrt(d * d + bounds.width * bounds.width);
  const double h = d > 0.0 ? 0.5 * (d + root) : 0.5 * bounds.width * bounds.width / (root - d);
  const double dh = h / root;
  const double ddh = 0.5 * bounds.width * bounds.width / (root * root * root);
  const double slope_h = bounds.linear + 2.0 * bounds.quadratic * h;
  return {(bounds.linear + bounds.quadratic * h) * h, slope_h * dh,
          slope_h * ddh + 2.0 * bounds.quadratic * dh * dh};
}

TrackingCost::TrackingCost(AttitudeError kind, const TrackingWeights& weights, const SoftBounds& bounds)
    : kind_(kind), weights_(weights), bounds_(bounds) {
  set_places({});
  State at_origin = State::Zero();
  at_origin[kQuaternion] = 1.0;
  set_reference(at_origin, at_origin.segment<4>(kQuaternion), PlanarWeight::Zero());
}

void TrackingCost::set_reference(const State& reference, const Quaternion4<double>& q_now,
                                 const PlanarWeight& planar_terminal) {
  set_reference(std::vector<State>{reference}, q_now, planar_terminal);
}

void TrackingCost::set_reference(const std::vector<State>& references, const Quaternion4<double>& q_now,
                                 const PlanarWeight& planar_terminal) {
  stages_.resize(references.size());
  Quaternion4<double> q_before = q_now;
  for (std::size_t k = 0; k < references.size(); ++k) {
    Stage& stage = stages_[k];
    stage.x = references[k];
    auto q_ref = stage.x.segment<4>(kQuaternion);
    if (q_ref.dot(q_before) < 0.0) q_ref = -q_ref;
    q_before = q_ref;
    stage.attitude.setZero();
    if (kind_ == AttitudeError::kVector) {
      const Eigen::Matrix<double, 3, 4> G = vector_error_matrix(q_ref);
      stage.attitude = 2.0 * G.transpose() * weights_.attitude.asDiagonal() * G;
    }
  }
  diagonal_.setZero();
  diagonal_.segment<3>(kPosition) = 2.0 * weights_.position;
  diagonal_.segment<3>(kVelocity) = 2.0 * weights_.velocity;
  diagonal_.segment<3>(kAngularVelocity) = 2.0 * weights_.rate;

  // Error e = E (x - reference) in the order p, v, attitude, w; the attitude rows vanish at the reference
  // themselves.
  Eigen::Matrix<double, 12, 13> E = Eigen::Matrix<double, 12, 13>::Zero();
  E.block<6, 6>(0, 0).setIdentity();
  if (kind_ == AttitudeError::kVector) E.block<3, 4>(6, kQuaternion) = vector_error_matrix(q_before);
  E.block<3, 3>(9, kAngularVelocity).setIdentity();
  Eigen::Matrix<double, 12, 1> diagonal;
  diagonal << weights_.position, weights_.velocity, weights_.attitude, weights_.rate;
  Eigen::Matrix<double, 12, 12> terminal = (weights_.terminal_factor * diagonal).asDiagonal();
  if (kind_ == AttitudeError::kVector) {
    constexpr int kPlanar[6] = {0, 1, 8, 3, 4, 11};  // x, y, yaw, vx, vy, yaw rate
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) terminal(kPlanar[i], kPlanar[j]) = planar_terminal(i, j);
    }
  }
  terminal_ = 2.0 * E.transpose() * terminal * E;
}

TrackingCost::State TrackingCost::slope(const State& x, int k, bool terminal) const {
  const Stage& stage = at(k);
  const State d = x - stage.x;
  if (terminal) return terminal_ * d;
  State slope = diagonal_.cwiseProduct(d);
  slope.segment<4>(kQuaternion) = stage.attitude * d.segment<4>(kQuaternion);
  return slope;
}

double TrackingCost::value(const State& x, int k, bool terminal) const {
  double sum = 0.5 * (x - at(k).x).dot(slope(x, k, terminal));
  if (kind_ == AttitudeError::kPaper) {
    const double c = at(k).x.segment<4>(kQuaternion).dot(x.segment<4>(kQuaternion));
    const double e = 1.0 - c * c;
    sum += (terminal ? weights_.terminal_factor : 1.0) * weights_.attitude[2] * e * e;
  }
  for (int block = 0; block < bounded_blocks(bounds_); ++block) {
    for (int i = 0; i < 3; ++i)
      sum += box_penalty(bounds_, limits_of(bounds_, block)[i], x[kBoundedBlocks[block] + i]).value;
  }
  for_each_place(x, k,
                 [&](double d, const Eigen::Vector2d&, double) { sum += penalty(place_penalty_, d).value; });
  return sum;
}

void TrackingCost::add_gradient(const State& x, int k, bool terminal, double factor, State& gradient) const {
  gradient += factor * slope(x, k, terminal);
  if (kind_ == AttitudeError::kPaper) {
    const Quaternion4<double> r = at(k).x.segment<4>(kQuaternion);
    const double c = r.dot(x.segment<4>(kQuaternion));
    const double weight = (terminal ? weights_.terminal_factor : 1.0) * weights_.attitude[2];
    gradient.segment<4>(kQuaternion) += factor * weight * (-4.0 * c * (1.0 - c * c)) * r;
  }
  for (int block = 0; block < bounded_blocks(bounds_); ++block) {
    for (int i = 0; i < 3; ++i) {
      const int row = kBoundedBlocks[block] + i;
      gradient[row] += factor * box_penalty(bounds_, limits_of(bounds_, block)[i], x[row]).slope;
    }
  }
  for_each_place(x, k, [&](double d, const Eigen::Vector2d& normal, double) {
    gradient.head<2>() += factor * penalty(place_penalty_, d).slope * normal;
  });
}

void TrackingCost::add_hessian(const State& x, int k, bool terminal, double factor, Hessian& H) const {
  if (terminal) {
    H += factor * terminal_;
  } else {
    H.diagonal() += factor * diagonal_;
    H.block<4, 4>(kQuaternion, kQuaternion) += factor * at(k).attitude;
  }
  if (kind_ == AttitudeError::kPaper) {
    const Quaternion4<double> r = at(k).x.segment<4>(kQuaternion);
    const double c = r.dot(x.segment<4>(kQuaternion));
    const double weight = (terminal ? weights_.terminal_factor : 1.0) * weights_.attitude[2];
    H.block<4, 4>(kQuaternion, kQuaternion) += factor * weight * (12.0 * c * c - 4.0) * r * r.transpose();
  }
  for (int block = 0; block < bounded_blocks(bounds_); ++block) {
    for (int i = 0; i < 3; ++i) {
      const int row = kBoundedBlocks[block] + i;
      H(row, row) += factor * box_penalty(bounds_, limits_of(bounds_, block)[i], x[row]).curvature;
    }
  }
  for_each_place(x, k, [&](double d, const Eigen::Vector2d& normal, double bend) {
    const Penalty p = penalty(place_penalty_, d);
    H.topLeftCorner<2, 2>() += factor * (p.curvature + bend * p.slope) * normal * normal.transpose();
    H.topLeftCorner<2, 2>().diagonal().array() -= factor * bend * p.slope;
  });
}

int TrackingCost::active_bounds(const State& x, int k) const {
  int count = 0;
  for (int block = 0; block < bounded_blocks(bounds_); ++block) {
    for (int i = 0; i < 3; ++i)
      count += std::abs(x[kBoundedBlocks[block] + i]) >= limits_of(bounds_, block)[i] - bounds_.width ? 1 : 0;
  }
  for_each_place(x, k,
                 [&](double d, const Eigen::Vector2d&, double) { count += d >= -bounds_.width ? 1 : 0; });
  return count;
}

}  // namespace atmos
