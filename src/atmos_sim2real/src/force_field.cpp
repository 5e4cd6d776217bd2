#include "atmos_sim2real/force_field.h"

#include <Eigen/Cholesky>

namespace atmos {

double share_with_curl(const Airflow& field) {
  const std::size_t columns = field.force_x_n.front().size(), rows = field.force_x_n.size();
  const auto node = [&](std::size_t i, std::size_t j) { return static_cast<Eigen::Index>(j * columns + i); };
  const auto n = static_cast<Eigen::Index>(columns * rows);
  // Least squares for a potential whose differences are the forces between neighbouring nodes.
  Eigen::MatrixXd H = 1e-9 * Eigen::MatrixXd::Identity(n, n);
  Eigen::VectorXd g = Eigen::VectorXd::Zero(n);
  double total = 0.0;
  const auto edge = [&](Eigen::Index from, Eigen::Index to, double force) {
    H(from, from) += 1.0;
    H(to, to) += 1.0;
    H(from, to) -= 1.0;
    H(to, from) -= 1.0;
    g[to] += force;
    g[from] -= force;
    total += force * force;
  };
  for (std::size_t j = 0; j < rows; ++j) {
    for (std::size_t i = 0; i + 1 < columns; ++i)
      edge(node(i, j), node(i + 1, j), 0.5 * (field.force_x_n[j][i] + field.force_x_n[j][i + 1]));
  }
  for (std::size_t j = 0; j + 1 < rows; ++j) {
    for (std::size_t i = 0; i < columns; ++i)
      edge(node(i, j), node(i, j + 1), 0.5 * (field.force_y_n[j][i] + field.force_y_n[j + 1][i]));
  }
  return total > 0.0 ? 1.0 - g.dot(H.ldlt().solve(g)) / total : 0.0;
}

}  // namespace atmos
