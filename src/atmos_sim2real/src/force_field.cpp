#include "atmos_sim2real/force_field.h"

#include <Eigen/Cholesky>
#include <vector>

namespace atmos {

double share_with_curl(const Airflow& field) {
  const std::size_t columns = field.force_x_n.front().size(), rows = field.force_x_n.size();
  const auto node = [&](std::size_t i, std::size_t j) { return static_cast<Eigen::Index>(j * columns + i); };
  const auto n = static_cast<Eigen::Index>(columns * rows);
  struct Edge {  // between neighbouring nodes, with the force along it
    Eigen::Index from, to;
    double force;
  };
  std::vector<Edge> along_x, along_y;
  for (std::size_t j = 0; j < rows; ++j) {
    for (std::size_t i = 0; i + 1 < columns; ++i)
      along_x.push_back(
          {node(i, j), node(i + 1, j), 0.5 * (field.force_x_n[j][i] + field.force_x_n[j][i + 1])});
  }
  for (std::size_t j = 0; j + 1 < rows; ++j) {
    for (std::size_t i = 0; i < columns; ++i)
      along_y.push_back(
          {node(i, j), node(i, j + 1), 0.5 * (field.force_y_n[j][i] + field.force_y_n[j + 1][i])});
  }
  // Least squares for a potential whose differences are those forces beyond their mean.
  Eigen::MatrixXd H = 1e-9 * Eigen::MatrixXd::Identity(n, n);
  Eigen::VectorXd g = Eigen::VectorXd::Zero(n);
  double all = 0.0, varying = 0.0;
  for (const std::vector<Edge>& edges : {along_x, along_y}) {
    double mean = 0.0;
    for (const Edge& edge : edges) mean += edge.force / static_cast<double>(edges.size());
    for (const auto& [from, to, force] : edges) {
      const double rest = force - mean;
      H(from, from) += 1.0;
      H(to, to) += 1.0;
      H(from, to) -= 1.0;
      H(to, from) -= 1.0;
      g[to] += rest;
      g[from] -= rest;
      all += force * force;
      varying += rest * rest;
    }
  }
  constexpr double kNothing = 1e-12;  // of the field's square
  return varying > kNothing * all ? 1.0 - g.dot(H.ldlt().solve(g)) / varying : 0.0;
}

}  // namespace atmos
