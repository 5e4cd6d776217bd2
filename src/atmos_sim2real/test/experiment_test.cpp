#include "atmos_sim2real/experiment.h"

#include <gtest/gtest.h>

#include <cmath>
#include <tuple>

#include "synthetic.h"

namespace atmos {
namespace {

constexpr double kStart = 1.7e9;

TEST(Experiment, ManoeuvresStayOnTheVisitedFloorOrWithinAMetreOfIts) {
  const Box wide{-1.0, 2.0, 0.5, 2.5}, hover{1.0, 1.2, 1.0, 1.1};
  for (const auto& [box, reach_x, reach_y] : {std::tuple(wide, 1.5, 1.0), std::tuple(hover, 0.5, 0.5)}) {
    const double cx = 0.5 * (box.x0 + box.x1), cy = 0.5 * (box.y0 + box.y1);
    for (const Manoeuvre& manoeuvre : manoeuvres(box)) {
      ASSERT_GT(manoeuvre.setpoints.size(), 2u);
      double before = -1.0;
      for (const Setpoint& setpoint : manoeuvre.setpoints) {
        EXPECT_LE(std::abs(setpoint.x_m - cx), reach_x + 1e-9) << manoeuvre.description;
        EXPECT_LE(std::abs(setpoint.y_m - cy), reach_y + 1e-9) << manoeuvre.description;
        EXPECT_GT(setpoint.time_s, before);
        before = setpoint.time_s;
      }
      EXPECT_GT(manoeuvre.duration_s, before);
    }
  }
}

// A rival that can imitate the claim is not separated from it; one that cannot is.
TEST(Experiment, SeparationSaysWhatAFlightTells) {
  const Vehicle vehicle = nominal_vehicle();
  const std::vector<Effect> truth = {SupplyCoupling{{}, 0.08}};
  std::vector<Flight> flights;
  flights.emplace_back(fly(vehicle, truth, pulse_commands(kStart, 40.0, 21), 22).recording);
  const Problem problem{&vehicle, {}, &flights};
  Fit claimed;
  claimed.effects = truth;
  claimed.noise = initial_noise(flights);
  const auto rival = [](Effect effect, const std::string& parameter, double mean, double width) {
    Tried tried;
    tried.fit.effects = {std::move(effect)};
    tried.fit.free = {{0, parameter, 0, mean, width, 1e-3 * width}};
    return tried;
  };
  EXPECT_NEAR(
      separation(problem, claimed, rival(SupplyCoupling{{}, 0.05}, "fraction_per_open_thruster", 0.0, 0.08)),
      0.0, 3.0);
  EXPECT_GT(separation(problem, claimed, rival(FloorTilt{}, "slope_x", 0.0, 8e-4)), 50.0);
}

}  // namespace
}  // namespace atmos
