// A grid of runs, killed and resumed: each run exactly once. ATMOS_LONG_TESTS=1 flies a thousand.
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>

#include "atmos_sim/run_grid.h"

namespace atmos {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> lines_of(const std::string& path) {
  std::ifstream in(path);
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

std::string write_grid(const std::string& folder, int repetitions, const std::string& axis_key) {
  fs::create_directories(folder);
  const std::string path = folder + "/grid.yaml";
  std::ofstream(path) << "scenario: " ATMOS_CONFIG_DIR "/scenario/floor_2mm.yaml\nrepetitions: "
                      << repetitions << "\nseed: 10\naxes:\n  - {key: " << axis_key
                      << ", values: [0.0, 0.002]}\n";
  return path;
}

pid_t start(const std::string& grid, const std::string& out) {
  const pid_t child = ::fork();
  if (child == 0) {
    ::execl(ATMOS_SIM_GRID, ATMOS_SIM_GRID, grid.c_str(), "--out", out.c_str(), "--jobs", "2", "--bags",
            "1,3", static_cast<char*>(nullptr));
    ::_exit(127);
  }
  return child;
}

int exit_code(pid_t child) {
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST(RunGrid, KilledAndResumedEveryRunIsDoneExactlyOnce) {
  const bool many = std::getenv("ATMOS_LONG_TESTS") != nullptr;
  const int repetitions = many ? 500 : 12;
  const std::string folder = testing::TempDir() + "/run_grid_test";
  fs::remove_all(folder);
  const std::string grid = write_grid(folder, repetitions, "effects.floor_tilt.slope_x");
  const std::string out = folder + "/out", journal = out + "/journal.csv";
  const auto total = static_cast<std::size_t>(2 * repetitions);

  // Killed as soon as some part is done.
  const pid_t first = start(grid, out);
  while (lines_of(journal).size() < 1 + total / 3) ::usleep(1000);
  ::kill(first, SIGKILL);
  EXPECT_EQ(exit_code(first), -1);
  ::usleep(200000);  // its workers end with it
  const std::vector<std::string> before = lines_of(journal);
  ASSERT_LT(before.size(), 1 + total) << "killed too late to show anything";
  { std::ofstream(journal, std::ios::app) << "7,17,0.0"; }  // what a kill in the middle of a line leaves

  EXPECT_EQ(exit_code(start(grid, out)), 0);
  std::multiset<int> runs;
  const std::vector<std::string> after = lines_of(journal);
  for (std::size_t i = 1; i < after.size(); ++i) runs.insert(std::stoi(after[i]));
  EXPECT_EQ(runs.size(), total);
  for (int run = 0; run < static_cast<int>(total); ++run) EXPECT_EQ(runs.count(run), 1u) << run;
  // What was done before the kill was left as it was.
  for (std::size_t i = 0; i + 1 < before.size(); ++i) EXPECT_EQ(after[i], before[i]);
  std::printf("%zu runs, killed after %zu, %zu rows after the resumption\n", total, before.size() - 1,
              after.size() - 1);

  const std::vector<std::string> table = lines_of(out + "/table.csv");
  ASSERT_EQ(table.size(), 1 + total);
  for (std::size_t run = 0; run < total; ++run) EXPECT_EQ(std::stoi(table[run + 1]), static_cast<int>(run));
  EXPECT_TRUE(fs::exists(out + "/bags/run_1.bag"));
  EXPECT_TRUE(fs::exists(out + "/bags/run_3.bag"));
  EXPECT_EQ(std::distance(fs::directory_iterator(out + "/bags"), {}), 2);

  // Nothing left: a third call changes nothing. Another grid is refused.
  EXPECT_EQ(exit_code(start(grid, out)), 0);
  EXPECT_EQ(lines_of(journal), after);
  const std::string other =
      write_grid(folder + "/other", 2, "effects.supply_coupling.fraction_per_open_thruster");
  EXPECT_EQ(exit_code(start(other, out)), 1);
}

TEST(RunGrid, ARunIsTheSameWheneverItIsFlown) {
  const RunGrid grid =
      load_grid(write_grid(testing::TempDir() + "/run_grid_same", 2, "effects.floor_tilt.slope_x"));
  EXPECT_EQ(grid.size(), 4);
  EXPECT_EQ(grid.scenario(0).seed, 10u);
  EXPECT_EQ(grid.scenario(3).seed, 13u);
  EXPECT_EQ(grid.values(1)[0], 0.0);
  EXPECT_EQ(grid.values(2)[0], 0.002);
  const std::string row = fly_run(grid, 3, "", {});
  EXPECT_EQ(fly_run(grid, 3, "", {}), row);
  EXPECT_NE(fly_run(grid, 2, "", {}), row);
}

TEST(RunGrid, AKeyThatTheScenarioDoesNotHaveAndAValueOutOfRangeAreRefused) {
  const std::string folder = testing::TempDir() + "/run_grid_bad";
  EXPECT_THROW(load_grid(write_grid(folder, 2, "effects.slosh.mass_kg")), ConfigError);
  EXPECT_THROW(load_grid(write_grid(folder, 2, "duration_s")), ConfigError);  // 0 s
  EXPECT_THROW(load_grid(write_grid(folder, 0, "effects.floor_tilt.slope_x")), ConfigError);
}

TEST(RunGrid, EveryShippedGridLoads) {
  int count = 0;
  for (const auto& file : fs::directory_iterator(ATMOS_CONFIG_DIR "/grid")) {
    EXPECT_NO_THROW(load_grid(file.path().string())) << file.path();
    ++count;
  }
  EXPECT_GE(count, 1);
}

}  // namespace
}  // namespace atmos
