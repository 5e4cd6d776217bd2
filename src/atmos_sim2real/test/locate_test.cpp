#include "atmos_sim2real/locate.h"

#include <gtest/gtest.h>

#include "synthetic.h"

namespace atmos {
namespace {

constexpr double kStart = 1.7e9;

// A minute on a circle of 1 m, 0.1 m/s at first and twice that in the second half, turning as it goes; every
// second another thruster fires.
Recording circle(const std::string& name) {
  Recording recording;
  recording.name = name;
  double angle = 0.0;
  for (int i = 0; i <= 3000; ++i) {
    const double time = 0.02 * i;
    angle += 0.02 * (time < 30.0 ? 0.1 : 0.2);
    recording.poses.push_back({kStart + time, 1.5 + std::cos(angle), 1.5 + std::sin(angle), 0.1 * time});
  }
  for (int k = 0; k < 600; ++k) {
    ThrusterCommand command{kStart + 0.1 * k, 0.1, std::vector<double>(8, 0.0)};
    command.duty[static_cast<std::size_t>(k / 10 % 8)] = 1.0;
    recording.commands.push_back(command);
  }
  return recording;
}

struct Located {
  Vehicle vehicle = nominal_vehicle();
  std::vector<Flight> flights;
  Problem problem{&vehicle, {}, &flights};
  FrameGains gains;

  explicit Located(std::vector<std::string> names = {"flight"}) {
    for (const std::string& name : names) flights.emplace_back(circle(name));
    smooth_all(problem, {}, NoiseModel{}, 4.0);
    for (const Flight& flight : flights)
      gains.nats.emplace_back(
          Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(flight.frames()), FrameGains::kColumns));
  }

