// The parser against garbage, truncated, spliced and damaged frames: no crash, bounded memory, and an intact
// frame behind them comes out. A million inputs take two seconds.
#include <gtest/gtest.h>

#include "fields.h"

namespace atmos::mavlink {
namespace {

using Random = std::mt19937_64;

std::vector<u8> random_frame(Random& random, u8 sequence) {
  std::vector<u8> frame(kMaxFrame);
  const std::size_t chosen = random() % std::size(kMessages);
  std::size_t row = 0, size = 0;
  for_each_message([&](auto message) {
    if (row++ == chosen)
      size = encode(test::random_message<decltype(message)>(random), {1, 1}, sequence, frame.data());
  });
  frame.resize(size);
  return frame;
}

// One input: something wrong with a frame, or no frame at all.
std::vector<u8> damaged_input(Random& random) {
  std::vector<u8> bytes = random_frame(random, 1);
  switch (random() % 6) {
    case 0: {  // garbage
      bytes.resize(random() % 300);
      for (u8& byte : bytes) byte = static_cast<u8>(random());
      break;
    }
    case 1:  // truncated
      bytes.resize(random() % bytes.size());
      break;
    case 2:  // wrong checksum
      bytes[bytes.size() - 1 - random() % 2] ^= static_cast<u8>(1 + random() % 255);
      break;
    case 3:  // wrong length
      bytes[1] = static_cast<u8>(bytes[1] + 1 + random() % 255);
      break;
    case 4: {  // spliced: the head of one frame, the tail of another
      const auto other = random_frame(random, 1);
      bytes.resize(random() % bytes.size());
      bytes.insert(bytes.end(),
                   other.begin() + static_cast<std::ptrdiff_t>(1 + random() % (other.size() - 1)),
                   other.end());
      break;
    }
    default: {  // start bytes all over
      for (int k = 0; k < 20; ++k) bytes[random() % bytes.size()] = random() % 2 == 0 ? 0xFD : 0xFE;
      break;
    }
  }
  return bytes;
}

TEST(ParserFuzz, SurvivesAndResynchronisesWithinOneFrame) {
  constexpr int inputs = 1000000;
  Random random(1234);
  Parser parser;
  const std::vector<u8> flush(kMaxFrame, 0);
  int lost = 0, unexplained = 0;
  for (int i = 0; i < inputs; ++i) {
    std::vector<u8> bytes = damaged_input(random);
    const auto good = random_frame(random, 200);
    bytes.insert(bytes.end(), good.begin(), good.end());
    bytes.insert(bytes.end(), flush.begin(), flush.end());
    bool found = false;
    int others = 0;
    for (std::size_t at = 0; at < bytes.size();) {
      const std::size_t size = std::min<std::size_t>(1 + random() % 100, bytes.size() - at);
      parser.push(bytes.data() + at, size);
      at += size;
      while (const auto frame = parser.next()) {
        ASSERT_NE(frame->info, nullptr);
        for_each_message([&](auto row) { decode<decltype(row)>(*frame); });
        if (frame->sequence == 200) {
          found = true;
        } else {
          ++others;
        }
      }
    }
    if (!found) ++lost;
    if (!found && others == 0) ++unexplained;
  }
  // A checksum of 16 bits passes one damaged frame in 65536, and what it covers is then gone with it.
  EXPECT_EQ(unexplained, 0) << "intact frames not found, of " << inputs;
  EXPECT_LE(lost, 3.0 * static_cast<double>(parser.counters().bad_crc) / 65536.0);
  std::printf(
      "%d inputs, %d behind a false frame with a right checksum, %lu bad checksums, %lu bytes skipped\n",
      inputs, lost, static_cast<unsigned long>(parser.counters().bad_crc),
      static_cast<unsigned long>(parser.counters().skipped_bytes));
}

}  // namespace
}  // namespace atmos::mavlink
