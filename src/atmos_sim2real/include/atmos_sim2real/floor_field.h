// What is plausible of a map over the floor: a smooth random field.
#pragma once

#include <Eigen/Core>

#include "atmos_model/grid.h"
#include "atmos_sim2real/flight.h"

namespace atmos {

struct Field {
  double deviation;  // in the map's unit
  double length_m;   // over which it changes
};

// A grid with its number of nodes; node k is column k % columns of row k / columns.
struct Lattice {
  Grid grid;
  std::size_t columns, rows;

  std::size_t nodes() const { return columns * rows; }
  Eigen::Vector2d place(std::size_t node) const;
};

// Covers the box and `margin` around it.
Lattice lattice_over(const Box& box, double margin, double spacing);

// The finest spacing, from `finest` on, with which the same takes at most about so many nodes.
double affordable_spacing(const Box& box, double margin, double finest, double nodes);

// Covariance of a field's nodes (Matern 5/2).
Eigen::MatrixXd covariance(const Field& field, const Lattice& lattice);
// Its inverse: the prior precision of the nodes.
Eigen::MatrixXd precision(const Field& field, const Lattice& lattice);

}  // namespace atmos
