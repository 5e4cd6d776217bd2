// Bounded control allocation: body wrench -> duties that realise it exactly wherever the thruster set can,
// and otherwise the same wrench scaled along its direction, with what was achieved reported.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "atmos_model/vehicle.h"

namespace atmos {

// Planar body wrench about the geometric centre: force [N] along body x and y, torque [N m] about body z.
using BodyWrench = Eigen::Vector3d;

struct Allocation {
  std::vector<double> duty;  // one per thruster, [0, 1], after min_on_time; failed ones 0; propellers [-1, 1]
  BodyWrench achieved = BodyWrench::Zero();  // what the duties give with every thruster at its full force
  double scale = 0.0;  // in [0, 1]: the share of the asked wrench that the thruster set can realise
};

// Finds the duties of least squared norm, which are unique and continuous in the wrench. Immutable;
// allocate_into() allocates no memory.
class Allocator {
 public:
  // `failed`: numbers of dead thrusters, from 1. Throws std::invalid_argument that names them when the others
  // cannot push and turn the robot in every direction, or when a number does not exist.
  explicit Allocator(const Vehicle& vehicle, const std::vector<int>& failed = {});

  // `wrench` in N, N m. A wrench that is not finite gives zero duties and scale 0.
  Allocation allocate(const BodyWrench& wrench) const;
  // The same into an existing result: allocates only if its duty has not the right size yet.
  void allocate_into(const BodyWrench& wrench, Allocation& result) const;
  // `wrench` per axis in units of max_wrench(), as PX4Space's normalised allocation takes it.
  Allocation allocate_normalised(const Eigen::Vector3d& wrench) const;

  // Largest factor by which `wrench` may be multiplied and still be realised: 1 on the boundary of the
  // attainable set, infinite for the zero wrench.
  double attainable_scale(const BodyWrench& wrench) const;
  // The attainable set as half-spaces, row . wrench <= limit: the rows of N^-1, N^-1, (N m)^-1, each of
  // length 1 in units of the strongest thruster's force and torque.
  Eigen::Matrix<double, Eigen::Dynamic, 3> facet_normals() const;
  Eigen::VectorXd facet_limits() const;
  // Largest force along body x, along body y and torque that the healthy thrusters realise alone in both
  // senses [N, N, N m].
  const BodyWrench& max_wrench() const { return max_wrench_; }

 private:
  // The attainable set {B u : 0 <= u <= 1} is a zonotope. Its facets are spanned by pairs of columns of B:
  // `normal` is orthogonal to both and `support` is the greatest normal . wrench over the set.
  struct Facet {
    Eigen::Vector3d normal;
    double support;
  };
  // Lagrange multipliers of the least-norm duties u = clamp(B' multipliers, 0, 1) with B u = wrench; `wrench`
  // in the set, both in units of unit_.
  Eigen::Vector3d solve(const Eigen::Vector3d& wrench) const;
  // How far one may go along the unit vector `direction` from `multipliers` until the dual function stops
  // rising.
  double line_search(const Eigen::Vector3d& wrench, const Eigen::Vector3d& multipliers,
                     const Eigen::Vector3d& direction) const;

  std::size_t thruster_count_;
  struct Column {
    std::size_t thruster;  // index into Vehicle::thrusters
    double sense;          // -1: of a propeller that pushes the other way
  };

  double min_duty_;              // shorter pulses are sent as 0
  std::vector<Column> healthy_;  // of B_
  BodyWrench unit_;              // makes columns of different physical dimension comparable
  Eigen::Matrix<double, 3, Eigen::Dynamic>
      B_;  // wrench, in units of unit_, per unit duty of each healthy thruster
  std::vector<Facet> facets_;
  BodyWrench max_wrench_;
};

}  // namespace atmos
