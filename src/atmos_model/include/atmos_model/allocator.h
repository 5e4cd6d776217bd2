// Bounded control allocation: body wrench -> duties that realise it exactly wherever the thruster set can, and otherwise
// the same wrench scaled along its direction, with what was achieved reported.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "atmos_model/vehicle.h"

namespace atmos {

// Planar body wrench about the geometric centre: force [N] along body x and y, torque [N m] about body z.
using BodyWrench = Eigen::Vector3d;

struct Allocation {
  std::vector<double> duty;   // one per thruster, [0, 1], after min_on_time; failed thrusters 0
  BodyWrench achieved;        // what the duties give with every thruster at its full force
  double scale;               // in [0, 1]: the share of the asked wrench that the thruster set can realise
};

// Finds the duties of least squared norm, which is unique and continuous in the wrench. Immutable, no allocation of
// memory in allocate_into().
class Allocator {
 public:
  // `failed`: numbers of dead thrusters, from 1. Throws std::invalid_argument that names them when the others cannot
  // push and turn the robot in every direction, or when a number does not exist.
  explicit Allocator(const Vehicle& vehicle, const std::vector<int>& failed = {});

  // `wrench` in N, N m. A wrench that is not finite gives zero duties and scale 0.
  Allocation allocate(const BodyWrench& wrench) const;
  // The same into an existing result whose duty has the right size: for control loops.
  void allocate_into(const BodyWrench& wrench, Allocation& result) const;
  // `wrench` per axis in units of max_wrench(), as PX4Space's normalised allocation takes it.
  Allocation allocate_normalised(const Eigen::Vector3d& wrench) const;

  // Largest share of `wrench` (in [0, inf)) the healthy thrusters can realise.
  double attainable_scale(const BodyWrench& wrench) const;
  // Largest pure force along body x, body y and torque [N, N, N m].
  const Eigen::Vector3d& max_wrench() const { return max_wrench_; }

 private:
  struct Facet {
    Eigen::Vector3d normal;
    double support;  // greatest normal . wrench over the attainable set
  };

  double min_duty_;                           // shorter pulses are sent as 0
  std::vector<int> healthy_;                  // indices into Vehicle::thrusters
  std::size_t thruster_count_;
  Eigen::Matrix<double, 3, Eigen::Dynamic> effect_;  // wrench per unit duty of each healthy thruster
  std::vector<Facet> facets_;
  Eigen::Vector3d max_wrench_;
};

}  // namespace atmos
