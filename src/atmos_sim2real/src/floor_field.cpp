#include "atmos_sim2real/floor_field.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace atmos {

namespace {
constexpr double kNugget = 1e-4;  // of the variance: keeps the covariance well conditioned
}

Eigen::Vector2d Lattice::place(std::size_t node) const {
  return {grid.origin_m[0] + grid.spacing_m * static_cast<double>(node % columns),
          grid.origin_m[1] + grid.spacing_m * static_cast<double>(node / columns)};
}

Lattice lattice_over(const Box& box, double margin, double spacing) {
  const auto nodes = [&](double length) {
    return static_cast<std::size_t>(std::max(2.0, std::ceil((length + 2.0 * margin) / spacing) + 1.0));
  };
  Lattice lattice{{}, nodes(box.x1 - box.x0), nodes(box.y1 - box.y0)};
  const double x0 = 0.5 * (box.x0 + box.x1) - 0.5 * spacing * static_cast<double>(lattice.columns - 1);
  const double y0 = 0.5 * (box.y0 + box.y1) - 0.5 * spacing * static_cast<double>(lattice.rows - 1);
  lattice.grid = Grid{{x0, y0}, spacing};
  return lattice;
}

double affordable_spacing(const Box& box, double margin, double finest, double nodes) {
  const double area = (box.x1 - box.x0 + 2.0 * margin) * (box.y1 - box.y0 + 2.0 * margin);
  return std::max(finest, std::sqrt(area / nodes));
}

Eigen::MatrixXd covariance(const Field& field, const Lattice& lattice) {
  const auto n = static_cast<Eigen::Index>(lattice.nodes());
  Eigen::MatrixXd between(n, n);
  for (std::size_t i = 0; i < lattice.nodes(); ++i) {
    for (std::size_t j = 0; j < lattice.nodes(); ++j) {
      const double r = std::sqrt(5.0) * (lattice.place(i) - lattice.place(j)).norm() / field.length_m;
      between(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
          field.deviation * field.deviation * (1.0 + r + r * r / 3.0) * std::exp(-r);
    }
  }
  between.diagonal().array() += kNugget * field.deviation * field.deviation;
  return between;
}

Eigen::MatrixXd precision(const Field& field, const Lattice& lattice) {
  const Eigen::MatrixXd within = covariance(field, lattice);
  return within.llt().solve(Eigen::MatrixXd::Identity(within.rows(), within.cols()));
}

}  // namespace atmos
