#include "atmos_sim2real/floor_hills.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

namespace atmos {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Numbers of the shape: slope along x and y, then x, y, height and log width of every hill.
constexpr Index kSlopes = 2, kPerHill = 4;

struct ShapePrior {
  Eigen::Vector2d middle, reach;  // of hills' places [m]
  static constexpr double kSlope = 8e-4, kHeight = 1e-3, kWidth = 0.5, kLogWidth = 0.5;  // m/m, m, m, 1

  VectorXd mean(Index size) const {
    VectorXd mean = VectorXd::Zero(size);
    for (Index h = kSlopes; h < size; h += kPerHill)
      mean.segment<kPerHill>(h) << middle, 0.0, std::log(kWidth);
    return mean;
  }
  VectorXd deviation(Index size) const {
    VectorXd deviation = VectorXd::Constant(size, kSlope);
    for (Index h = kSlopes; h < size; h += kPerHill)
      deviation.segment<kPerHill>(h) << reach, kHeight, kLogWidth;
    return deviation;
  }
};

// Heights of the nodes, and what each number of the shape changes of them.
VectorXd heights_of(const VectorXd& shape, const Lattice& lattice, MatrixXd* jacobian = nullptr) {
  VectorXd heights(static_cast<Index>(lattice.nodes()));
  if (jacobian != nullptr) jacobian->resize(heights.size(), shape.size());
  for (Index node = 0; node < heights.size(); ++node) {
    const Eigen::Vector2d p = lattice.place(static_cast<std::size_t>(node));
    heights[node] = p.dot(shape.head<kSlopes>());
    if (jacobian != nullptr) jacobian->row(node).head<kSlopes>() = p;
    for (Index h = kSlopes; h < shape.size(); h += kPerHill) {
      const Eigen::Vector2d away = p - shape.segment<2>(h);
      const double width = std::exp(shape[h + 3]);
      const double bell = std::exp(-0.5 * away.squaredNorm() / (width * width));
      const double height = shape[h + 2] * bell;
      heights[node] += height;
      if (jacobian == nullptr) continue;
      jacobian->row(node).segment<2>(h) = height * away / (width * width);
      (*jacobian)(node, h + 2) = bell;
      (*jacobian)(node, h + 3) = height * away.squaredNorm() / (width * width);
    }
  }
  return heights;
}

// Whether a hill is narrower than a lattice can show.
bool finer_than(double spacing_m, const VectorXd& shape) {
  for (Index h = kSlopes; h < shape.size(); h += kPerHill) {
    if (shape[h + 3] < std::log(spacing_m)) return true;
  }
  return false;
}

struct Shape {
  VectorXd numbers;
  double evidence;  // nats over `NodeLikelihood::at`

  Index hills() const { return (numbers.size() - kSlopes) / kPerHill; }
};

class HillSearch {
 public:
  HillSearch(const NodeLikelihood& likelihood, const Lattice& lattice, const ShapePrior& prior)
      : likelihood_(likelihood), lattice_(lattice), prior_(prior) {}

  // Hill by hill, as long as the evidence grows; then those leave that later ones made superfluous.
  Shape run() const {
    constexpr int kMostHills = 12;
    constexpr int kPatience = 2;  // hills without gain, as two may be needed together
    Shape best = fitted(VectorXd::Zero(kSlopes));
    Shape shape = best;
    for (int hills = 1, since = 0; hills <= kMostHills && since <= kPatience; ++hills, ++since) {
      shape = fitted(with_another(shape.numbers));
      if (shape.evidence <= best.evidence) continue;
      best = shape;
      since = 0;
    }
    for (Index hill = 0; hill < best.hills();) {
      Shape fewer = fitted(without(best.numbers, hill));
      if (fewer.evidence > best.evidence) {
        best = std::move(fewer);
        hill = 0;
      } else {
        ++hill;
      }
    }
    return best;
  }

