#include "atmos_sim/batch.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>
#include <sstream>

#include "test_scenario.h"

namespace atmos {
namespace {

std::string table(const BatchResult& result) {
  std::ostringstream out;
  write_states(result, out);
  return out.str();
}

std::string write_file(const std::string& text) {
  const std::string path = testing::TempDir() + "/sim_batch_commands.csv";
  std::ofstream(path) << text;
  return path;
}

TEST(Batch, IdenticalSeedsGiveIdenticalTables) {
  Scenario scenario = all_effects_scenario();
  const auto fly = [&scenario](std::uint64_t command_seed) {
    return table(run_batch(scenario, random_commands(scenario, kTestStart, command_seed), kTestStart));
  };
  const std::string first = fly(1);
  EXPECT_EQ(first, fly(1));
  EXPECT_NE(first, fly(2));
  scenario.seed += 1;
  EXPECT_NE(first, fly(1));
}

TEST(Batch, HasOneRowPerFrameFromStartToEnd) {
  Scenario scenario = test_scenario();
  scenario.duration_s = 1.0;
  const BatchResult result = run_batch(scenario, {}, kTestStart);
  ASSERT_EQ(result.rows.size(), 101U);
  EXPECT_DOUBLE_EQ(result.rows.front().time_s, kTestStart);
  EXPECT_DOUBLE_EQ(result.rows.back().time_s, kTestStart + 1.0);
  EXPECT_EQ(result.steps, 1000U);
  const std::string text = table(result);
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 102);
}

TEST(Batch, LostFramesAreWrittenAsNan) {
  Scenario scenario = test_scenario();
  scenario.duration_s = 0.1;
  scenario.mocap.dropout_probability = 1.0;
  const std::string text = table(run_batch(scenario, {}, kTestStart));
  EXPECT_NE(text.find(",nan,nan,nan\n"), std::string::npos);
  EXPECT_EQ(text.find("-nan"), std::string::npos);
}

TEST(Batch, RandomCommandsAreAnUnbrokenChainOfValidPeriods) {
  const Scenario scenario = test_scenario();
  const auto commands = random_commands(scenario, kTestStart, 3);
  ASSERT_EQ(commands.size(), 200U);
  int shut = 0, full = 0;
  for (std::size_t k = 0; k < commands.size(); ++k) {
    EXPECT_NEAR(commands[k].stamp_s, kTestStart + 0.1 * static_cast<double>(k), 1e-9);
    ASSERT_EQ(commands[k].duty.size(), 8U);
    for (const double duty : commands[k].duty) {
      EXPECT_GE(duty, 0.0);
      EXPECT_LE(duty, 1.0);
      shut += duty == 0.0 ? 1 : 0;
      full += duty == 1.0 ? 1 : 0;
    }
  }
  EXPECT_NEAR(shut, 200, 70);
  EXPECT_NEAR(full, 200, 70);
  EXPECT_EQ(run_batch(scenario, commands, kTestStart).unused_commands, 0U);
}

TEST(Batch, CommandsSurviveTheFile) {
  const Scenario scenario = test_scenario();
  const auto commands = random_commands(scenario, kTestStart, 3);
  std::ostringstream out;
  write_commands(commands, out);
  const auto read = read_commands(write_file(out.str()), 8);
  ASSERT_EQ(read.size(), commands.size());
  for (std::size_t k = 0; k < read.size(); ++k) {
    EXPECT_EQ(read[k].stamp_s, commands[k].stamp_s);
    EXPECT_EQ(read[k].period_s, commands[k].period_s);
    EXPECT_EQ(read[k].duty, commands[k].duty);
  }
}

TEST(Batch, EveryFaultOfATableIsReported) {
  const std::string path = write_file(
      "stamp,period_s,duty1,duty2\n"
      "10.0,0.1,0.5,0.5\n"
      "9.9,0.1,0.5,0.5\n"
      "10.1,-0.1,1.5,abc\n"
      "10.2,0.1,nan,0.5\n"
      "10.3,0.1,0.5\n");
  try {
    read_commands(path, 2);
    FAIL();
  } catch (const ConfigError& error) {
    std::vector<std::pair<int, std::string>> where;
    for (const ConfigFault& fault : error.faults()) where.push_back({fault.line, fault.key});
    const std::vector<std::pair<int, std::string>> expected = {
        {1, "header"}, {3, "stamp_s"}, {4, "period_s"}, {4, "duty1"}, {4, "duty2"}, {5, "duty1"}, {6, "row"}};
    EXPECT_EQ(where, expected) << error.what();
  }
  EXPECT_THROW(read_commands("/nowhere.csv", 2), ConfigError);
}

TEST(Batch, CountsCommandsThatCannotAct) {
  const Scenario scenario = test_scenario();
  std::vector<ThrusterCommand> commands = {open_thrusters(kTestStart - 5.0, 1.0, {1, 3}),
                                           open_thrusters(kTestStart, 1.0, {1, 3})};
  commands.push_back({kTestStart + 0.1, 0.1, {0.5}});
  EXPECT_EQ(run_batch(scenario, commands, kTestStart).unused_commands, 2U);
}

}  // namespace
}  // namespace atmos
