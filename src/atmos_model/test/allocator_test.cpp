#include "atmos_model/allocator.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <random>

#include "atmos_model/allocation.h"
#include "nominal.h"

// Counts every allocation of the process: operator new and Eigen both end in malloc.
static std::size_t g_allocations = 0;
extern "C" void* __libc_malloc(std::size_t size);
extern "C" void* malloc(std::size_t size) {
  ++g_allocations;
  return __libc_malloc(size);
}

namespace atmos {
namespace {

constexpr double kForce = 1.7;
constexpr double kArm = 0.12;
constexpr double kExact = 1e-9;

// Wrench per unit duty, written down independently of the allocator.
Eigen::Matrix<double, 3, Eigen::Dynamic> columns(const Vehicle& vehicle,
                                                 const std::vector<int>& failed = {}) {
  Eigen::Matrix<double, 3, Eigen::Dynamic> B(3, vehicle.thrusters.size());
  for (std::size_t i = 0; i < vehicle.thrusters.size(); ++i) {
    const Thruster& t = vehicle.thrusters[i];
    const double lever = t.position_m.x() * t.direction.y() - t.position_m.y() * t.direction.x();
    B.col(i) = t.force_n * Eigen::Vector3d(t.direction.x(), t.direction.y(), lever);
  }
  for (const int number : failed) B.col(number - 1).setZero();
  return B;
}

// The paper's vehicle: |Fx| <= 2f, |Fy| <= 2f, |Fx| + |Fy| + |tau|/d <= 4f.
double nominal_reach(const BodyWrench& w) {
  const double sum = std::abs(w.x()) + std::abs(w.y()) + std::abs(w.z()) / kArm;
  return 1.0 / std::max({std::abs(w.x()) / (2 * kForce), std::abs(w.y()) / (2 * kForce), sum / (4 * kForce)});
}

// Bound by linear programming duality without the cross products of the code under test: max s with B u = s w
// is the least of support(n) / (n . w) over all n with n . w > 0. At the optimum n is orthogonal to two
// columns; here every candidate comes out of a null space by singular value decomposition.
double dual_reach(const Eigen::Matrix<double, 3, Eigen::Dynamic>& B, const BodyWrench& w) {
  double reach = std::numeric_limits<double>::infinity();
  for (Eigen::Index i = 0; i < B.cols(); ++i) {
    for (Eigen::Index j = 0; j < i; ++j) {
      Eigen::Matrix<double, 2, 3> rows;
      rows << B.col(i).transpose(), B.col(j).transpose();
      const Eigen::JacobiSVD<Eigen::Matrix<double, 2, 3>> svd(rows, Eigen::ComputeFullV);
      if (svd.singularValues()[1] < 1e-9) continue;
      Eigen::Vector3d n = svd.matrixV().col(2);
      if (n.dot(w) < 0.0) n = -n;
      if (n.dot(w) < 1e-12 * w.norm()) continue;
      double support = 0.0;
      for (Eigen::Index k = 0; k < B.cols(); ++k) support += std::max(0.0, n.dot(B.col(k)));
      reach = std::min(reach, support / n.dot(w));
    }
  }
  return reach;
}

// Brute force: {B u : 0 <= u <= 1} holds exactly the directions in which some corner lies on either side of
// every plane.
bool positively_spans(const Eigen::Matrix<double, 3, Eigen::Dynamic>& B) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  const Eigen::Vector3d unit(1.0, 1.0, kArm);
  // Candidate separating planes: those through two columns (the extreme ones) and random ones.
  std::vector<Eigen::Vector3d> planes;
  for (Eigen::Index i = 0; i < B.cols(); ++i)
    for (Eigen::Index j = 0; j < i; ++j)
      planes.push_back(B.col(i).cwiseQuotient(unit).head<3>().cross(B.col(j).cwiseQuotient(unit).head<3>()));
  for (int k = 0; k < 2000; ++k) planes.push_back({normal(random), normal(random), normal(random)});
  for (const Eigen::Vector3d& plane : planes) {
    if (plane.norm() < 1e-6) continue;
    double above = 0.0, below = 0.0;
    for (Eigen::Index k = 0; k < B.cols(); ++k) {
      const double side = plane.normalized().dot(B.col(k).cwiseQuotient(unit));
      above = std::max(above, side);
      below = std::max(below, -side);
    }
    if (above < 1e-9 || below < 1e-9) return false;
  }
  return true;
}

BodyWrench sum_of(const Eigen::Matrix<double, 3, Eigen::Dynamic>& B, const std::vector<double>& duty) {
  return B * Eigen::Map<const Eigen::VectorXd>(duty.data(), static_cast<Eigen::Index>(duty.size()));
}

// Exact inside, scaled along the direction outside, duties in range, of least norm by the optimality
// conditions.
void expect_right(const Allocator& allocator, const Eigen::Matrix<double, 3, Eigen::Dynamic>& B,
                  const BodyWrench& w, double reach) {
  const Allocation result = allocator.allocate(w);
  ASSERT_EQ(result.duty.size(), static_cast<std::size_t>(B.cols()));
  const double scale = std::min(1.0, reach);
  ASSERT_NEAR(result.scale, scale, kExact) << w.transpose();
  ASSERT_LT((sum_of(B, result.duty) - scale * w).cwiseAbs().maxCoeff(), kExact) << w.transpose();
  ASSERT_LT((result.achieved - scale * w).cwiseAbs().maxCoeff(), kExact) << w.transpose();
  for (std::size_t i = 0; i < result.duty.size(); ++i) {
    ASSERT_GE(result.duty[i], 0.0);
    ASSERT_LE(result.duty[i], 1.0);
    const bool failed = B.col(static_cast<Eigen::Index>(i)).isZero();
    ASSERT_TRUE(!failed || result.duty[i] == 0.0);
  }
}

TEST(Allocator, IsExactInsideTheNominalSetAndScalesOutsideOnADenseGrid) {
  const Vehicle vehicle = nominal_vehicle();
  const Allocator allocator(vehicle);
  const auto B = columns(vehicle);
  const int half = 20;
  for (int i = -half; i <= half; ++i) {
    for (int j = -half; j <= half; ++j) {
      for (int k = -half; k <= half; ++k) {
        // Grid points lie inside, outside and, in all three inequalities, exactly on the boundary.
        const BodyWrench w(0.2 * kForce * i, 0.2 * kForce * j, 0.4 * kForce * kArm * k);
        if (i == 0 && j == 0 && k == 0) continue;
        ASSERT_NO_FATAL_FAILURE(expect_right(allocator, B, w, nominal_reach(w)));
        ASSERT_NEAR(allocator.attainable_scale(w), nominal_reach(w), 1e-12 * nominal_reach(w));
      }
    }
  }
}

TEST(Allocator, IsExactOnTheBoundaryAndItsEdgesAndCorners) {
  const Vehicle vehicle = nominal_vehicle();
  const Allocator allocator(vehicle);
  const auto B = columns(vehicle);
  for (int corner = 0; corner < 256; ++corner) {
    std::vector<double> u(8), v(8);
    for (int i = 0; i < 8; ++i) {
      u[i] = (corner >> i) & 1;
      v[i] = ((corner ^ (corner >> 1)) >> i) & 1;
    }
    const BodyWrench a = sum_of(B, u), b = sum_of(B, v);
    for (const double share : {0.0, 0.25, 0.5, 1.0}) {
      BodyWrench w = (1 - share) * a + share * b;
      if (w.norm() < 1e-9) continue;
      w *= allocator.attainable_scale(w);
      for (const double nudge : {1.0 - 1e-12, 1.0, 1.0 + 1e-12})
        ASSERT_NO_FATAL_FAILURE(expect_right(allocator, B, nudge * w, nominal_reach(nudge * w)));
    }
  }
}

TEST(Allocator, FindsTheDutiesOfLeastNorm) {
  const Vehicle vehicle = nominal_vehicle();
  const Allocator allocator(vehicle);
  const auto B = columns(vehicle);
  const Eigen::MatrixXd null_space = Eigen::FullPivLU<Eigen::MatrixXd>(B).kernel();
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::normal_distribution<double> normal;
  for (int trial = 0; trial < 500; ++trial) {
    Eigen::VectorXd u(8);
    for (int i = 0; i < 8; ++i) u[i] = uniform(random);
    const std::vector<double> duty = allocator.allocate(B * u).duty;
    const Eigen::VectorXd best = Eigen::Map<const Eigen::VectorXd>(duty.data(), 8);
    EXPECT_LE(best.norm(), u.norm() + 1e-9);
    // No admissible step inside the null space makes them shorter.
    for (int k = 0; k < 50; ++k) {
      Eigen::VectorXd step(null_space.cols());
      for (Eigen::Index c = 0; c < step.size(); ++c) step[c] = normal(random);
      const Eigen::VectorXd other = best + 1e-3 * null_space * step;
      if (other.minCoeff() < 0.0 || other.maxCoeff() > 1.0) continue;
      EXPECT_GE(other.norm(), best.norm() - 1e-9);
    }
  }
  // Known answers: a pure push is shared by the two thrusters on that side, pure yaw by all four that turn
  // that way.
  const std::vector<double> push = allocator.allocate({kForce, 0.0, 0.0}).duty;
  EXPECT_NEAR(push[0], 0.5, kExact);
  EXPECT_NEAR(push[2], 0.5, kExact);
  EXPECT_EQ(std::count(push.begin(), push.end(), 0.0), 6);
  const std::vector<double> yaw = allocator.allocate({0.0, 0.0, 4 * kForce * kArm}).duty;
  const auto turning = columns(vehicle).row(2);
  for (int i = 0; i < 8; ++i) EXPECT_EQ(yaw[i], turning[i] > 0 ? 1.0 : 0.0);
}

TEST(Allocator, EverySingleFailureWorks) {
  const Vehicle vehicle = nominal_vehicle();
  std::mt19937 random(11);
  std::normal_distribution<double> normal;
  for (int failed = 1; failed <= 8; ++failed) {
    const Allocator allocator(vehicle, {failed});
    const auto B = columns(vehicle, {failed});
    for (int trial = 0; trial < 2000; ++trial) {
      const BodyWrench w(2 * normal(random), 2 * normal(random), 0.3 * normal(random));
      const double reach = dual_reach(B, w);
      ASSERT_NO_FATAL_FAILURE(expect_right(allocator, B, w, reach));
      ASSERT_NO_FATAL_FAILURE(expect_right(allocator, B, reach * w, 1.0));
    }
  }
}

TEST(Allocator, PairsOfFailuresWorkExactlyWhenTheOthersControlTheRobot) {
  const Vehicle vehicle = nominal_vehicle();
  std::mt19937 random(13);
  std::normal_distribution<double> normal;
  int working = 0;
  for (int a = 1; a <= 8; ++a) {
    for (int b = a + 1; b <= 8; ++b) {
      const auto B = columns(vehicle, {a, b});
      if (positively_spans(B)) {
        ++working;
        const Allocator allocator(vehicle, {b, a});
        for (int trial = 0; trial < 200; ++trial) {
          const BodyWrench w(2 * normal(random), 2 * normal(random), 0.3 * normal(random));
          ASSERT_NO_FATAL_FAILURE(expect_right(allocator, B, w, dual_reach(B, w)));
        }
      } else {
        try {
          Allocator allocator(vehicle, {b, a});
          FAIL() << "pair " << a << ", " << b << " was accepted";
        } catch (const std::invalid_argument& error) {
          EXPECT_NE(std::string(error.what()).find(std::to_string(a) + ", " + std::to_string(b)),
                    std::string::npos)
              << error.what();
        }
      }
    }
  }
  // By hand, 12 of 28 do not: both thrusters of one push (1 3, 2 4, 5 7, 6 8), and one of each axis that turn
  // the same way (1 5, 1 8, 4 5, 4 8, 2 6, 2 7, 3 6, 3 7): some diagonal push then turns the robot whatever
  // else is fired.
  EXPECT_EQ(working, 16);
}

TEST(Allocator, RefusesNumbersThatDoNotExistAndVehiclesThatCannotBeControlled) {
  Vehicle vehicle = nominal_vehicle();
  for (const int number : {0, -1, 9})
    EXPECT_THROW(Allocator(vehicle, {number}), std::invalid_argument) << number;
  EXPECT_THROW(Allocator(vehicle, {1, 2, 3, 4, 5, 6, 7, 8}), std::invalid_argument);
  vehicle.thrusters.resize(4);
  EXPECT_THROW(Allocator{vehicle}, std::invalid_argument);
  vehicle.thrusters.clear();
  EXPECT_THROW(Allocator{vehicle}, std::invalid_argument);
}

RC_GTEST_PROP(AllocatorProperty, IsExactForAnyControllableVehicle, ()) {
  Vehicle vehicle = nominal_vehicle();
  const auto number = [](int range) { return 0.001 * *rc::gen::inRange(-range, range + 1); };
  for (Thruster& thruster : vehicle.thrusters) {
    thruster.position_m += Eigen::Vector3d(number(50), number(50), number(50));
    const double angle = std::atan2(thruster.direction.y(), thruster.direction.x()) + number(300);
    thruster.direction = {std::cos(angle), std::sin(angle), 0.0};
    thruster.force_n = 1.7 + number(1000);
  }
  const BodyWrench w(number(5000), number(5000), number(1000));
  RC_PRE(w.norm() > 0.0);
  const auto B = columns(vehicle);
  RC_PRE(positively_spans(B));
  const Allocator allocator(vehicle);
  const double scale = std::min(1.0, dual_reach(B, w));
  const Allocation result = allocator.allocate(w);
  RC_ASSERT(std::abs(result.scale - scale) < kExact);
  RC_ASSERT((result.achieved - scale * w).cwiseAbs().maxCoeff() < kExact);
  RC_ASSERT((sum_of(B, result.duty) - result.achieved).cwiseAbs().maxCoeff() < kExact);
}

RC_GTEST_PROP(AllocatorProperty, IsContinuousInTheWrench, ()) {
  const Vehicle vehicle = nominal_vehicle();
  static const Allocator whole(vehicle);
  static const Allocator broken(vehicle, {3});
  const auto number = [](int range) { return 0.001 * *rc::gen::inRange(-range, range + 1); };
  const BodyWrench w(number(6000), number(6000), number(1200));
  RC_PRE(w.norm() > 0.1);
  const double size = 1e-6;
  const BodyWrench step = size * BodyWrench(number(1000), number(1000), number(1000) * kArm);
  for (const Allocator* allocator : {&whole, &broken}) {
    const std::vector<double> a = allocator->allocate(w).duty, b = allocator->allocate(w + step).duty;
    for (std::size_t i = 0; i < a.size(); ++i) RC_ASSERT(std::abs(a[i] - b[i]) < 50.0 * size);
  }
}

TEST(Allocator, SendsPulsesShorterThanTheMinimumAsZeroAndSaysWhatIsLeft) {
  Vehicle vehicle = nominal_vehicle();
  vehicle.pwm.min_on_time_s = 0.01;  // a duty of 0.1
  const Allocator allocator(vehicle);
  const auto B = columns(vehicle);
  const Allocation kept = allocator.allocate({2 * kForce * 0.1, 0.0, 0.0});
  EXPECT_NEAR(kept.duty[0], 0.1, kExact);
  EXPECT_NEAR(kept.achieved.x(), 2 * kForce * 0.1, kExact);
  const Allocation dropped = allocator.allocate({2 * kForce * 0.099, kForce, 0.0});
  EXPECT_EQ(dropped.duty[0], 0.0);
  EXPECT_EQ(dropped.duty[2], 0.0);
  EXPECT_NEAR(dropped.achieved.x(), 0.0, kExact);
  EXPECT_NEAR(dropped.achieved.y(), kForce, kExact);
  EXPECT_EQ(dropped.scale, 1.0);
  std::mt19937 random(17);
  std::normal_distribution<double> normal;
  for (int trial = 0; trial < 500; ++trial) {
    const Allocation any = allocator.allocate({normal(random), normal(random), 0.1 * normal(random)});
    for (const double duty : any.duty) EXPECT_TRUE(duty == 0.0 || duty >= 0.1 - 1e-12);
    EXPECT_LT((sum_of(B, any.duty) - any.achieved).cwiseAbs().maxCoeff(), kExact);
  }
}

TEST(Allocator, TakesNormalisedWrenches) {
  const Vehicle vehicle = nominal_vehicle();
  const Allocator allocator(vehicle);
  EXPECT_TRUE(allocator.max_wrench().isApprox(BodyWrench(2 * kForce, 2 * kForce, 4 * kForce * kArm), 1e-12));
  const Allocation result = allocator.allocate_normalised({0.5, -0.25, 0.1});
  EXPECT_TRUE(result.achieved.isApprox(BodyWrench(kForce, -0.5 * kForce, 0.4 * kForce * kArm), 1e-9));
  // A failure leaves less in one sense than in the other: 1 is what both senses have.
  const Allocator broken(vehicle, {1});
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {1.0, -1.0})
      EXPECT_NEAR(broken.allocate_normalised(sign * Eigen::Vector3d::Unit(axis)).scale, 1.0, 1e-12);
  }
  EXPECT_LT(broken.allocate({2 * kForce, 0.0, 0.0}).scale, 0.99);
}

