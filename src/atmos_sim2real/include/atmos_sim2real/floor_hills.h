// An uneven floor as a slope and a few hills and hollows: where a table bulges or sags in places, these say
// more of the floor that was not visited than a smooth random field does.
#pragma once

#include "atmos_sim2real/floor_field.h"
#include "atmos_sim2real/node_likelihood.h"

namespace atmos {

// Heights of a lattice's nodes and what is uncertain of them: the slope, and place, height and width of every
// hill.
struct HillyFloor {
  Eigen::VectorXd height_m;
  Eigen::MatrixXd covariance_m2;
  std::size_t hills;
};

// The hills that suit what flights say of the nodes, added one by one as long as the evidence grows.
HillyFloor find_hills(const NodeLikelihood& likelihood, const Lattice& lattice);

}  // namespace atmos
