#include "atmos_sim2real/node_likelihood.h"

#include <Eigen/Cholesky>

namespace atmos {

namespace {

double half_log_determinant(const Eigen::LLT<Eigen::MatrixXd>& factor) {
  return factor.matrixLLT().diagonal().array().log().sum();
}

}  // namespace

Eigen::VectorXd NodeLikelihood::gradient_at(const Eigen::VectorXd& nodes) const {
  return gradient - information * (nodes - at);
}

double NodeLikelihood::gain(const Eigen::VectorXd& nodes) const {
  const Eigen::VectorXd way = nodes - at;
  return gradient.dot(way) - 0.5 * way.dot(information * way);
}

double NodeLikelihood::evidence(const Eigen::VectorXd& mean, const Eigen::MatrixXd& precision) const {
  const Eigen::LLT<Eigen::MatrixXd> prior(precision), posterior(precision + information);
  const Eigen::VectorXd best = mean + posterior.solve(gradient_at(mean));
  const Eigen::VectorXd away = best - mean;
  return gain(best) - 0.5 * away.dot(precision * away) + half_log_determinant(prior) -
         half_log_determinant(posterior);
}

NodeLikelihood node_likelihood(const Fit& fit, std::size_t map) {
  std::vector<Eigen::Index> nodes, others;
  for (std::size_t p = 0; p < fit.free.size(); ++p)
    (fit.free[p].effect == map ? nodes : others).push_back(static_cast<Eigen::Index>(p));
  const Eigen::MatrixXd prior = prior_precision(fit.free);
  const Eigen::MatrixXd& data = fit.linearisation->information;
  NodeLikelihood out;
  // At the optimum the likelihood's gradient is the prior's.
  out.gradient = Eigen::VectorXd(prior * from_prior_mean(fit.effects, fit.free))(nodes);
  out.information = data(nodes, nodes);
  if (!others.empty()) {
    const Eigen::MatrixXd rest = Eigen::MatrixXd(data + prior)(others, others);
    const Eigen::MatrixXd cross = data(others, nodes);
    out.information -= cross.transpose() * rest.ldlt().solve(cross);
  }
  out.at.resize(static_cast<Eigen::Index>(nodes.size()));
  for (std::size_t k = 0; k < nodes.size(); ++k)
    out.at[static_cast<Eigen::Index>(k)] =
        parameter(fit.effects, fit.free[static_cast<std::size_t>(nodes[k])]);
  return out;
}

}  // namespace atmos