  // These nats in all, evenly in the frames that are meant, and evenly along the axes.
  template <class Meant>
  void gain(double nats, const Meant& meant) {
    std::vector<std::pair<std::size_t, Eigen::Index>> frames;
    for (std::size_t f = 0; f < flights.size(); ++f) {
      for (std::size_t i = 0; i < flights[f].frames(); ++i) {
        if (meant(f, flights[f].times()[i] - kStart, flights[f].motion()[i]))
          frames.emplace_back(f, static_cast<Eigen::Index>(i));
      }
    }
    for (const auto& [f, i] : frames)
      gains.nats[f].row(i).array() += nats / (3.0 * static_cast<double>(frames.size()));
  }
  std::vector<Place> places() const { return locate(problem, gains); }
  std::string first() const { return places().empty() ? "" : places().front().statement; }
};

using State = PlanarState<double>;
bool always(std::size_t, double, const State&) { return true; }

TEST(Locate, AnEvenMismatchLiesNowhere) {
  Located even;
  even.gain(3000.0, always);
  EXPECT_TRUE(even.places().empty());
}

TEST(Locate, AFewNatsSayNothing) {
  Located few;
  const auto late = [](std::size_t, double since, const State&) { return since >= 40.0; };
  few.gain(2.0, late);
  EXPECT_TRUE(few.places().empty());
  few.gain(200.0, late);
  EXPECT_EQ(few.first(), "from 40 s after the first command on");
  EXPECT_NEAR(few.places().front().share, 1.0, 1e-9);
  EXPECT_NEAR(few.places().front().even_share, 1.0 / 3.0, 0.01);
}

TEST(Locate, AStretchThatEnds) {
  Located stretch;
  stretch.gain(100.0, always);
  stretch.gain(400.0, [](std::size_t, double since, const State&) { return since > 12.0 && since < 22.0; });
  EXPECT_EQ(stretch.first(), "from 12 to 22 s after the first command");
  EXPECT_NEAR(stretch.places().front().share, 0.83, 0.02);
}

TEST(Locate, SingleMomentsAreListed) {
  Located pushed;
  pushed.gain(50.0, always);
  pushed.gain(500.0, [](std::size_t, double since, const State&) {
    return (since > 10.0 && since < 10.9) || (since > 33.0 && since < 33.9) || (since > 50.0 && since < 50.9);
  });
  EXPECT_EQ(pushed.first(), "around 10.5 s, 33.5 s and 50.5 s after the first command");
}

TEST(Locate, AThrusterIsNamed) {
  Located thruster;
  thruster.gain(100.0, always);
  thruster.gain(
      400.0, [](std::size_t, double since, const State&) { return static_cast<int>(since + 1e-6) % 8 == 2; });
  EXPECT_EQ(thruster.first(), "while thruster 3 fires");
}

TEST(Locate, APlaceOnTheFloor) {
  Located place;
  place.gain(300.0, [](std::size_t, double, const State& at) { return at.p_WC.x() < 0.8; });
  const std::vector<Place> places = place.places();
  const auto floor =
      std::find_if(places.begin(), places.end(), [](const Place& p) { return p.what == "place"; });
  ASSERT_NE(floor, places.end());
  EXPECT_EQ(floor->statement.rfind("at x from 0.5 to 1 m", 0), 0u) << floor->statement;
}

TEST(Locate, ARegimeOfSpeed) {
  Located fast;
  fast.gain(300.0, [](std::size_t, double, const State& at) { return at.v_WC.norm() > 0.15; });
  const std::vector<Place> places = fast.places();
  EXPECT_TRUE(std::any_of(places.begin(), places.end(), [](const Place& place) {
    return place.what == "regime" && place.statement.rfind("while it moves faster than 0.", 0) == 0;
  }));
}

TEST(Locate, OneOfSeveralRecordings) {
  Located second({"a", "b", "c"});
  second.gain(300.0, [](std::size_t f, double, const State&) { return f == 1; });
  EXPECT_EQ(second.first(), "in b");
  second.gain(900.0, [](std::size_t f, double since, const State&) { return f == 1 && since > 50.0; });
  EXPECT_EQ(second.first(), "from 50 s after the first command on of b");
}

TEST(Locate, AnAxisOfTheBodyOrOfTheWorld) {
  Located axis;
  axis.gain(600.0, always);
  axis.gains.nats[0].col(FrameGains::kWorldX) *= 3.0;
  EXPECT_EQ(axis.first(), "along the world's x axis");
  EXPECT_NEAR(axis_shares(axis.gains)[0], 0.6, 1e-9);
  axis.gains.nats[0].col(FrameGains::kForward) *= 5.0;
  EXPECT_EQ(axis.first(), "along the body's x axis");
}

TEST(Locate, GainsOfATiltLieAlongIt) {
  Vehicle vehicle = nominal_vehicle();
  std::vector<Flight> flights;
  FloorTilt tilt;
  tilt.slope_x = 1e-3;
  flights.emplace_back(fly(vehicle, {tilt}, pulse_commands(kStart, 45.0, 41), 42).recording);
  const Problem problem{&vehicle, {}, &flights};
  smooth_all(problem, {tilt}, NoiseModel{}, 1.0);
  const FrameGains gains = gains_of_effects(problem, evaluate(problem, {}, {}, NoiseModel{}),
                                            evaluate(problem, {tilt}, {}, NoiseModel{}));
  EXPECT_GT(axis_shares(gains)[0], 0.9);
}

TEST(Locate, ASlowForceIsFoundWhereItActs) {
  Vehicle vehicle = nominal_vehicle();
  std::vector<Flight> flights;
  // Nobody is told of the pull to and fro, 20 mm/s2 every 6 s, that acts from 25 s on.
  Recording recording = fly(vehicle, {}, pulse_commands(kStart, 45.0, 41), 42).recording;
  const double frequency = 2.0 * M_PI / 6.0;
  for (PoseSample& pose : recording.poses) {
    const double since = std::max(0.0, pose.time_s - kStart - 25.0);
    pose.x_m += 0.02 * (1.0 - std::cos(frequency * since)) / (frequency * frequency);
  }
  flights.emplace_back(std::move(recording));
  const Problem problem{&vehicle, {}, &flights};
  NoiseModel ordinary, found;
  ordinary.slow = {1e-4, 1e-4, 1e-3};
  found.slow = {5e-3, 5e-3, 1e-3};
  smooth_all(problem, {}, found, 1.0);
  const FrameGains gains = gains_of_slow_force(problem, evaluate(problem, {}, {}, found), ordinary);
  double before = 0.0, after = 0.0;
  for (std::size_t i = 0; i < flights[0].frames(); ++i)
    (flights[0].times()[i] < kStart + 25.0 ? before : after) +=
        gains.of_frames(0)[static_cast<Eigen::Index>(i)];
  EXPECT_LT(before, 0.0);  // a stronger force than there is costs likelihood
  EXPECT_GT(after, 1000.0);
  EXPECT_GT(axis_shares(gains)[0], 0.95);
  const std::vector<Place> places = locate(problem, gains);
  EXPECT_TRUE(std::any_of(places.begin(), places.end(), [](const Place& p) { return p.what == "time"; }));
}

}  // namespace
}  // namespace atmos
