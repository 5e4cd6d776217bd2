// Devices that come and go: a pseudo-terminal is unplugged and plugged, a line does not take more, UDP both
// ways.
#include "atmos_px4_bridge/port.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <numeric>
#include <stdexcept>

#include "atmos_model/strict_yaml.h"
#include "atmos_px4_bridge/emulator/pseudo_terminal.h"
#include "atmos_px4_bridge/px4_bridge.h"

namespace atmos {
namespace {

std::string device_path() { return ::testing::TempDir() + "port_test_" + std::to_string(::getpid()); }

// Reads until `size` bytes have come; gives up after as many empty reads as a busy machine may need.
template <class Source>
std::vector<std::uint8_t> read_all(Source& source, std::size_t size) {
  std::vector<std::uint8_t> all;
  std::uint8_t buffer[4096];
  for (int empty = 0; all.size() < size && empty < 2000000;) {
    const std::size_t got = source.read(buffer, sizeof(buffer));
    if (got == 0) ++empty;
    all.insert(all.end(), buffer, buffer + got);
  }
  return all;
}

std::vector<std::uint8_t> every_byte() {
  std::vector<std::uint8_t> bytes(256);
  std::iota(bytes.begin(), bytes.end(), std::uint8_t{0});
  return bytes;
}

TEST(SerialPort, PassesEveryByteBothWays) {
  PseudoTerminal terminal(device_path());
  const auto port = make_port(device_path(), 921600);
  EXPECT_TRUE(port->poll(100.0));
  const auto bytes = every_byte();
  port->write(bytes.data(), bytes.size());
  EXPECT_EQ(read_all(terminal, bytes.size()), bytes);
  terminal.write(bytes.data(), bytes.size());
  EXPECT_EQ(read_all(*port, bytes.size()), bytes);
}

TEST(SerialPort, TakesAnyBaudRate) {
  PseudoTerminal terminal(device_path());
  for (const int baud : {57600, 921600, 2000000, 123456}) {
    const auto port = make_port(device_path(), baud);
    EXPECT_TRUE(port->poll(100.0)) << baud << ": " << port->fault();
  }
}

TEST(SerialPort, ComesBackAfterTheCableWasPulled) {
  PseudoTerminal terminal(device_path());
  const auto port = make_port(device_path(), 921600);
  ASSERT_TRUE(port->poll(100.0));
  terminal.unplug();
  std::uint8_t buffer[16];
  EXPECT_EQ(port->read(buffer, sizeof(buffer)), 0u);
  EXPECT_FALSE(port->is_open());
  EXPECT_FALSE(port->poll(101.0));
  EXPECT_FALSE(port->fault().empty());
  const auto bytes = every_byte();
  port->write(bytes.data(), bytes.size());  // into nothing
  terminal.plug();
  EXPECT_FALSE(port->poll(101.1)) << "not tried all the time";
  ASSERT_TRUE(port->poll(101.3));
  port->write(bytes.data(), bytes.size());
  EXPECT_EQ(read_all(terminal, bytes.size()), bytes) << "nothing of before";
  EXPECT_EQ(port->counters().opened, 2u);
}

TEST(SerialPort, DropsWholeFramesWhenTheLineIsStuck) {
  PseudoTerminal terminal(device_path());
  const auto port = make_port(device_path(), 921600);
  ASSERT_TRUE(port->poll(100.0));
  const std::vector<std::uint8_t> frame(100, 0x55);
  constexpr std::size_t kFrames = 1000;
  for (std::size_t k = 0; k < kFrames; ++k) port->write(frame.data(), frame.size());
  const std::size_t dropped = port->counters().dropped_frames;
  EXPECT_GT(dropped, 0u);
  // What was taken is complete: partial writes go on with the rest.
  std::size_t got = 0;
  std::uint8_t buffer[4096];
  for (int empty = 0; empty < 1000;) {
    const std::size_t size = terminal.read(buffer, sizeof(buffer));
    got += size;
    if (size == 0) ++empty;
    port->read(buffer, sizeof(buffer));  // lets the port send what is waiting
  }
  EXPECT_EQ(got, (kFrames - dropped) * frame.size());
}

TEST(UdpPort, AnswersWhoeverSpeaksFirst) {
  const int base = 20000 + ::getpid() % 20000;
  const auto simulator = make_port("udp:" + std::to_string(base), 0);
  const auto bridge = make_port("udp:" + std::to_string(base + 1) + ":127.0.0.1:" + std::to_string(base), 0);
  ASSERT_TRUE(simulator->poll(1.0)) << simulator->fault();
  ASSERT_TRUE(bridge->poll(1.0)) << bridge->fault();
  const auto bytes = every_byte();
  bridge->write(bytes.data(), bytes.size());
  EXPECT_EQ(read_all(*simulator, bytes.size()), bytes);
  simulator->write(bytes.data(), bytes.size());
  EXPECT_EQ(read_all(*bridge, bytes.size()), bytes);
}

TEST(MakePort, NamesWhatIsWrong) {
  for (const char* device : {"", "udp:", "udp:x", "udp:70000", "udp:1:2", "udp:14540:nowhere:14580"})
    EXPECT_THROW(make_port(device, 921600), std::invalid_argument) << device;
  EXPECT_THROW(make_port("/dev/ttyPX4", 0), std::invalid_argument);
}

TEST(BridgeFile, ShippedFilesLoadAndBrokenOnesAreNamed) {
  EXPECT_EQ(load_bridge(ATMOS_CONFIG_DIR "/px4/bridge.yaml", LinkChoice::kMavlink).mavlink->firmware,
            Firmware::kStock);
  EXPECT_EQ(load_bridge(ATMOS_CONFIG_DIR "/px4/bridge_patched.yaml", LinkChoice::kMavlink).mavlink->firmware,
            Firmware::kPatched);
  const BridgeConfig both = load_bridge(ATMOS_CONFIG_DIR "/px4/bridge.yaml", LinkChoice::kBoth);
  EXPECT_TRUE(both.mavlink && both.xrce);
  EXPECT_EQ(both.xrce->firmware, xrce::Firmware::kPx4Space);
  EXPECT_FALSE(load_bridge(ATMOS_CONFIG_DIR "/px4/bridge.yaml", LinkChoice::kXrce).mavlink);

  const std::string path = device_path() + ".yaml";
  const auto faults = [&path](const char* text, LinkChoice link) {
    FILE* file = std::fopen(path.c_str(), "w");
    std::fputs(text, file);
    std::fclose(file);
    try {
      load_bridge(path, link);
    } catch (const ConfigError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  const char* const broken =
      "px4_bridge: {mavlink: {firmware: new, system_id: 0}, xrce: {firmware: px4, autopilot_system_id: 0}, "
      "safety: {area_min_m: [1, 1], area_max_m: [0, 0]}}";
  const std::string all = faults(broken, LinkChoice::kMavlink);
  for (const char* key :
       {"mavlink.firmware", "mavlink.system_id", "mavlink.autopilot_system_id", "xrce.firmware",
        "xrce.system_id", "xrce.autopilot_system_id", "setpoint_limit_s", "area_max_m"})
    EXPECT_NE(all.find(key), std::string::npos) << key << " in " << all;
  // What the chosen link needs must be there; what it does not use may be absent.
  EXPECT_NE(faults("px4_bridge: {mavlink: {}, safety: {}}", LinkChoice::kBoth).find("xrce.firmware"),
            std::string::npos);
  EXPECT_EQ(faults("px4_bridge: {mavlink: {}, safety: {}}", LinkChoice::kMavlink).find("xrce"),
            std::string::npos);
  ::unlink(path.c_str());
}

}  // namespace
}  // namespace atmos
