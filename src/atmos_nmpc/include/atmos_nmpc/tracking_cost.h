// Cost of the distance to a reference, at rest or moving: stage and terminal weights, attitude errors, soft
// state bounds.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <vector>

#include "atmos_model/rigid_body.h"

namespace atmos {

enum class AttitudeError {
  kVector,  // 2 vec(q_ref^-1 q), scalar part >= 0: the rotation vector for small angles
  kPaper    // 1 - (q_ref' q)^2 (paper, full_error); squared it is quartic in the angle: no curvature at the
            // reference
};

struct TrackingWeights {
  Eigen::Vector3d position;  // 1/m^2, world axes
  Eigen::Vector3d velocity;  // s^2/m^2, world axes
  Eigen::Vector3d
      attitude;  // 1/rad^2 about the axes of the reference; kPaper takes the z component for its scalar error
  Eigen::Vector3d rate;    // s^2/rad^2, body axes
  double terminal_factor;  // terminal over stage weight where there is no Riccati solution
};

// |p|, |v|, |w| per component. A violation d costs linear * h + quadratic * h^2 with the smooth hinge
// h = (d + sqrt(d^2 + width^2)) / 2.
//
// Why a penalty function and not slack variables: it adds no variable and no constraint (nine slacks a stage
// would more than halve the speed of the factorisation), its Hessian is diagonal, so that the block sparsity
// of the problem is untouched, and the problem stays feasible from any measured state. With the linear part
// above the multiplier of the hard bound the solution keeps that bound up to the width of the hinge, as exact
// penalties do; the rounding is what an interior-point method's barrier would do to slack variables anyhow.
struct SoftBounds {
  Eigen::Vector3d position;  // m
  Eigen::Vector3d velocity;  // m/s
  Eigen::Vector3d rate;      // rad/s
  double linear;             // 1/unit
  double quadratic;          // 1/unit^2
  double width;              // unit of the bounded quantity
};

// Smooth hinge penalty of a violation d, with derivatives.
struct Penalty {
  double value, slope, curvature;
};
Penalty penalty(const SoftBounds& bounds, double d);

// Where base_link must not be, in the world's plane.
struct HalfPlane {
  Eigen::Vector2d outward;  // unit normal
  double limit_m;           // outward . p <= this
};
struct Disc {
  Eigen::Vector2d center_m;                          // at the start of the horizon
  double radius_m;                                   // |p - center| >= this
  Eigen::Vector2d step_m = Eigen::Vector2d::Zero();  // how far it moves per stage
};
struct Places {
  // In place of the soft bounds' quadratic weight, 1/m^2. What pulls a plan through an obstacle is the whole
  // way that it saves, by way of the terminal weight: tens of times the price of a state bound.
  double penalty_quadratic = 2e5;
  std::vector<HalfPlane> walls;  // of the area to keep in
  std::vector<Disc> obstacles;
};

class TrackingCost {
 public:
  using State = State13<double>;
  using Hessian = Eigen::Matrix<double, state13::kSize, state13::kSize>;
  using PlanarWeight = Eigen::Matrix<double, 6, 6>;

  TrackingCost(AttitudeError kind, const TrackingWeights& weights, const SoftBounds& bounds);

  // One reference state [m, unit quaternion, m/s, rad/s] for every stage, or one per stage from the first on;
  // the last one holds for the stages after it. `planar_terminal`: Riccati solution over the errors
  // (x, y, yaw, vx, vy, yaw rate) that takes the place of the stage weight in these directions; not used with
  // kPaper.
  //
  // The error's sign is settled here and not per stage: the first q_ref is turned into the half sphere of
  // `q_now`, the attitude the horizon starts from, and each one after it into that of the one before. Along a
  // continuous trajectory the error is then linear in q, so that the problem stays smooth, and its scalar
  // part is >= 0 at the start.
  void set_reference(const State& reference, const Quaternion4<double>& q_now,
                     const PlanarWeight& planar_terminal);
  void set_reference(const std::vector<State>& references, const Quaternion4<double>& q_now,
                     const PlanarWeight& planar_terminal);

  // Soft constraints on the position, with the penalty of the soft bounds.
  void set_places(const Places& places) {
    places_ = places;
    place_penalty_ = bounds_;
    place_penalty_.quadratic = places.penalty_quadratic;
  }
  const Places& places() const { return places_; }

  // Of the state at the start of stage k; the terminal weight is that of the last state.
  double value(const State& x, int k, bool terminal) const;
  // Adds factor times the gradient, and the lower triangle of the Hessian. An obstacle bends the wrong way;
  // it is for the solver to regularise that where it must: without it steps near an obstacle are so wrong
  // that the iteration limit is reached.
  void add_gradient(const State& x, int k, bool terminal, double factor, State& gradient) const;
  void add_hessian(const State& x, int k, bool terminal, double factor, Hessian& H) const;

  // Number of soft bounds whose penalty acts at x: beyond, or within the hinge's width of, the limit.
  int active_bounds(const State& x, int k) const;

  const State& reference(int k = 0) const { return at(k).x; }

 private:
  struct Stage {
    State x;                   // the reference
    Eigen::Matrix4d attitude;  // second derivative of the attitude's part, kVector
  };
  const Stage& at(int k) const { return stages_[std::min(static_cast<std::size_t>(k), stages_.size() - 1)]; }
  // Calls visit(violation [m], its gradient n, bend) for every wall and obstacle at stage k; its Hessian is
  // -bend (I - n n').
  template <class Visit>
  void for_each_place(const State& x, int k, const Visit& visit) const {
    const Eigen::Vector2d p = x.head<2>();
    for (const HalfPlane& wall : places_.walls) visit(wall.outward.dot(p) - wall.limit_m, wall.outward, 0.0);
    for (const Disc& disc : places_.obstacles) {
      const Eigen::Vector2d from_center = p - disc.center_m - static_cast<double>(k) * disc.step_m;
      const double distance = std::max(from_center.norm(), 1e-6);
      visit(disc.radius_m - distance, Eigen::Vector2d(-from_center / distance), 1.0 / distance);
    }
  }
  // Quadratic part's gradient, kPaper's apart.
  State slope(const State& x, int k, bool terminal) const;

  AttitudeError kind_;
  TrackingWeights weights_;
  SoftBounds bounds_;
  Places places_;
  SoftBounds place_penalty_;
  std::vector<Stage> stages_;  // never empty
  // Second derivatives of the quadratic part: of a stage without the attitude, and all of the terminal one.
  State diagonal_;
  Hessian terminal_;
};

}  // namespace atmos
