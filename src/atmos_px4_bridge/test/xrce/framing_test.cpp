// Frames and their resynchronisation: check values, stuffing, every frame of the recorded session.
#include "atmos_px4_bridge/xrce/framing.h"

#include <gtest/gtest.h>

#include <random>

#include "session_file.h"

namespace atmos::xrce {
namespace {

std::vector<Bytes> messages_of(Deframer& deframer, const Bytes& bytes) {
  std::vector<Bytes> messages;
  for (const std::uint8_t byte : bytes) {
    if (const auto m = deframer.push(byte)) messages.emplace_back(m->data, m->data + m->size);
  }
  return messages;
}

Deframer from_client() { return Deframer(kClientAddress, kAgentAddress); }
Bytes client_frame(const Bytes& message) { return frame(message, kClientAddress, kAgentAddress); }

TEST(Framing, ChecksumHasThePublishedCheckValue) {
  const std::string digits = "123456789";
  EXPECT_EQ(crc16(reinterpret_cast<const std::uint8_t*>(digits.data()), digits.size()), 0xBB3D);
}

TEST(Framing, StuffsEverythingBehindTheFlag) {
  const Bytes message(0x7E, 0x7D);  // a length and contents that need escapes
  const Bytes line = client_frame(message);
  EXPECT_EQ(std::count(line.begin(), line.end(), 0x7E), 1);
  EXPECT_EQ(line[3], 0x7D);
  EXPECT_EQ(line[4], 0x5E);
  Deframer deframer = from_client();
  EXPECT_EQ(messages_of(deframer, line), std::vector<Bytes>{message});
}

TEST(Framing, RecordedFramesAreReadAndWrittenByteForByte) {
  int frames = 0, escaped = 0;
  for (const auto& recorded : test::load_session()) {
    if (recorded.wire.empty()) continue;
    const auto source = recorded.from_client ? kClientAddress : kAgentAddress;
    const auto destination = recorded.from_client ? kAgentAddress : kClientAddress;
    Deframer deframer(source, destination);
    EXPECT_EQ(messages_of(deframer, recorded.wire), std::vector<Bytes>{recorded.message});
    EXPECT_EQ(frame(recorded.message, source, destination), recorded.wire);
    ++frames;
    escaped += std::count(recorded.wire.begin(), recorded.wire.end(), 0x7D) > 0 ? 1 : 0;
  }
  EXPECT_EQ(frames, 69);
  EXPECT_GT(escaped, 5);
}

TEST(Framing, ForeignAddressesAndWrongChecksumsAreCountedNotTaken) {
  Deframer deframer = from_client();
  EXPECT_TRUE(messages_of(deframer, frame({1, 2, 3}, kAgentAddress, kClientAddress)).empty());
  EXPECT_EQ(deframer.counters().foreign, 1u);
  Bytes damaged = client_frame({1, 2, 3});
  damaged[6] ^= 0x10;
  EXPECT_TRUE(messages_of(deframer, damaged).empty());
  EXPECT_EQ(deframer.counters().bad_crc, 1u);
}

TEST(Framing, AFrameBeyondTheLongestIsGivenUpAtItsLength) {
  Deframer deframer = from_client();
  EXPECT_TRUE(messages_of(deframer, {0x7E, 1, 0, 0x01, 0x09}).empty());  // 2305 bytes
  EXPECT_EQ(deframer.counters().broken, 1u);
  EXPECT_EQ(messages_of(deframer, client_frame({5})), std::vector<Bytes>{Bytes{5}});
}

// Whatever stands before it: the very next whole frame comes out.
TEST(Framing, AnIntactFrameBehindDamageIsAlwaysFound) {
  std::mt19937 random(42);
  const auto message = [&random] {
    Bytes bytes(1 + random() % 300);
    for (auto& byte : bytes)
      byte = static_cast<std::uint8_t>(random() % 4 == 0 ? 0x7D + random() % 2 : random());
    return bytes;
  };
  for (int k = 0; k < 20000; ++k) {
    Deframer deframer = from_client();
    Bytes line = client_frame(message());
    switch (k % 4) {
      case 0:  // truncated
        line.resize(random() % line.size());
        break;
      case 1: {  // spliced: the head of one, the tail of another
        const Bytes other = client_frame(message());
        line.resize(random() % line.size());
        line.insert(line.end(), other.begin() + static_cast<long>(1 + random() % (other.size() - 1)),
                    other.end());
        break;
      }
      case 2:  // noise
        for (auto& byte : line) byte = static_cast<std::uint8_t>(random());
        break;
      default:  // a wrong length
        line[3] = static_cast<std::uint8_t>(line[3] + 1 + random() % 200);
        break;
    }
    const Bytes good = message(), frame = client_frame(good);
    line.insert(line.end(), frame.begin(), frame.end());
    const auto messages = messages_of(deframer, line);
    ASSERT_FALSE(messages.empty()) << k;
    EXPECT_EQ(messages.back(), good) << k;
  }
}

}  // namespace
}  // namespace atmos::xrce
