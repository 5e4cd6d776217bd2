#include "atmos_px4_bridge/mavlink/codec.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <fstream>
#include <map>
#include <sstream>
#include <vector>

#include "fields.h"

namespace atmos::mavlink {
namespace {

using test::hex;
using test::text_of;

template <class Message>
std::vector<u8> frame_of(const Message& message, u8 sequence = 0) {
  std::vector<u8> frame(kMaxFrame);
  frame.resize(encode(message, {42, 191}, sequence, frame.data()));
  return frame;
}

std::vector<u8> bytes_of(const std::string& hex) {
  std::vector<u8> bytes;
  for (std::size_t i = 0; i + 1 < hex.size(); i += 2)
    bytes.push_back(static_cast<u8>(std::stoi(hex.substr(i, 2), nullptr, 16)));
  return bytes;
}

// The text of the one frame in `bytes`, decoded by the row of its id; empty when there is none.
std::string decoded_text(const std::vector<u8>& bytes) {
  Parser parser;
  parser.push(bytes.data(), bytes.size());
  const auto frame = parser.next();
  std::string text;
  if (!frame) return text;
  for_each_message([&](auto row) {
    if (const auto message = decode<decltype(row)>(*frame)) text = text_of(*message);
  });
  return parser.next() ? std::string() : text;
}

TEST(Crc, HasTheCatalogueCheckValue) {
  const std::string check = "123456789";
  EXPECT_EQ(crc16(reinterpret_cast<const u8*>(check.data()), check.size()), 0x6F91);
}

TEST(Crc, DoesNotDependOnHowBytesAreGrouped) {
  std::vector<u8> data(37);
  for (std::size_t i = 0; i < data.size(); ++i) data[i] = static_cast<u8>(31 * i + 7);
  const u16 whole = crc16(data.data(), data.size());
  for (std::size_t cut = 0; cut <= data.size(); ++cut)
    EXPECT_EQ(crc16(data.data() + cut, data.size() - cut, crc16(data.data(), cut)), whole) << cut;
}

// CRC_EXTRA is the folded checksum of "NAME type field type field ..." over the base fields, with the length
// of an array after its name: a wrong name, type or order in a row shows here.
struct CrcExtra {
  u16 crc = 0xFFFF;
  void add(const std::string& text) {
    crc = crc16(reinterpret_cast<const u8*>(text.data()), text.size(), crc);
  }
  template <class Field>
  void operator()(const char* name, const Field&) {
    if constexpr (test::IsArray<Field>::value) {
      add(type_name(typename Field::value_type{}) + " " + name + " ");
      const u8 length = static_cast<u8>(std::tuple_size_v<typename Base<Field>::type>);
      crc = crc16(&length, 1, crc);
    } else {
      add(type_name(Field{}) + " " + name + " ");
    }
  }
  template <class F, class = void>
  struct Base {
    using type = F;
  };
  template <std::size_t N>
  struct Base<Text<N>> {
    using type = std::array<char, N>;
  };
  static std::string type_name(u8) { return "uint8_t"; }
  static std::string type_name(i8) { return "int8_t"; }
  static std::string type_name(u16) { return "uint16_t"; }
  static std::string type_name(i16) { return "int16_t"; }
  static std::string type_name(u32) { return "uint32_t"; }
  static std::string type_name(i32) { return "int32_t"; }
  static std::string type_name(u64) { return "uint64_t"; }
  static std::string type_name(i64) { return "int64_t"; }
  static std::string type_name(float) { return "float"; }
  static std::string type_name(char) { return "char"; }
};

// "CommandLong" -> "COMMAND_LONG".
std::string wire_name(const std::string& type) {
  std::string name;
  for (const char c : type) {
    if (std::isupper(c) && !name.empty()) name += '_';
    name += static_cast<char>(std::toupper(c));
  }
  return name;
}

TEST(Table, ChecksumSeedsFollowFromTheFields) {
  for_each_message([](auto row) {
    using Message = decltype(row);
    CrcExtra extra;
    extra.add(wire_name(Message::kName) + " ");
    Message::visit_base(row, extra);
    EXPECT_EQ(static_cast<u8>((extra.crc & 0xFF) ^ (extra.crc >> 8)), Message::kCrcExtra) << Message::kName;
  });
}

TEST(Table, LengthsAreThoseOfThePublicDefinitions) {
  const std::map<u32, std::pair<int, int>> expected = {
      {0, {9, 9}},      {76, {33, 33}},    {77, {3, 10}},     {82, {39, 51}},
      {84, {53, 53}},   {111, {16, 18}},   {139, {43, 43}},   {147, {36, 54}},
      {36, {21, 37}},   {69, {11, 30}},    {331, {230, 233}}, {253, {51, 54}},
      {102, {32, 117}}, {375, {140, 140}}, {350, {20, 252}},  {385, {133, 133}}};
  for (const auto& [id, lengths] : expected) {
    ASSERT_NE(find_message(id), nullptr);
    EXPECT_EQ(find_message(id)->base_size, lengths.first) << id;
    EXPECT_EQ(find_message(id)->size, lengths.second) << id;
  }
  EXPECT_EQ(find_message(3), nullptr);
  EXPECT_EQ(find_message(1u << 20), nullptr);
}

// Frames and values written by node-mavlink (cross_check/): equal bytes both ways.
TEST(Golden, EveryMessageMatchesTheIndependentImplementation) {
  std::ifstream file(GOLDEN_FRAMES);
  std::map<u32, int> seen;
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    u32 id, sequence;
    std::string frame_hex, rest;
    words >> id >> sequence >> frame_hex;
    std::getline(words, rest);
    const auto bytes = bytes_of(frame_hex);
    EXPECT_EQ(decoded_text(bytes), rest) << id;
    Parser parser;
    parser.push(bytes.data(), bytes.size());
    const auto frame = parser.next();
    ASSERT_TRUE(frame) << line;
    EXPECT_EQ(frame->sequence, sequence);
    for_each_message([&](auto row) {
      const auto message = decode<decltype(row)>(*frame);
      if (!message) return;
      const auto again = frame_of(*message, static_cast<u8>(sequence));
      EXPECT_EQ(hex(again.data(), again.size()), frame_hex) << row.kName;
    });
    ++seen[id];
  }
  EXPECT_EQ(seen.size(), std::size(kMessages));
  for (const auto& [id, count] : seen) EXPECT_EQ(count, 4) << id;
}

RC_GTEST_PROP(RoundTrip, EveryMessageComesBack, (const std::vector<std::uint64_t>& seeds)) {
  for (const std::uint64_t seed : seeds) {
    std::mt19937_64 random(seed);
    for_each_message([&](auto row) {
      const auto message = test::random_message<decltype(row)>(random);
      RC_ASSERT(decoded_text(frame_of(message)) == text_of(message));
    });
  }
}

TEST(Encoding, CutsTrailingZerosButKeepsOneByte) {
  Heartbeat heartbeat;
  EXPECT_EQ(frame_of(heartbeat).size(), 10u + 1u + 2u);
  heartbeat.custom_mode = 1;
  EXPECT_EQ(frame_of(heartbeat).size(), 10u + 1u + 2u);
  heartbeat.type = 1;
  EXPECT_EQ(frame_of(heartbeat).size(), 10u + 5u + 2u);
}

TEST(Text, IsCutAndTerminatedWhereItFits) {
  EXPECT_EQ(Text<4>("ab").str(), "ab");
  EXPECT_EQ(Text<4>("abcd").str(), "abcd");
  EXPECT_EQ(Text<4>("abcdef").str(), "abcd");
}

Heartbeat sample() {
  Heartbeat heartbeat;
  heartbeat.custom_mode = 0x060000;
  heartbeat.mavlink_version = 3;
  return heartbeat;
}

// Version 1 and signed frames, built by hand from a version 2 frame.
std::vector<u8> as_version1(const Heartbeat& heartbeat) {
  const auto two = frame_of(heartbeat);
  std::vector<u8> one = {0xFE, 9, two[4], two[5], two[6], 0};
  one.insert(one.end(), two.begin() + 10, two.end() - 2);
  const u8 extra = Heartbeat::kCrcExtra;
  const u16 crc = crc16(&extra, 1, crc16(one.data() + 1, one.size() - 1));
  one.push_back(static_cast<u8>(crc));
  one.push_back(static_cast<u8>(crc >> 8));
  return one;
}

TEST(Parser, UnderstandsVersion1) { EXPECT_EQ(decoded_text(as_version1(sample())), text_of(sample())); }

TEST(Parser, SkipsTheSignatureOfASignedFrame) {
  auto frame = frame_of(sample());
  frame[2] = 1;
  frame.resize(frame.size() - 2);
  const u8 extra = Heartbeat::kCrcExtra;
  const u16 crc = crc16(&extra, 1, crc16(frame.data() + 1, frame.size() - 1));
  frame.push_back(static_cast<u8>(crc));
  frame.push_back(static_cast<u8>(crc >> 8));
  frame.insert(frame.end(), 13, 0xFD);
  EXPECT_EQ(decoded_text(frame), text_of(sample()));
}

TEST(Parser, RefusesUnknownIncompatibilityFlags) {
  auto frame = frame_of(sample());
  frame[2] = 2;
  EXPECT_EQ(decoded_text(frame), "");
}

TEST(Parser, TakesBytesOneByOne) {
  Parser parser;
  const auto bytes = frame_of(sample());
  for (int repeat = 0; repeat < 3; ++repeat) {
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      parser.push(&bytes[i], 1);
      EXPECT_EQ(parser.next().has_value(), i + 1 == bytes.size());
    }
  }
  EXPECT_EQ(parser.counters().frames, 3u);
  EXPECT_EQ(parser.counters().skipped_bytes, 0u);
}