TEST(Allocator, ZeroIsZeroAndWhatIsNotFiniteClosesTheValves) {
  const Allocator allocator(nominal_vehicle());
  const double inf = std::numeric_limits<double>::infinity();
  const Allocation zero = allocator.allocate({0.0, 0.0, 0.0});
  EXPECT_EQ(zero.scale, 1.0);
  EXPECT_EQ(zero.duty, std::vector<double>(8, 0.0));
  EXPECT_EQ(allocator.attainable_scale({0.0, 0.0, 0.0}), inf);
  for (const double bad : {std::nan(""), inf, -inf}) {
    const Allocation result = allocator.allocate({1.0, bad, 0.0});
    EXPECT_EQ(result.scale, 0.0);
    EXPECT_EQ(result.duty, std::vector<double>(8, 0.0));
    EXPECT_TRUE(result.achieved.isZero());
  }
  // Finite but absurd: still along the direction asked for.
  EXPECT_NEAR(allocator.allocate({1e308, -1e308, 0.0}).achieved.x(), 2 * kForce, kExact);
  EXPECT_NEAR(allocator.allocate({1e-300, 0.0, 0.0}).achieved.norm(), 0.0, 1e-11);
}

TEST(Allocator, AllocatesNoMemoryInControlLoops) {
  const Allocator allocator(nominal_vehicle());
  Allocation result;
  allocator.allocate_into({1.0, 0.0, 0.0}, result);
  const std::size_t before = g_allocations;
  EXPECT_GT(before, 0u);
  for (const BodyWrench& w :
       {BodyWrench(9.0, 1.0, 0.3), BodyWrench(0.3, -0.2, 0.01), BodyWrench(3.4, 3.4, 0.0)})
    allocator.allocate_into(w, result);
  EXPECT_EQ(g_allocations, before);
}

