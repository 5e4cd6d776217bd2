#include "atmos_operator/run_configuration.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

namespace atmos {
namespace {

namespace fs = std::filesystem;

const std::string kConfig = ATMOS_CONFIG_DIR;

class Folder : public testing::Test {
 protected:
  Folder() {
    std::string pattern = testing::TempDir() + "run_configuration_XXXXXX";
    root_ = fs::canonical(mkdtemp(pattern.data()));
  }
  ~Folder() override { fs::remove_all(root_); }

  std::string write(const std::string& name, const std::string& text) {
    fs::create_directories((root_ / name).parent_path());
    std::ofstream(root_ / name) << text;
    return root_ / name;
  }

  fs::path root_;
};

const ConfigurationFile* find(const RunConfiguration& configuration, const std::string& ending) {
  for (const ConfigurationFile& file : configuration.files)
    if (file.path.size() >= ending.size() && file.path.substr(file.path.size() - ending.size()) == ending)
      return &file;
  return nullptr;
}

// FIPS 180-2, appendix B.
TEST(Sha256, KnownAnswers) {
  EXPECT_EQ(sha256(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(sha256("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
}

TEST(RunConfigurationTest, AScenarioBringsItsVehicleControllerAndFloor) {
  const RunConfiguration run = collect_configuration(
      {{"/atmos/sim/scenario", kConfig + "/scenario/typical_lab_day.yaml"},
       {"/atmos/sim/clock", "lockstep"},
       {"/atmos/nmpc/vehicle", kConfig + "/vehicle/atmos.yaml"},
       {"/atmos/nmpc/controller", kConfig + "/controller/direct_allocation_harsh.yaml"}});
  for (const char* name : {"/typical_lab_day.yaml", "/vehicle/atmos.yaml", "/direct_allocation.yaml",
                           "/resin_1.txt", "/direct_allocation_harsh.yaml", "/model/harsh.yaml",
                           "/resin_2.txt"})  // the last by way of the controller's model
    EXPECT_NE(find(run, name), nullptr) << name;
  EXPECT_EQ(run.files.size(), 7u);
  EXPECT_EQ(find(run, "/vehicle/atmos.yaml")->used_by,
            (std::vector<std::string>{"/atmos/nmpc/vehicle", "typical_lab_day.yaml"}));
  EXPECT_EQ(find(run, "/resin_1.txt")->sha256, sha256(find(run, "/resin_1.txt")->content));
}

TEST_F(Folder, EqualDigestsAreEqualConfigurations) {
  const auto digest = [](const std::string& path) { return collect_configuration({{"/a", path}}).digest; };
  const std::string here = digest(write("one/a.yaml", "b: b.txt\n"));
  EXPECT_EQ(digest(write("two/a.yaml", "b: b.txt\n")), here);  // not where it is
  EXPECT_NE(digest(write("two/a.yaml", "b: c.txt\n")), here);
  write("one/b.txt", "1");
  const std::string with_b = digest(root_ / "one/a.yaml");
  EXPECT_NE(with_b, here);
  write("one/b.txt", "2");
  EXPECT_NE(digest(root_ / "one/a.yaml"), with_b);
}

TEST_F(Folder, WhatIsNoConfigurationIsPassedOver) {
  const std::string yaml = write("a.yaml", "{not: [closed");
  const RunConfiguration run = collect_configuration({{"/broken", yaml},
                                                      {"/missing", (root_ / "none.yaml").string()},
                                                      {"/folder", root_.string()},
                                                      {"/bag", write("run.bag", "#ROSBAG")},
                                                      {"/relative", "a.yaml"},
                                                      {"/empty", ""}});
  ASSERT_EQ(run.files.size(), 1u);  // broken, but it was what ran
  EXPECT_EQ(run.files[0].content, "{not: [closed");
}

TEST_F(Folder, FilesThatNameEachOtherAreKeptOnce) {
  const std::string first = write("a.yaml", "other: b.yaml\n");
  write("b.yaml", "[a.yaml, {x: a.yaml}]\n");
  const RunConfiguration run = collect_configuration({{"/a", first}});
  ASSERT_EQ(run.files.size(), 2u);
  EXPECT_EQ(run.files[0].used_by, (std::vector<std::string>{"/a", "b.yaml"}));
}

}  // namespace
}  // namespace atmos
