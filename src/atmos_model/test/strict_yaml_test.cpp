#include "atmos_model/strict_yaml.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace atmos {
namespace {

ConfigFile file_of(const std::string& text) { return ConfigFile::from_text(text, "robot.yaml"); }

std::vector<ConfigFault> faults_of(const ConfigFile& file) {
  try {
    file.check();
  } catch (const ConfigError& error) {
    return error.faults();
  }
  return {};
}

bool has_fault(const std::vector<ConfigFault>& faults, int line, const std::string& key,
               const std::string& rule) {
  return std::any_of(faults.begin(), faults.end(), [&](const ConfigFault& fault) {
    return fault.file == "robot.yaml" && fault.line == line && fault.key == key && fault.rule == rule;
  });
}

TEST(StrictYaml, ReadsEveryKindOfValue) {
  const ConfigFile file = file_of(
      "n: 1.5e-3\ni: -7\nb: true\nt: word\nc: two\nl: [1, 2, 3]\nw: [a, b]\nr: [[1, 2], [3, 4]]\n"
      "m: {x: 1}\nms: [{x: 2}, {x: 3}]\n");
  const ConfigMap root = file.root();
  EXPECT_EQ(root.number("n"), 1.5e-3);
  EXPECT_EQ(root.integer("i", -10, 10), -7);
  EXPECT_TRUE(root.flag("b"));
  EXPECT_EQ(root.text("t"), "word");
  EXPECT_EQ(root.choice("c", {"one", "two"}), "two");
  EXPECT_EQ(root.vector3("l"), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(root.texts("w"), (std::vector<std::string>{"a", "b"}));
  EXPECT_EQ(root.rows("r"), (std::vector<std::vector<double>>{{1, 2}, {3, 4}}));
  EXPECT_EQ(root.map("m").number("x"), 1.0);
  EXPECT_EQ(root.maps("ms").at(1).number("x"), 3.0);
  EXPECT_EQ(root.maps("ms").at(0).number("x"), 2.0);
  EXPECT_EQ(root.number("absent", {}, 4.0), 4.0);
  EXPECT_EQ(root.integer("absent", 0, 9, 5), 5);
  EXPECT_TRUE(root.flag("absent", true));
  EXPECT_EQ(root.text("absent", "fallback"), "fallback");
  EXPECT_EQ(root.choice("absent", {"a", "b"}, "b"), "b");
  EXPECT_FALSE(root.optional_map("absent").has_value());
  EXPECT_TRUE(root.maps("absent", false).empty());
  EXPECT_NO_THROW(file.check());
}

TEST(StrictYaml, ReportsEveryFaultAtOnceWithFileLineKeyAndRule) {
  const ConfigFile file = file_of(
      "mass_kg: -1\n"                              // 1 out of range
      "angle_rad: 0.0003490659 // 0.02 degrees\n"  // 2 a comment that YAML does not know
      "drag: .nan\n"                               // 3
      "limit: .inf\n"                              // 4
      "count: 2.5\n"                               // 5
      "flag: maybe\n"                              // 6
      "mode: fast\n"                               // 7
      "list: [1, x]\n"                             // 8
      "twice: 1\n"                                 // 9
      "twice: 2\n"                                 // 10
      "unread: 1\n"                                // 11
      "inner: {y: 1}\n"                            // 12
      "scalar: 3\n"                                // 13
      "rows: [[1, 2], [3]]\n"                      // 14
      "quoted: \"1.0\"\n"                          // 15
      "name: []\n"                                 // 16
      "items: [1]\n"                               // 17
      "words: [[a]]\n");                           // 18
  const ConfigMap root = file.root();
  root.number("mass_kg", Bounds::positive());
  root.number("angle_rad");
  root.number("drag");
  root.number("limit");
  root.integer("count", 0, 10);
  root.flag("flag");
  root.choice("mode", {"slow", "idle"});
  root.numbers("list", 3);
  root.number("twice");
  root.map("inner").number("x");
  root.map("scalar");
  root.rows("rows");
  root.number("quoted");
  root.text("name");
  root.maps("items");
  root.texts("words");
  root.number("missing");
  const std::vector<ConfigFault> faults = faults_of(file);
  EXPECT_TRUE(has_fault(faults, 1, "mass_kg", "must be > 0, is -1"));
  EXPECT_TRUE(has_fault(faults, 2, "angle_rad", "must be a number"));
  EXPECT_TRUE(has_fault(faults, 3, "drag", "must be a finite number, is nan"));
  EXPECT_TRUE(has_fault(faults, 4, "limit", "must be a finite number, is inf"));
  EXPECT_TRUE(has_fault(faults, 5, "count", "must be a whole number"));
  EXPECT_TRUE(has_fault(faults, 6, "flag", "must be true or false"));
  EXPECT_TRUE(has_fault(faults, 7, "mode", "must be one of slow, idle; is fast"));
  EXPECT_TRUE(has_fault(faults, 8, "list[1]", "must be a number"));
  EXPECT_TRUE(has_fault(faults, 8, "list", "must have 3 numbers, has 2"));
  EXPECT_TRUE(has_fault(faults, 10, "twice", "stands twice"));
  EXPECT_TRUE(has_fault(faults, 11, "unread", "is not a known key"));
  EXPECT_TRUE(has_fault(faults, 12, "inner.x", "is missing"));
  EXPECT_TRUE(has_fault(faults, 12, "inner.y", "is not a known key"));
  EXPECT_TRUE(has_fault(faults, 13, "scalar", "must be a mapping"));
  EXPECT_TRUE(has_fault(faults, 14, "rows[1]", "must be as long as the first row (2)"));
  EXPECT_TRUE(has_fault(faults, 15, "quoted", "must be a number"));
  EXPECT_TRUE(has_fault(faults, 16, "name", "must be a text"));
  EXPECT_TRUE(has_fault(faults, 17, "items[0]", "must be a mapping"));
  EXPECT_TRUE(has_fault(faults, 18, "words[0]", "must be a text"));
  EXPECT_TRUE(has_fault(faults, 1, "missing", "is missing"));
  EXPECT_EQ(faults.size(), 20u);
  const std::string what = ConfigError(faults).what();
  EXPECT_NE(what.find("robot.yaml:2: angle_rad: must be a number\n"), std::string::npos) << what;
}

TEST(StrictYaml, BoundsAreClosedUnlessTheySayOtherwise) {
  EXPECT_TRUE(Bounds::between(0.0, 1.0).contains(0.0));
  EXPECT_TRUE(Bounds::between(0.0, 1.0).contains(1.0));
  EXPECT_FALSE(Bounds::between(0.0, 1.0).contains(1.0 + 1e-15));
  EXPECT_FALSE(Bounds::positive().contains(0.0));
  EXPECT_TRUE(Bounds::non_negative().contains(0.0));
  EXPECT_EQ((Bounds{0.0, 0.5, true}).text(), "must be in (0, 0.5]");
}

TEST(StrictYaml, AMissingMappingNamesTheKeysItShouldHold) {
  const ConfigFile file = file_of("a: 1\nouter: {b: 2}\n");
  file.root().number("a");
  file.root().map("outer").number("b");
  file.root().map("pwm").number("period_s");
  const std::vector<ConfigFault> faults = faults_of(file);
  EXPECT_EQ(faults.size(), 2u);
  EXPECT_TRUE(has_fault(faults, 1, "pwm", "is missing"));
  EXPECT_TRUE(has_fault(faults, 1, "pwm.period_s", "is missing"));
}

TEST(StrictYaml, AFaultyKeyIsNotJudgedByFurtherRules) {
  const ConfigFile file = file_of("a: x\nb: [1, y]\nc: 1\n");
  const ConfigMap root = file.root();
  root.number("a");
  root.numbers("b", 2);
  root.number("c");
  EXPECT_TRUE(root.faulty("a"));
  EXPECT_TRUE(root.faulty("b"));
  EXPECT_FALSE(root.faulty("c"));
  root.fault("a", "must be less than c");
  root.fault("b", "must not be zero");
  root.fault("c", "must be 2");
  const std::vector<ConfigFault> faults = faults_of(file);
  EXPECT_EQ(faults.size(), 3u);
  EXPECT_TRUE(has_fault(faults, 3, "c", "must be 2"));
}

TEST(StrictYaml, WhatIsReadTwiceIsReadOnceAndReportedOnce) {
  const ConfigFile file = file_of("m: {a: 1, b: x}\n");
  file.root().map("m").number("a");
  file.root().map("m").number("b");
  file.root().map("m").number("b");
  const std::vector<ConfigFault> faults = faults_of(file);
  EXPECT_EQ(faults.size(), 1u);
  EXPECT_TRUE(has_fault(faults, 1, "m.b", "must be a number"));
}

TEST(StrictYaml, SkippedPartsBelongToSomeoneElse) {
  const ConfigFile file = file_of("theirs: {a: 1}\n");
  file.root().skip("theirs");
  EXPECT_NO_THROW(file.check());
}

TEST(StrictYaml, FilesThatAreNoMappingOrNoYamlOrNotThere) {
  const ConfigFile list = file_of("[1, 2]\n");
  list.root().number("a");
  EXPECT_TRUE(has_fault(faults_of(list), 0, "", "must be a YAML mapping"));
  EXPECT_THROW(file_of("a: [1\nb: 2\n"), ConfigError);
  EXPECT_THROW(ConfigFile("/nowhere/robot.yaml"), ConfigError);
}

TEST(StrictYaml, PathsAreRelativeToTheFile) {
  const ConfigFile file = ConfigFile::from_text("a: 1", "/robots/config/scenario/s.yaml");
  EXPECT_EQ(file.resolve("../vehicle/v.yaml"), "/robots/config/vehicle/v.yaml");
  EXPECT_EQ(file.resolve("/v.yaml"), "/v.yaml");
}

}  // namespace
}  // namespace atmos
