// The recordings with known answers: the tool names what is in them, nothing else, and predicts their second
// flights nearly as well as the truth does. They lie beside the repository (shared/recordings, or
// $ATMOS_RECORDINGS) and are not part of it; without them the test says so and is skipped.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "atmos_model/effects.h"
#include "atmos_sim2real/prediction.h"
#include "atmos_sim2real_ros/bag_reader.h"

namespace atmos {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr double kHorizon = 5.0;        // s
constexpr double kNearlyAsTruth = 1.3;  // ratio of prediction errors

fs::path recordings() {
  const char* const elsewhere = std::getenv("ATMOS_RECORDINGS");
  return (elsewhere != nullptr ? fs::path(elsewhere) : fs::path(ATMOS_ROOT "/../shared/recordings")) / "open";
}

// All of them take minutes.
std::vector<std::string> names() {
  const char* const long_tests = std::getenv("ATMOS_LONG_TESTS");
  if (long_tests != nullptr && std::string(long_tests) == "1")
    return {"open_01", "open_02", "open_03", "open_04", "open_05", "open_06"};
  return {"open_01", "open_04"};
}

json read_json(const fs::path& path) {
  std::ifstream file(path);
  return json::parse(file);
}

// The answers' own words into the vocabulary. `start_s`: of flight a.
std::vector<Effect> truth(const json& plant, double start_s) {
  std::vector<Effect> effects;
  if (plant.contains("tilt")) {
    FloorTilt tilt;
    tilt.slope_x = plant["tilt"][0];
    tilt.slope_y = plant["tilt"][1];
    effects.push_back(tilt);
  }
  if (plant.contains("coupling")) {
    SupplyCoupling coupling;
    coupling.fraction_per_open_thruster = plant["coupling"];
    effects.push_back(coupling);
  }
  if (plant.contains("dead_at")) {
    for (std::size_t k = 0; k < plant["dead_at"].size(); ++k) {
      const double at = plant["dead_at"][k];
      if (at > 1e6) continue;  // never
      ThrusterDead dead;
      dead.thruster = static_cast<int>(k) + 1;
      dead.since_s = start_s + at;
      effects.push_back(dead);
    }
  }
  if (plant.contains("tether_k")) {
    Tether tether;
    tether.anchor_x_m = plant["tether_anchor"][0];
    tether.anchor_y_m = plant["tether_anchor"][1];
    tether.slack_m = plant["tether_slack"];
    tether.stiffness_n_m = plant["tether_k"];
    tether.damping_n_s_m = plant["tether_c"];
    effects.push_back(tether);
  }
  if (plant.contains("bumps")) {
    FloorUnevenness floor;
    constexpr std::size_t kColumns = 56, kRows = 46;
    floor.grid = Grid{{-0.75, -0.75}, 0.1};
    floor.height_m.assign(kRows, std::vector<double>(kColumns, 0.0));
    for (std::size_t j = 0; j < kRows; ++j) {
      for (std::size_t i = 0; i < kColumns; ++i) {
        for (const json& bump : plant["bumps"]) {
          const double x = -0.75 + 0.1 * static_cast<double>(i) - bump[0].get<double>();
          const double y = -0.75 + 0.1 * static_cast<double>(j) - bump[1].get<double>();
          const double width = bump[3];
          floor.height_m[j][i] += bump[2].get<double>() * std::exp(-(x * x + y * y) / (2.0 * width * width));
        }
      }
    }
    effects.push_back(floor);
  }
  return effects;
}

double error_under(const std::vector<Effect>& effects, const Vehicle& vehicle, const Recording& recording) {
  const OpenLoop open_loop(recording, vehicle, effects);
  const auto predicted = open_loop.predict(open_loop.window_starts(kHorizon), kHorizon);
  return prediction_error(recording, predicted).position_rms_m;
}

class OpenRecording : public ::testing::TestWithParam<std::string> {};

TEST_P(OpenRecording, IsNamedAndPredicted) {
  const fs::path folder = recordings();
  if (!fs::exists(folder / "answers.json")) {
    std::printf("RECORDINGS NOT THERE: %s\n", folder.c_str());
    GTEST_SKIP() << "recordings not there: " << folder;
  }
  const std::string name = GetParam();
  const std::string a = folder / (name + "_a.bag"), b = folder / (name + "_b.bag");
  const json answer = read_json(folder / "answers.json")[name];
  const std::string vehicle_path = ATMOS_ROOT "/config/vehicle/atmos.yaml";
  const fs::path out = fs::temp_directory_path() / ("atmos_" + name + "_" + std::to_string(getpid()));
  const std::string command = std::string(DIAGNOSE) + " --vehicle " + vehicle_path + " --out " +
                              out.string() + " " + a + " --holdout " + b + " > /dev/null 2>&1";
  const int status = std::system(command.c_str());
  ASSERT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  const json report = read_json(out / "report.json");
  fs::remove_all(out);

  std::set<std::string> claimed;
  for (const json& effect : report["effects"]) claimed.insert(effect["kind"].get<std::string>());
  EXPECT_EQ(claimed, answer["kinds"].get<std::set<std::string>>());
  EXPECT_EQ(report["verdict"], answer["kinds"].empty() ? "consistent" : "explained");

  const Vehicle vehicle = load_vehicle(vehicle_path);
  const double start_s = clean_recording(read_bag(a), 8).start_s();
  const double of_truth =
      error_under(truth(answer["plant"], start_s), vehicle, clean_recording(read_bag(b), 8));
  const double fitted = report["fit"]["fitted"]["position_rms_m"];
  std::printf("%s: 5 s error %.2f mm under the fit, %.2f mm under the truth\n", name.c_str(), 1e3 * fitted,
              1e3 * of_truth);
  EXPECT_EQ(report["fit"]["on"], "held-out");
  EXPECT_LE(fitted, kNearlyAsTruth * of_truth);
}

INSTANTIATE_TEST_SUITE_P(Answers, OpenRecording, ::testing::ValuesIn(names()));

}  // namespace
}  // namespace atmos
