#include "atmos_nmpc/stage_kkt.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>
#include <random>

namespace atmos {
namespace {

using Matrix = Eigen::MatrixXd;
using Vector = Eigen::VectorXd;

// A random stage problem as one dense KKT matrix.
struct Problem {
  StageLayout layout;
  Matrix dense;

  int index_of_input(int k) const { return k * (layout.states + layout.inputs); }
  int index_of_state(int k) const { return (k - 1) * (layout.states + layout.inputs) + layout.inputs; }
  int row(int k) const { return layout.variables() + k * layout.states; }
};

class Random {
 public:
  explicit Random(std::uint32_t seed) : engine_(seed) {}
  Matrix matrix(int rows, int columns) {
    Matrix M(rows, columns);
    for (int i = 0; i < M.size(); ++i) M.data()[i] = normal_(engine_);
    return M;
  }

 private:
  std::mt19937 engine_;
  std::normal_distribution<double> normal_;
};

// `curvature` is added to a Hessian of random sign; `dual`: with a block -E, some of it zero.
Problem random_problem(const StageLayout& layout, double curvature, bool dual, std::uint32_t seed) {
  Random random(seed);
  const int n = layout.states, m = layout.inputs;
  Problem problem{layout, {}};
  const int size = layout.variables() + layout.constraints();
  Matrix K = Matrix::Zero(size, size);
  for (int k = 0; k <= layout.stages; ++k) {
    Matrix H = random.matrix(n + m, n + m);
    H = 0.5 * (H + H.transpose()).eval() + curvature * Matrix::Identity(n + m, n + m);
    if (k > 0) K.block(problem.index_of_state(k), problem.index_of_state(k), n, n) = H.topLeftCorner(n, n);
    if (k == layout.stages) break;
    const int u = problem.index_of_input(k), row = problem.row(k);
    K.block(u, u, m, m) = H.bottomRightCorner(m, m);
    const Matrix A = 0.5 * random.matrix(n, n), B = random.matrix(n, m);
    K.block(row, u, n, m) = B;
    if (k > 0) {
      const int x = problem.index_of_state(k);
      K.block(u, x, m, n) = H.bottomLeftCorner(m, n);
      K.block(x, u, n, m) = H.bottomLeftCorner(m, n).transpose();
      K.block(row, x, n, n) = A;
    }
    K.block(row, problem.index_of_state(k + 1), n, n) = -Matrix::Identity(n, n);
    if (dual) {
      for (int i = 0; i < n; ++i)
        K(row + i, row + i) = i % 3 == 0 ? 0.0 : -std::abs(random.matrix(1, 1)(0, 0));
    }
  }
  const int z = layout.variables();
  K.topRightCorner(z, layout.constraints()) = K.bottomLeftCorner(layout.constraints(), z).transpose();
  problem.dense = K;
  return problem;
}

void fill(StageKkt& kkt, const Problem& problem) {
  kkt.set_zero();
  for (int c = 0; c < problem.dense.cols(); ++c) {
    for (int r = c; r < problem.dense.rows(); ++r) {
      if (problem.dense(r, c) != 0.0) kkt.entries()[kkt.slot(r, c).value()] += problem.dense(r, c);
    }
  }
}

bool inertia_is_right(const Problem& problem) {
  const Vector values =
      Eigen::SelfAdjointEigenSolver<Matrix>(problem.dense, Eigen::EigenvaluesOnly).eigenvalues();
  return (values.array() < 0.0).count() == problem.layout.constraints();
}

const StageLayout kLayouts[] = {{1, 3, 2}, {4, 13, 4}, {6, 13, 6}, {5, 10, 6},
                                {7, 1, 1}, {3, 4, 4},  {20, 13, 4}};

TEST(StageKkt, SolvesAsDenseLuDoes) {
  std::uint32_t seed = 100;
  for (const StageLayout& layout : kLayouts) {
    for (const bool dual : {false, true}) {
      for (int trial = 0; trial < 10; ++trial) {
        const Problem problem = random_problem(layout, 10.0, dual, ++seed);
        StageKkt kkt(layout);
        fill(kkt, problem);
        ASSERT_TRUE(kkt.factorise()) << "seed " << seed;
        const Eigen::PartialPivLU<Matrix> lu(problem.dense);
        for (int side = 0; side < 2; ++side) {
          Vector rhs = Random(seed + 7 + side).matrix(kkt.size(), 1);
          const Vector expected = lu.solve(rhs);
          kkt.solve(rhs.data());
          EXPECT_LT((rhs - expected).norm(), 1e-9 * (1.0 + expected.norm())) << "seed " << seed;
        }
      }
    }
  }
}

// As in an interior-point method close to its bounds, and in its restoration phase.
TEST(StageKkt, StaysAccurateOverManyOrdersOfMagnitude) {
  const StageLayout layout{10, 13, 4};
  for (std::uint32_t seed = 1; seed <= 20; ++seed) {
    Problem problem = random_problem(layout, 10.0, true, seed);
    Random random(seed + 500);
    for (int i = 0; i < problem.dense.rows(); ++i) {
      const double scale = std::pow(10.0, 2.0 * random.matrix(1, 1)(0, 0));
      if (i < layout.variables()) {
        problem.dense(i, i) += scale;
      } else {
        problem.dense(i, i) = -scale;
      }
    }
    StageKkt kkt(layout);
    fill(kkt, problem);
    ASSERT_TRUE(kkt.factorise()) << "seed " << seed;
    const Vector rhs = random.matrix(kkt.size(), 1);
    Vector solution = rhs;
    kkt.solve(solution.data());
    const double residual = (problem.dense * solution - rhs).cwiseAbs().maxCoeff();
    EXPECT_LT(residual, 1e-9 * (1.0 + (problem.dense.cwiseAbs() * solution.cwiseAbs()).maxCoeff()))
        << "seed " << seed;
  }
}

TEST(StageKkt, AcceptsExactlyTheRightInertia) {
  int right = 0, wrong = 0;
  std::uint32_t seed = 1000;
  for (const StageLayout& layout : kLayouts) {
    if (layout.stages > 10) continue;  // the dense eigenvalues would take most of the test's time
    for (const bool dual : {false, true}) {
      for (int trial = 0; trial < 30; ++trial) {
        const double curvature = 0.25 * trial;
        const Problem problem = random_problem(layout, curvature, dual, ++seed);
        StageKkt kkt(layout);
        fill(kkt, problem);
        const bool expected = inertia_is_right(problem);
        EXPECT_EQ(kkt.factorise(), expected) << "seed " << seed;
        ++(expected ? right : wrong);
      }
    }
  }
  EXPECT_GT(right, 50);  // both answers have been asked for
  EXPECT_GT(wrong, 50);
}

TEST(StageKkt, EntriesOutsideOfTheStagesHaveNoSlot) {
  const StageLayout layout{3, 2, 1};
  const StageKkt kkt(layout);
  // z = [u0 x1 x1 u1 x2 x2 u2 x3 x3], rows from 9 on.
  EXPECT_TRUE(kkt.slot(1, 3));  // x1, u1
  EXPECT_TRUE(kkt.slot(3, 1));
  EXPECT_FALSE(kkt.slot(0, 1));   // u0, x1
  EXPECT_FALSE(kkt.slot(3, 4));   // u1, x2
  EXPECT_TRUE(kkt.slot(9, 0));    // row 0, u0
  EXPECT_TRUE(kkt.slot(9, 1));    // row 0, its own component of x1
  EXPECT_FALSE(kkt.slot(9, 2));   // row 0, the other one
  EXPECT_FALSE(kkt.slot(9, 3));   // row 0, u1
  EXPECT_TRUE(kkt.slot(11, 2));   // row 1, x1
  EXPECT_TRUE(kkt.slot(14, 14));  // the dual block's diagonal
  EXPECT_FALSE(kkt.slot(14, 13));
  EXPECT_FALSE(kkt.slot(15, 0));
  EXPECT_FALSE(kkt.slot(-1, 0));
}

TEST(StageKkt, RefusesRowsOfAnotherForm) {
  const Problem problem = random_problem({2, 3, 2}, 10.0, false, 5);
  StageKkt kkt(problem.layout);
  fill(kkt, problem);
  kkt.entries()[*kkt.slot(problem.row(1) + 1, problem.index_of_state(2) + 1)] = -2.0;
  EXPECT_FALSE(kkt.factorise());
}

}  // namespace
}  // namespace atmos
