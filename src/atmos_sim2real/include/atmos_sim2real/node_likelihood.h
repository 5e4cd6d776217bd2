// What flights say of the nodes of a map, to second order: any prior can be weighed against it without
// another fit.
#pragma once

#include "atmos_sim2real/fit.h"

namespace atmos {

// Gain of the log likelihood [nats] as the nodes move away from `at`, all else refitted.
struct NodeLikelihood {
  Eigen::VectorXd at, gradient;
  Eigen::MatrixXd information;

  Eigen::VectorXd gradient_at(const Eigen::VectorXd& nodes) const;
  double gain(const Eigen::VectorXd& nodes) const;
  // log evidence of a normal prior of the nodes, nats over `at` known for certain.
  double evidence(const Eigen::VectorXd& prior_mean, const Eigen::MatrixXd& prior_precision) const;
};

// Of the map that is effect `map` of a fit (which must have its linearisation); nodes in the order of its
// free parameters.
NodeLikelihood node_likelihood(const Fit& fit, std::size_t map);

}  // namespace atmos