 private:
  // The most likely shape nearby, by Gauss-Newton with step control.
  Shape fitted(VectorXd numbers) const {
    const VectorXd mean = prior_.mean(numbers.size()), deviation = prior_.deviation(numbers.size());
    const VectorXd weight = deviation.cwiseAbs2().cwiseInverse();
    const auto objective = [&](const VectorXd& at) {
      if (finer_than(lattice_.grid.spacing_m, at)) return -std::numeric_limits<double>::infinity();
      return likelihood_.gain(heights_of(at, lattice_)) - 0.5 * (at - mean).cwiseAbs2().dot(weight);
    };
    MatrixXd J, H;
    double value = objective(numbers), damping = 1e-3;
    bool moves = true;
    for (int step = 0; moves; ++step) {
      const VectorXd heights = heights_of(numbers, lattice_, &J);
      H = J.transpose() * likelihood_.information * J;
      H.diagonal() += weight;
      const VectorXd g =
          J.transpose() * likelihood_.gradient_at(heights) - weight.cwiseProduct(numbers - mean);
      for (moves = false; !moves && damping < 1e6; damping *= 10.0) {
        MatrixXd damped = H;
        damped.diagonal() *= 1.0 + damping;
        const VectorXd trial = numbers + damped.ldlt().solve(g);
        const double trial_value = objective(trial);
        if (!(trial_value > value + kSettled)) continue;
        numbers = trial;
        value = trial_value;
        damping = std::max(1e-6, 0.02 * damping);
        moves = step < kMostSteps;
        break;
      }
    }
    const Eigen::LLT<MatrixXd> scaled(MatrixXd(deviation.asDiagonal() * H * deviation.asDiagonal()));
    Shape shape{std::move(numbers), value - scaled.matrixLLT().diagonal().array().log().sum()};
    shape.evidence -= kHillPrice * static_cast<double>(shape.hills());
    return shape;
  }

  // With the hill that gains most while the other numbers give way.
  VectorXd with_another(const VectorXd& numbers) const {
    MatrixXd J;
    const VectorXd gradient = likelihood_.gradient_at(heights_of(numbers, lattice_, &J));
    const MatrixXd SJ = likelihood_.information * J;
    MatrixXd H = J.transpose() * SJ;
    H.diagonal() += prior_.deviation(numbers.size()).cwiseAbs2().cwiseInverse();
    const MatrixXd information = likelihood_.information - SJ * H.ldlt().solve(SJ.transpose());
    double best = -1.0;
    VectorXd found(numbers.size() + kPerHill);
    found.head(numbers.size()) = numbers;
    const std::vector<Eigen::Vector2d> places = places_to_try();
    for (const double width : {0.25, 0.4, 0.6, 0.9}) {
      if (width < lattice_.grid.spacing_m) continue;
      MatrixXd bells(lattice_.nodes(), places.size());
      for (std::size_t c = 0; c < places.size(); ++c) {
        VectorXd one = VectorXd::Zero(kSlopes + kPerHill);
        one.tail<kPerHill>() << places[c], 1.0, std::log(width);
        bells.col(static_cast<Index>(c)) = heights_of(one, lattice_);
      }
      const MatrixXd pushed = information * bells;
      for (Index c = 0; c < bells.cols(); ++c) {
        const double weight = bells.col(c).dot(pushed.col(c)) + 1.0 / (prior_.kHeight * prior_.kHeight);
        const double slope = bells.col(c).dot(gradient);
        if (slope * slope / weight <= best) continue;
        best = slope * slope / weight;
        found.tail<kPerHill>() << places[static_cast<std::size_t>(c)], slope / weight, std::log(width);
      }
    }
    return found;
  }

  // Nodes about as far apart as the narrowest hill is wide.
  std::vector<Eigen::Vector2d> places_to_try() const {
    constexpr double kApart = 0.3;  // m
    const auto stride = static_cast<std::size_t>(std::max(1.0, std::round(kApart / lattice_.grid.spacing_m)));
    std::vector<Eigen::Vector2d> places;
    for (std::size_t row = 0; row < lattice_.rows; row += stride) {
      for (std::size_t column = 0; column < lattice_.columns; column += stride)
        places.push_back(lattice_.place(row * lattice_.columns + column));
    }
    return places;
  }

  static VectorXd without(const VectorXd& numbers, Index hill) {
    const Index first = kSlopes + hill * kPerHill, after = first + kPerHill;
    VectorXd fewer(numbers.size() - kPerHill);
    fewer << numbers.head(first), numbers.tail(numbers.size() - after);
    return fewer;
  }

  static constexpr double kHillPrice = 4.0;  // nats: of nearly equal shapes the one with fewer hills
  static constexpr double kSettled = 1e-3;   // nats
  static constexpr int kMostSteps = 40;

  const NodeLikelihood& likelihood_;
  const Lattice& lattice_;
  const ShapePrior& prior_;
};

}  // namespace

HillyFloor find_hills(const NodeLikelihood& likelihood, const Lattice& lattice) {
  const Eigen::Vector2d low = lattice.place(0), high = lattice.place(lattice.nodes() - 1);
  const ShapePrior prior{0.5 * (low + high), 0.5 * (high - low)};
  const Shape shape = HillSearch(likelihood, lattice, prior).run();
  HillyFloor floor;
  MatrixXd J;
  floor.height_m = heights_of(shape.numbers, lattice, &J);
  floor.covariance_m2 = J * prior.deviation(shape.numbers.size()).cwiseAbs2().asDiagonal() * J.transpose();
  floor.hills = static_cast<std::size_t>(shape.hills());
  return floor;
}

}  // namespace atmos
