#include "atmos_stl_planner/specification.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>

#include "atmos_model/strict_yaml.h"

namespace atmos::stl {
namespace {

const std::string kFolder = ATMOS_CONFIG_DIR "/stl/";

std::string shipped(const std::string& name) {
  std::ifstream in(kFolder + name);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

std::string faults_of(const std::string& text) {
  try {
    parse_specification(text, "file.yaml");
  } catch (const ConfigError& error) {
    return error.what();
  }
  return "";
}

TEST(Specification, EveryShippedFileLoads) {
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(kFolder)) {
    SCOPED_TRACE(entry.path());
    const Specification spec = load_specification(entry.path());
    EXPECT_FALSE(spec.clauses.empty());
    ++files;
  }
  EXPECT_GE(files, 2);
}

TEST(Specification, ReadsThePapersScenario) {
  const Specification spec = load_specification(kFolder + "two_robots.yaml");
  EXPECT_EQ(spec.horizon_s, 90.0);
  ASSERT_EQ(spec.robots.size(), 2u);
  EXPECT_EQ(spec.robots[1].name, "crackle");
  EXPECT_NEAR(spec.robots[1].start.yaw_rad, M_PI, 1e-12);
  ASSERT_EQ(spec.clauses.size(), 10u);
  EXPECT_EQ(spec.clauses[6].text, "F[20,30] crackle.in(D)");
  EXPECT_NEAR(spec.min_distance(0, 1), 0.5, 1e-12);
}

TEST(Specification, FormulaFaultsHaveLineColumnCaretAndSuggestion) {
  const std::string text = replaced(shipped("single.yaml"), "not in(Obs)", "not in(Obx)");
  const std::string faults = faults_of(text);
  const int line =
      static_cast<int>(std::count(text.begin(), text.begin() + static_cast<long>(text.find("Obx")), '\n')) +
      1;
  EXPECT_NE(faults.find("file.yaml:" + std::to_string(line) + ":24: "), std::string::npos) << faults;
  EXPECT_NE(faults.find("did you mean \"Obs\"?"), std::string::npos) << faults;
  EXPECT_NE(faults.find("    G[0,60] not in(Obx)\n                   ^"), std::string::npos) << faults;
}

TEST(Specification, TheSameFaultyFormulaTwiceHasTwoPlaces) {
  std::string text = shipped("two_robots.yaml");
  for (int i = 0; i < 2; ++i) text = replaced(text, "G[0,90] not in(Obs)", "G[0,91] not in(Obs)");
  const std::string faults = faults_of(text);
  EXPECT_NE(faults.find("looks 91 s ahead"), std::string::npos) << faults;
  EXPECT_EQ(std::count(faults.begin(), faults.end(), '^'), 2);
  const std::size_t first = faults.find("file.yaml:"), second = faults.find("file.yaml:", first + 1);
  EXPECT_NE(faults.substr(first, 13), faults.substr(second, 13)) << faults;
}

TEST(Specification, RefusesWhatNoPlanCanMend) {
  const std::string good = shipped("two_robots.yaml");
  const std::vector<std::pair<std::string, std::string>> mutations = {
      {"horizon_s: 90.0", "horizon_s: -1"},
      {"max_m: [3.5, 1.25]", "max_m: [-3.5, 1.25]"},
      {"name: A,", "name: and,"},
      {"name: A,", "name: B,"},
      {"size_m: [0.5, 0.5]", "size_m: [0.5, 0]"},
      {"start: {x_m: 0.5", "start: {x_m: 9.5"},
      {"start: {x_m: 2.75, y_m: -0.75", "start: {x_m: 0.6, y_m: -0.75"},
      {"radius_m: 0.2", "radius: 0.2"},
      {"max_acceleration_m_s2: 0.05", "max_acceleration_m_s2: 0"},
      {"name: snap", "name: crackle"},
      {"center_m: [0.5, -0.75], size_m: [0.5, 0.5]", "corners_m: [[0, 0], [1, 0], [0.5, 0.1], [0, 1]]"},
  };
  for (const auto& [from, to] : mutations) EXPECT_NE(faults_of(replaced(good, from, to)), "") << to;
  EXPECT_EQ(faults_of(good), "");
}

TEST(Specification, ConvexPolygonsAndMovingObstacles) {
  std::string text = shipped("single.yaml");
  text = replaced(text, "center_m: [1.625, 0.0], size_m: [0.75, 0.8]",
                  "corners_m: [[1, 0], [1.5, 0.5], [2, 0]]");
  text +=
      "obstacles:\n  - name: tug\n    center_m: [1, 1]\n    size_m: [0.2, 0.2]\n    path:\n"
      "      - {time_s: 0, displacement_m: [0, 0]}\n      - {time_s: 10, displacement_m: [1, 0]}\n";
  const Specification spec = parse_specification(text, "file.yaml");
  EXPECT_EQ(spec.regions.back().polytope.offsets.size(), 3);
  EXPECT_NEAR(spec.obstacles[0].displacement(4.0).x(), 0.4, 1e-12);
  EXPECT_NEAR(spec.obstacles[0].displacement(40.0).x(), 1.0, 1e-12);
}

TEST(Polytope, LargestDisc) {
  EXPECT_NEAR(inscribed_disc(box({0, 0}, {2, 1})).radius, 0.5, 1e-12);
  const auto triangle = polygon({{0, 0}, {0, 3}, {4, 0}});
  ASSERT_TRUE(triangle);
  EXPECT_NEAR(inscribed_disc(*triangle).radius, 1.0, 1e-12);
  EXPECT_EQ(corners_of(*triangle).size(), 3u);
  std::vector<Eigen::Vector2d> star;
  for (int i = 0; i < 5; ++i) star.emplace_back(std::cos(4 * M_PI * i / 5), std::sin(4 * M_PI * i / 5));
  EXPECT_FALSE(polygon(star));
}

// Files are mutilated byte by byte and line by line: each is read or refused with faults, and nothing else
// happens.
TEST(Specification, MutilatedFilesNeverCrash) {
  const int rounds = std::getenv("ATMOS_LONG_TESTS") != nullptr ? 20000 : 500;
  int refused = 0;
  for (const char* name : {"single.yaml", "two_robots.yaml"}) {
    const std::string good = shipped(name);
    for (int round = 0; round < rounds; ++round) {
      std::mt19937 random(static_cast<unsigned>(round));
      std::string text = good;
      const int edits = 1 + static_cast<int>(random() % 4);
      for (int i = 0; i < edits && !text.empty(); ++i) {
        const std::size_t at = random() % text.size();
        switch (random() % 4) {
          case 0:
            text[at] = static_cast<char>(random() % 256);
            break;
          case 1:
            text.erase(at, 1 + random() % 20);
            break;
          case 2:
            text.insert(at, text.substr(random() % text.size(), random() % 30));
            break;
          default:
            text.insert(at, std::string(1, "[]{}:,-#&*!|>'\"%@`F()"[random() % 21]));
        }
      }
      if (!faults_of(text).empty()) ++refused;
    }
  }
  EXPECT_GT(refused, rounds / 4);
}

}  // namespace
}  // namespace atmos::stl
