#include "atmos_sim2real/force_field.h"

#include <gtest/gtest.h>

#include <cmath>

namespace atmos {
namespace {

template <class Force>
Airflow field(const Force& force) {
  Airflow map;
  map.grid = Grid{{-1.0, -0.8}, 0.2};
  map.force_x_n.assign(9, std::vector<double>(11));
  map.force_y_n = map.force_x_n;
  for (std::size_t j = 0; j < 9; ++j) {
    for (std::size_t i = 0; i < 11; ++i) {
      const auto [fx, fy] = force(-1.0 + 0.2 * static_cast<double>(i), -0.8 + 0.2 * static_cast<double>(j));
      map.force_x_n[j][i] = fx;
      map.force_y_n[j][i] = fy;
    }
  }
  return map;
}

TEST(ForceField, SlopesHaveNoCurlAndAVortexIsAllCurl) {
  const Airflow hill = field([](double x, double y) {
    const double bell = 0.05 * std::exp(-x * x - y * y);
    return std::pair(2.0 * x * bell, 2.0 * y * bell);
  });
  EXPECT_NEAR(share_with_curl(hill), 0.0, 0.01);

  const Airflow vortex = field([](double x, double y) {
    const double bell = 0.05 * std::exp(-4.0 * (x * x + y * y));
    return std::pair(-y * bell, x * bell);
  });
  EXPECT_NEAR(share_with_curl(vortex), 1.0, 0.02);
}

TEST(ForceField, AMeanForceHidesNoCurl) {
  // A jet: half of the square of its gradient is antisymmetric; a channel: none is.
  const auto jet = [](double, double y) { return std::pair(1.0 + 0.1 * y, -0.5); };
  const auto channel = [](double x, double) { return std::pair(1.0 + 0.1 * x, -0.5); };
  EXPECT_NEAR(share_with_curl(field(jet)), 0.5, 0.15);
  EXPECT_NEAR(share_with_curl(field(channel)), 0.0, 1e-6);
}

TEST(ForceField, NoForceHasNoCurl) {
  EXPECT_EQ(share_with_curl(field([](double, double) { return std::pair(0.03, -0.01); })), 0.0);
  EXPECT_EQ(share_with_curl(field([](double, double) { return std::pair(0.0, 0.0); })), 0.0);
}

}  // namespace
}  // namespace atmos
