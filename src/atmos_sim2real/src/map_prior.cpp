#include "atmos_sim2real/map_prior.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <optional>

#include "atmos_sim2real/floor_hills.h"
#include "atmos_sim2real/floor_map.h"
#include "atmos_sim2real/node_likelihood.h"

namespace atmos {

namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// Normal prior of the nodes of one component of a map.
struct NodePrior {
  VectorXd mean, deviation;
  MatrixXd precision;
};

// The same for every component.
double evidence(const NodeLikelihood& likelihood, const NodePrior& prior, std::size_t components) {
  const Eigen::Index n = prior.mean.size();
  const auto all = static_cast<Eigen::Index>(components);
  MatrixXd precision = MatrixXd::Zero(all * n, all * n);
  for (Eigen::Index c = 0; c < all; ++c) precision.block(c * n, c * n, n, n) = prior.precision;
  return likelihood.evidence(prior.mean.replicate(all, 1), precision);
}

struct Weighed {
  NodePrior prior;
  double evidence;
};

// What may be plausible of a kind of map [its unit].
std::vector<double> deviations_of(const Effect& map) {
  if (std::holds_alternative<FloorUnevenness>(map)) return {1e-4, 2e-4, 4e-4, 8e-4, 1.6e-3};
  return {0.01, 0.025, 0.06, 0.15};
}

// Hills on a floor that is bent as a whole; the same hills for every bend that is plausible.
std::vector<NodePrior> hills(const NodeLikelihood& likelihood, const Lattice& lattice) {
  constexpr double kLeft = 3e-5;  // m: deviation of what hills leave
  constexpr double kBroad = 2.0;  // m: length of a bend
  const HillyFloor floor = find_hills(likelihood, lattice);
  const MatrixXd hilly = floor.covariance_m2 + covariance({kLeft, 0.7}, lattice);
  const MatrixXd bent = covariance({1.0, kBroad}, lattice);
  std::vector<NodePrior> made;
  for (const double bend : {0.0, 2e-4, 6e-4}) {  // m
    const MatrixXd spread = hilly + bend * bend * bent;
    made.push_back({floor.height_m, spread.diagonal().cwiseSqrt(),
                    spread.llt().solve(MatrixXd::Identity(spread.rows(), spread.cols()))});
  }
  return made;
}

// Of fields and, for heights, hills.
Weighed best_prior(const NodeLikelihood& likelihood, const Effect& map) {
  const Lattice lattice = lattice_of(map);
  const auto n = static_cast<Eigen::Index>(lattice.nodes());
  const std::size_t components = components_of(map).size();
  std::optional<Weighed> best;
  const auto offer = [&](NodePrior prior) {
    const double nats = evidence(likelihood, prior, components);
    if (!best || nats > best->evidence) best = Weighed{std::move(prior), nats};
  };
  for (const double length : {0.5, 0.7, 1.0, 1.5, 2.5}) {  // m
    const MatrixXd unit = precision({1.0, length}, lattice);
    for (const double deviation : deviations_of(map))
      offer({VectorXd::Zero(n), VectorXd::Constant(n, deviation), unit / (deviation * deviation)});
  }
  if (!std::holds_alternative<FloorUnevenness>(map)) return *best;
  for (NodePrior& prior : hills(likelihood, lattice)) offer(std::move(prior));
  return *best;
}

// The free parameters with this prior for the nodes of the map, in the same order.
std::vector<FreeParameter> under(const std::vector<FreeParameter>& free, std::size_t map,
                                 const NodePrior& prior) {
  const auto joint = std::make_shared<const MatrixXd>(prior.precision);
  std::vector<FreeParameter> all = free;
  for (FreeParameter& node : all) {
    if (node.effect != map) continue;
    const auto k = static_cast<Eigen::Index>(node.element);
    node.prior_mean = prior.mean[k];
    node.prior_width = prior.deviation[k];
    node.joint = joint;
  }
  return all;
}

// Maps are linear: the columns hold under any prior.
Fit refitted(const Problem& problem, Fit fit, std::vector<FreeParameter> free) {
  Fit start = evaluate(problem, std::move(fit.effects), std::move(free), fit.noise);
  start.linearisation = std::move(fit.linearisation);
  return refine(problem, std::move(start), 3);
}

}  // namespace

Fit with_best_prior(const Problem& problem, Fit fit, std::size_t map) {
  const Weighed best = best_prior(node_likelihood(fit, map), fit.effects[map]);
  Fit suited = refitted(problem, fit, under(fit.free, map, best.prior));
  return suited.evidence > fit.evidence ? suited : fit;
}

Fit relaid(const Problem& problem, Fit fit, std::size_t map, double beyond_m) {
  constexpr double kFine = 0.2;  // m
  const bool floor = std::holds_alternative<FloorUnevenness>(fit.effects[map]);
  const Lattice old = lattice_of(fit.effects[map]);
  const Eigen::Vector2d low = old.place(0), high = old.place(old.nodes() - 1);
  const double spacing = floor ? std::min(kFine, old.grid.spacing_m) : old.grid.spacing_m;
  if (beyond_m == 0.0 && spacing == old.grid.spacing_m) return fit;
  const Lattice lattice = lattice_over({low.x(), high.x(), low.y(), high.y()}, beyond_m, spacing);

  std::vector<Effect> effects = fit.effects;
  lay_out(effects[map], lattice);
  std::vector<FreeParameter> free;
  for (const FreeParameter& other : fit.free) {
    if (other.effect != map) free.push_back(other);
  }
  for (FreeParameter& node : free_nodes(effects[map], map, {deviations_of(effects[map])[2], 1.0}))
    free.push_back(std::move(node));
  Fit wide = refine(problem, evaluate(problem, std::move(effects), std::move(free), fit.noise), 3);

  const Weighed best = best_prior(node_likelihood(wide, map), wide.effects[map]);
  std::vector<FreeParameter> suited = under(wide.free, map, best.prior);
  return refitted(problem, std::move(wide), std::move(suited));
}

}  // namespace atmos
