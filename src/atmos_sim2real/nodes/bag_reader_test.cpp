// The bag reader on damaged files: one sentence or a recording, never a crash, a hang or the memory a length
// claims.
#include "atmos_sim2real_ros/bag_reader.h"

#include <atmos_msgs/ThrusterCommand.h>
#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <rosbag/bag.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>

#include "atmos_model_ros/messages.h"

namespace atmos {
namespace {

namespace fs = std::filesystem;

constexpr double kStart = 1.7e9;

class BagReader : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("atmos_bag_reader_" + std::to_string(getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  std::string path(const std::string& name) const { return (folder_ / (name + ".bag")).string(); }

  // Three seconds of poses and commands in a few chunks.
  void write_good(const std::string& to, rosbag::CompressionType compression) const {
    rosbag::Bag bag(to, rosbag::bagmode::Write);
    bag.setCompression(compression);
    bag.setChunkThreshold(4096);
    for (int k = 0; k < 30; ++k) {
      atmos_msgs::ThrusterCommand command;
      command.header.stamp = ros::Time(kStart + 0.1 * k);
      command.period = 0.1;
      command.duty.assign(8, 0.1 * (k % 3));
      bag.write("/atmos/thruster_command", command.header.stamp, command);
      for (int i = 0; i < 5; ++i) {
        geometry_msgs::PoseStamped pose;
        pose.header.stamp = ros::Time(kStart + 0.1 * k + 0.02 * i);
        pose.pose = planar_pose(0.01 * k + 1e-4 * i, 1.0, 1e-3 * k);
        bag.write("/atmos/mocap/pose", pose.header.stamp, pose);
      }
    }
  }

  fs::path folder_;
};

std::string bytes_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

// What becomes of a mutated file: "" when it was read, else the sentence.
std::string outcome(const std::string& path, Recording* recording = nullptr) {
  try {
    Recording read = clean_recording(read_bag(path), 8);
    if (recording != nullptr) *recording = std::move(read);
    return "";
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
}

// One of: flipped bits, overwritten lengths, a hole, a cut, a piece from elsewhere.
std::string mutated(std::string bytes, std::mt19937_64& random) {
  const auto any = [&](std::size_t below) { return static_cast<std::size_t>(random() % below); };
  const int changes = 1 + static_cast<int>(any(4));
  for (int c = 0; c < changes && bytes.size() > 64; ++c) {
    const std::size_t at = any(bytes.size() - 8);
    switch (any(6)) {
      case 0:
        bytes[at] = static_cast<char>(bytes[at] ^ (1 << any(8)));
        break;
      case 1:
        bytes[at] = static_cast<char>(random());
        break;
      case 2: {  // a length or count somewhere, made huge or negative
        const std::uint32_t wild[] = {0xffffffffU, 0x7fffffffU, 0x10000000U, 0U};
        std::memcpy(&bytes[at], &wild[any(4)], 4);
        break;
      }
      case 3:
        bytes.erase(at, 1 + any(16));
        break;
      case 4:
        bytes.resize(at);
        break;
      default:
        bytes.replace(at, 8, bytes, any(bytes.size() - 8), 8);
    }
  }
  return bytes;
}

TEST_F(BagReader, ReadsWhatWasWritten) {
  for (const auto compression :
       {rosbag::compression::Uncompressed, rosbag::compression::BZ2, rosbag::compression::LZ4}) {
    write_good(path("good"), compression);
    const Recording recording = read_bag(path("good"));
    ASSERT_EQ(recording.poses.size(), 150U);
    ASSERT_EQ(recording.commands.size(), 30U);
    EXPECT_EQ(recording.name, "good");
    EXPECT_DOUBLE_EQ(recording.poses[6].x_m, 0.0101);
    EXPECT_NEAR(recording.poses[149].yaw_rad, 0.029, 1e-12);
    EXPECT_EQ(recording.commands[4].duty, std::vector<double>(8, 0.1));
    EXPECT_DOUBLE_EQ(recording.commands[29].stamp_s, kStart + 2.9);
  }
}

TEST_F(BagReader, AFolderOrAMissingFileIsSaidToBeNone) {
  EXPECT_NE(outcome(folder_.string()).find("no such file"), std::string::npos);
  EXPECT_NE(outcome(path("missing")).find("no such file"), std::string::npos);
}

TEST_F(BagReader, AnAttitudeThatIsNoneIsDropped) {
  rosbag::Bag bag(path("attitude"), rosbag::bagmode::Write);
  for (int i = 0; i < 2; ++i) {
    geometry_msgs::PoseStamped pose;
    pose.header.stamp = ros::Time(kStart + i);
    pose.pose = planar_pose(0.0, 0.0, 0.1);
    if (i == 1) pose.pose.orientation.w = pose.pose.orientation.z = 0.0;
    bag.write("/atmos/mocap/pose", pose.header.stamp, pose);
  }
  atmos_msgs::ThrusterCommand command;
  command.header.stamp = ros::Time(kStart);
  bag.write("/atmos/thruster_command", command.header.stamp, command);
  bag.close();
  const Recording recording = read_bag(path("attitude"));
  EXPECT_NEAR(recording.poses[0].yaw_rad, 0.1, 1e-12);
  EXPECT_TRUE(std::isnan(recording.poses[1].yaw_rad));
}

// 0xffffffff duties in a message of a few bytes: rosbag's own reading would ask for 32 GB.
TEST_F(BagReader, ALengthThatCannotBeIsRefusedWithinLimits) {
  write_good(path("good"), rosbag::compression::Uncompressed);
  std::string bytes = bytes_of(path("good"));
  const std::uint32_t eight = 8, endless = 0xffffffffU;
  const double period = 0.1;
  std::string pattern(reinterpret_cast<const char*>(&period), 8);
  pattern.append(reinterpret_cast<const char*>(&eight), 4);
  const std::size_t at = bytes.find(pattern);
  ASSERT_NE(at, std::string::npos);
  std::memcpy(&bytes[at + 8], &endless, 4);
  std::ofstream(path("bad"), std::ios::binary) << bytes;
  EXPECT_NE(outcome(path("bad")).find("cannot be read as a ROS 1 bag"), std::string::npos);
}

TEST_F(BagReader, SurvivesDamagedFiles) {
  const char* long_tests = std::getenv("ATMOS_LONG_TESTS");
  const int files = long_tests != nullptr && std::string(long_tests) == "1" ? 100000 : 200;
  std::string good[2];
  write_good(path("good"), rosbag::compression::Uncompressed);
  good[0] = bytes_of(path("good"));
  write_good(path("good"), rosbag::compression::LZ4);
  good[1] = bytes_of(path("good"));
  int refused = 0;
  for (int i = 0; i < files; ++i) {
    SCOPED_TRACE("file " + std::to_string(i));
    std::mt19937_64 random(static_cast<std::uint64_t>(i));
    std::ofstream(path("bad"), std::ios::binary) << mutated(good[i % 2], random);
    Recording recording;
    const std::string text = outcome(path("bad"), &recording);
    refused += text.empty() ? 0 : 1;
    if (text.empty()) {  // whatever was read is fit to be used
      ASSERT_GE(recording.poses.size(), 50U);
      ASSERT_LT(recording.duration_s(), 1e5);
      for (const PoseSample& pose : recording.poses)
        ASSERT_TRUE(std::isfinite(pose.x_m + pose.y_m + pose.yaw_rad));
      for (const ThrusterCommand& command : recording.commands) ASSERT_EQ(command.duty.size(), 8U);
    } else {
      ASSERT_EQ(text.find('\n'), std::string::npos);
    }
  }
  rusage used{};
  getrusage(RUSAGE_CHILDREN, &used);
  EXPECT_LT(used.ru_maxrss, 1300 * 1024) << "kB, of the greediest reader";
  EXPECT_GT(refused, files / 10);
  EXPECT_LT(refused, files);
}

}  // namespace
}  // namespace atmos