// The damage is in the first of two frames; the second must come out whatever was damaged.
TEST(Parser, ResynchronisesWithinOneFrame) {
  std::mt19937_64 random(3);
  const auto first = frame_of(test::random_message<Odometry>(random), 1), second = frame_of(sample(), 2);
  for (std::size_t at = 0; at < first.size(); ++at) {
    for (const u8 mask : {u8{0x01}, u8{0x80}, u8{0xFF}}) {
      auto bytes = first;
      bytes[at] ^= mask;
      bytes.insert(bytes.end(), second.begin(), second.end());
      // What follows on a live link: the longest frame that a damaged length may promise.
      bytes.insert(bytes.end(), kMaxFrame, 0);
      Parser parser;
      parser.push(bytes.data(), bytes.size());
      int good = 0;
      while (const auto frame = parser.next()) {
        if (frame->sequence == 2) ++good;
        EXPECT_NE(frame->sequence, 1) << "damaged frame accepted, byte " << at;
      }
      EXPECT_EQ(good, 1) << "byte " << at << " mask " << int{mask};
    }
  }
}

TEST(Parser, FindsAFrameInsideAFalseOne) {
  // A start byte, the id of a known message and a length that swallows the next frame.
  std::vector<u8> bytes = {0xFD, 60, 0, 0, 0, 1, 1, 0, 0, 0};
  const auto good = frame_of(sample(), 9);
  bytes.insert(bytes.end(), good.begin(), good.end());
  bytes.insert(bytes.end(), 60, 0x55);
  Parser parser;
  parser.push(bytes.data(), bytes.size());
  const auto frame = parser.next();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->sequence, 9);
  EXPECT_EQ(parser.counters().bad_crc, 1u);
}

TEST(Parser, ForgetsABegunFrameOnReset) {
  Parser parser;
  const auto bytes = frame_of(sample());
  parser.push(bytes.data(), bytes.size() - 3);
  EXPECT_FALSE(parser.next());
  parser.reset();
  parser.push(bytes.data(), bytes.size());
  EXPECT_TRUE(parser.next());
  EXPECT_EQ(parser.counters().skipped_bytes, 0u);
}

TEST(Decoding, IgnoresBytesOfANewerDefinition) {
  auto frame = frame_of(sample());
  frame.resize(frame.size() - 2);
  frame.insert(frame.end(), {1, 2, 3});
  frame[1] = static_cast<u8>(frame.size() - 10);
  const u8 extra = Heartbeat::kCrcExtra;
  const u16 crc = crc16(&extra, 1, crc16(frame.data() + 1, frame.size() - 1));
  frame.push_back(static_cast<u8>(crc));
  frame.push_back(static_cast<u8>(crc >> 8));
  EXPECT_EQ(decoded_text(frame), text_of(sample()));
}

}  // namespace
}  // namespace atmos::mavlink
