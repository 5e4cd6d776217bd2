#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "atmos_stl_planner/specification.h"

namespace atmos::stl {

namespace {

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

constexpr double kMinTurn = 1e-9;  // m^2, below it three corners lie on a line

}  // namespace

Polytope box(const Eigen::Vector2d& min, const Eigen::Vector2d& max) {
  Polytope result;
  result.normals.resize(4, 2);
  result.normals << 1, 0, -1, 0, 0, 1, 0, -1;
  result.offsets.resize(4);
  result.offsets << max.x(), -min.x(), max.y(), -min.y();
  return result;
}

std::optional<Polytope> polygon(std::vector<Eigen::Vector2d> corners) {
  const std::size_t n = corners.size();
  if (n < 3) return std::nullopt;
  double area = 0.0;
  for (std::size_t i = 0; i < n; ++i) area += cross(corners[i], corners[(i + 1) % n]);
  if (area < 0.0) std::reverse(corners.begin(), corners.end());
  Polytope result;
  result.normals.resize(static_cast<Eigen::Index>(n), 2);
  result.offsets.resize(static_cast<Eigen::Index>(n));
  double turned = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector2d side = corners[(i + 1) % n] - corners[i];
    const Eigen::Vector2d next = corners[(i + 2) % n] - corners[(i + 1) % n];
    if (!(cross(side, next) > kMinTurn)) return std::nullopt;
    turned += std::atan2(cross(side, next), side.dot(next));
    const Eigen::Vector2d normal = Eigen::Vector2d(side.y(), -side.x()).normalized();
    result.normals.row(static_cast<Eigen::Index>(i)) = normal.transpose();
    result.offsets[static_cast<Eigen::Index>(i)] = normal.dot(corners[i]);
  }
  // Left turns alone also make stars, which go around more than once.
  if (turned > 2.5 * M_PI) return std::nullopt;
  return result;
}

std::vector<Eigen::Vector2d> corners_of(const Polytope& polytope) {
  std::vector<Eigen::Vector2d> corners;
  const Eigen::Index n = polytope.offsets.size();
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = i + 1; j < n; ++j) {
      Eigen::Matrix2d sides;
      sides << polytope.normals.row(i), polytope.normals.row(j);
      if (std::abs(sides.determinant()) < 1e-9) continue;
      const Eigen::Vector2d corner =
          sides.inverse() * Eigen::Vector2d(polytope.offsets[i], polytope.offsets[j]);
      if ((polytope.normals * corner - polytope.offsets).maxCoeff() < 1e-9) corners.push_back(corner);
    }
  }
  if (corners.empty()) return corners;
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& corner : corners) middle += corner / static_cast<double>(corners.size());
  std::sort(corners.begin(), corners.end(), [&middle](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    return std::atan2(a.y() - middle.y(), a.x() - middle.x()) <
           std::atan2(b.y() - middle.y(), b.x() - middle.x());
  });
  return corners;
}

InscribedDisc inscribed_disc(const Polytope& polytope) {
  // The largest disc touches three sides, or two parallel ones: then any centre between them will do, and the
  // middle of the corners is tried too.
  InscribedDisc best{Eigen::Vector2d::Zero(), -1.0};
  const auto consider = [&](const Eigen::Vector2d& center) {
    const double radius = (polytope.offsets - polytope.normals * center).minCoeff();
    if (radius > best.radius) best = {center, radius};
  };
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  const std::vector<Eigen::Vector2d> corners = corners_of(polytope);
  for (const Eigen::Vector2d& corner : corners) middle += corner / static_cast<double>(corners.size());
  consider(middle);
  const Eigen::Index n = polytope.offsets.size();
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = i + 1; j < n; ++j) {
      for (Eigen::Index k = j + 1; k < n; ++k) {
        Eigen::Matrix3d touch;
        touch << polytope.normals.row(i), 1.0, polytope.normals.row(j), 1.0, polytope.normals.row(k), 1.0;
        if (std::abs(touch.determinant()) < 1e-9) continue;
        const Eigen::Vector3d solution =
            touch.inverse() * Eigen::Vector3d(polytope.offsets[i], polytope.offsets[j], polytope.offsets[k]);
        consider(solution.head<2>());
      }
    }
  }
  return best;
}

Eigen::Vector2d Region::displacement(double time_s) const {
  if (path.empty()) return Eigen::Vector2d::Zero();
  if (time_s <= path.front().time_s) return path.front().displacement_m;
  for (std::size_t i = 1; i < path.size(); ++i) {
    if (time_s > path[i].time_s) continue;
    const double share = (time_s - path[i - 1].time_s) / (path[i].time_s - path[i - 1].time_s);
    return (1.0 - share) * path[i - 1].displacement_m + share * path[i].displacement_m;
  }
  return path.back().displacement_m;
}

}  // namespace atmos::stl