// The propeller plate: 3.92 N on each axis and 0.67 N m (paper), in both senses, with duties of either sign.
TEST(Allocator, PropellersPushBothWays) {
  const Vehicle vehicle = load_vehicle(shipped("config/vehicle/atmos_propeller.yaml"));
  const Allocator allocator(vehicle);
  EXPECT_NEAR(allocator.max_wrench()[0], 3.92, 1e-9);
  EXPECT_NEAR(allocator.max_wrench()[1], 3.92, 1e-9);
  EXPECT_NEAR(allocator.max_wrench()[2], 0.67, 1e-3);
  const Eigen::Matrix<double, 3, Eigen::Dynamic> B = columns(vehicle);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector4d duty(any(random), any(random), any(random), any(random));
    const BodyWrench wrench = B * duty;
    const Allocation allocation = allocator.allocate(wrench);
    EXPECT_NEAR(allocation.scale, 1.0, 1e-9);
    ASSERT_EQ(allocation.duty.size(), 4u);
    const Eigen::Vector4d got(allocation.duty.data());
    EXPECT_LE(got.cwiseAbs().maxCoeff(), 1.0);
    EXPECT_LE(got.norm(), duty.norm() + 1e-9);
    EXPECT_LT((B * got - wrench).norm(), 1e-7);
    EXPECT_LT((allocation.achieved - wrench).norm(), 1e-7);
  }
  EXPECT_NEAR(allocator.allocate({-39.2, 0.0, 0.0}).duty[0], -1.0, 1e-9);
}

}  // namespace
}  // namespace atmos
