#include "atmos_operator/trajectory_shape.h"

#include <gtest/gtest.h>

#include <cmath>

namespace atmos {
namespace {

using Shape = TrajectorySettings::Shape;

TrajectorySettings settings(Shape shape) { return {5.0, 30.0, shape, 0.5, -0.2, 0.6, 0.4, 2.0, 0.3, 1.0}; }

TEST(TrajectoryShape, StartsAndEndsAtRest) {
  for (const Shape shape : {Shape::kCircle, Shape::kFigureEight}) {
    for (const double t : {0.0, 30.0}) {
      const ShapePoint point = shape_at(settings(shape), t);
      for (const Derivatives& axis : {point.x, point.y, point.yaw}) {
        EXPECT_NEAR(axis.rate, 0.0, 1e-12);
        EXPECT_NEAR(axis.acceleration, 0.0, 1e-12);
      }
      EXPECT_NEAR(point.x.value, shape == Shape::kCircle ? 1.1 : 0.5, 1e-9);
      EXPECT_NEAR(point.y.value, -0.2, 1e-9);
      EXPECT_NEAR(point.yaw.value, 0.3 + (t > 0.0 ? 2.0 * M_PI : 0.0), 1e-9);
    }
  }
}

TEST(TrajectoryShape, DerivativesAgainstDifferences) {
  for (const Shape shape : {Shape::kCircle, Shape::kFigureEight}) {
    for (double t = 0.5; t < 30.0; t += 0.77) {
      const double h = 1e-4;
      const ShapePoint before = shape_at(settings(shape), t - h), at = shape_at(settings(shape), t),
                       after = shape_at(settings(shape), t + h);
      for (const auto axis : {&ShapePoint::x, &ShapePoint::y, &ShapePoint::yaw}) {
        EXPECT_NEAR((at.*axis).rate, ((after.*axis).value - (before.*axis).value) / (2 * h), 1e-6);
        EXPECT_NEAR((at.*axis).acceleration, ((after.*axis).rate - (before.*axis).rate) / (2 * h), 1e-4);
      }
    }
  }
}

TEST(TrajectoryShape, CircleKeepsItsDistance) {
  TrajectorySettings circle = settings(Shape::kCircle);
  circle.size_y_m = circle.size_x_m;
  for (double t = 0.0; t <= 30.0; t += 1.3) {
    const ShapePoint point = shape_at(circle, t);
    EXPECT_NEAR(std::hypot(point.x.value - 0.5, point.y.value + 0.2), 0.6, 1e-12);
  }
}

}  // namespace
}  // namespace atmos
