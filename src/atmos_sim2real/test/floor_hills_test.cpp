#include "atmos_sim2real/floor_hills.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include <cmath>
#include <random>

namespace atmos {
namespace {

struct Hill {
  double x, y, height, width;
};
const std::vector<Hill> kTruth = {{0.8, 0.9, 1e-3, 0.5}, {2.1, 1.4, -8e-4, 0.4}};

double truth_at(const Eigen::Vector2d& p) {
  double height = 0.0;
  for (const Hill& hill : kTruth)
    height += hill.height *
              std::exp(-0.5 * ((p.x() - hill.x) * (p.x() - hill.x) + (p.y() - hill.y) * (p.y() - hill.y)) /
                       (hill.width * hill.width));
  return height;
}

// What a flight says that measured differences between neighbouring nodes to 20 um, for x above 0.8 m alone.
NodeLikelihood measured(const Lattice& lattice, double noise) {
  const auto n = static_cast<Eigen::Index>(lattice.nodes());
  NodeLikelihood likelihood{Eigen::VectorXd::Zero(n), Eigen::VectorXd::Zero(n), Eigen::MatrixXd::Zero(n, n)};
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal(0.0, noise);
  const double weight = 1.0 / (20e-6 * 20e-6);
  for (std::size_t a = 0; a < lattice.nodes(); ++a) {
    for (std::size_t b : {a + 1, a + lattice.columns}) {
      if (b >= lattice.nodes() || (b == a + 1 && b % lattice.columns == 0) || lattice.place(a).x() < 0.8)
        continue;
      const double difference = truth_at(lattice.place(b)) - truth_at(lattice.place(a)) + normal(random);
      Eigen::VectorXd row = Eigen::VectorXd::Zero(n);
      row[static_cast<Eigen::Index>(b)] = 1.0;
      row[static_cast<Eigen::Index>(a)] = -1.0;
      likelihood.information += weight * row * row.transpose();
      likelihood.gradient += weight * difference * row;
    }
  }
  return likelihood;
}

// Root mean square of what heights differ from the truth by, over nodes with x in a range, but for a
// constant.
double error(const Eigen::VectorXd& heights, const Lattice& lattice, double x0, double x1) {
  std::vector<double> off;
  double mean = 0.0;
  for (std::size_t node = 0; node < lattice.nodes(); ++node) {
    const Eigen::Vector2d p = lattice.place(node);
    if (p.x() < x0 || p.x() > x1) continue;
    off.push_back(heights[static_cast<Eigen::Index>(node)] - truth_at(p));
    mean += off.back();
  }
  mean /= static_cast<double>(off.size());
  double squares = 0.0;
  for (const double o : off) squares += (o - mean) * (o - mean);
  return std::sqrt(squares / static_cast<double>(off.size()));
}

TEST(FloorHills, AHalfVisitedHillIsContinued) {
  const Lattice lattice = lattice_over({0.0, 3.0, 0.0, 2.4}, 0.0, 0.2);
  const NodeLikelihood likelihood = measured(lattice, 20e-6);
  const HillyFloor found = find_hills(likelihood, lattice);
  EXPECT_EQ(found.hills, 2u);
  EXPECT_LT(error(found.height_m, lattice, 0.8, 3.0), 20e-6);
  EXPECT_LT(error(found.height_m, lattice, 0.0, 0.79), 60e-6);

  // A smooth random field knows the visited part as well, and less of the other.
  const Eigen::MatrixXd field = precision({6e-4, 0.7}, lattice);
  const Eigen::VectorXd smooth = (field + likelihood.information).ldlt().solve(likelihood.gradient);
  EXPECT_LT(error(smooth, lattice, 0.8, 3.0), 30e-6);
  EXPECT_GT(error(smooth, lattice, 0.0, 0.79), 2.0 * error(found.height_m, lattice, 0.0, 0.79));
}

TEST(FloorHills, AFlatFloorHasNone) {
  const Lattice lattice = lattice_over({0.0, 3.0, 0.0, 2.4}, 0.0, 0.3);
  NodeLikelihood likelihood = measured(lattice, 0.0);
  std::mt19937_64 random(6);
  std::normal_distribution<double> normal;
  const Eigen::MatrixXd root =
      Eigen::LLT<Eigen::MatrixXd>(
          likelihood.information +
          1e-3 * Eigen::MatrixXd::Identity(likelihood.information.rows(), likelihood.information.rows()))
          .matrixL();
  for (double& g : likelihood.gradient) g = normal(random);
  likelihood.gradient = root * likelihood.gradient;
  EXPECT_EQ(find_hills(likelihood, lattice).hills, 0u);
}

// The closed form against two nodes worked out by hand: H = diag(4, 1), g = (8, 0), prior N(0, 1).
TEST(NodeLikelihood, EvidenceOfANormalPrior) {
  NodeLikelihood likelihood{Eigen::VectorXd::Zero(2), Eigen::Vector2d(8.0, 0.0), Eigen::MatrixXd::Zero(2, 2)};
  likelihood.information.diagonal() << 4.0, 1.0;
  const double expected = 0.5 * 64.0 / 5.0 - 0.5 * std::log(5.0) - 0.5 * std::log(2.0);
  EXPECT_NEAR(likelihood.evidence(Eigen::VectorXd::Zero(2), Eigen::MatrixXd::Identity(2, 2)), expected,
              1e-12);
}

TEST(FloorHills, NoneIsNarrowerThanNodesAreApart) {
  // One node stands out of a floor that is flat everywhere else, measured to 20 um.
  const Lattice lattice = lattice_over({0.0, 3.0, 0.0, 2.4}, 0.0, 0.2);
  const auto n = static_cast<Eigen::Index>(lattice.nodes());
  const Eigen::Index spike = 5 * static_cast<Eigen::Index>(lattice.columns) + 7;
  const double weight = 1.0 / (20e-6 * 20e-6);
  NodeLikelihood likelihood{Eigen::VectorXd::Zero(n), weight * 4e-4 * Eigen::VectorXd::Unit(n, spike),
                            weight * Eigen::MatrixXd::Identity(n, n)};
  const HillyFloor found = find_hills(likelihood, lattice);
  ASSERT_GT(found.hills, 0u);
  EXPECT_GT(found.height_m[spike + 1], 0.3 * found.height_m[spike]);
}

}  // namespace
}  // namespace atmos
