// Frames of a DDS-XRCE session on a serial line: 7E, source, destination, length (little-endian), message,
// CRC-16/ARC of the message (low byte first). Everything behind the 7E is stuffed: 7E and 7D become 7D and
// the byte XOR 20. A bare 7E always begins a frame.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace atmos::xrce {

using Bytes = std::vector<std::uint8_t>;

struct ByteView {
  const std::uint8_t* data = nullptr;
  std::size_t size = 0;
};

constexpr std::uint8_t kAgentAddress = 0, kClientAddress = 1;
constexpr std::size_t kMostInbound = 2048;  // bytes of a message; the client's best-effort buffer
constexpr std::size_t kMostOutbound = 512;  // bytes of a message that the client takes

std::uint16_t crc16(const std::uint8_t* data, std::size_t size);

// A message as it goes on the line.
Bytes frame(const Bytes& message, std::uint8_t source, std::uint8_t destination);

struct FramingCounters {
  std::uint64_t frames = 0, bad_crc = 0, broken = 0, foreign = 0, skipped_bytes = 0;
};

// Takes bytes as they come, gives messages. An intact frame is found whatever stands before it.
class Deframer {
 public:
  Deframer(std::uint8_t source, std::uint8_t destination) : source_(source), destination_(destination) {}

  // The message that this byte completes; valid until the next call.
  std::optional<ByteView> push(std::uint8_t byte);
  // The line was opened anew.
  void reset() { inside_ = false; }
  const FramingCounters& counters() const { return counters_; }

 private:
  std::optional<ByteView> end();

  std::uint8_t source_, destination_;
  bool inside_ = false, escaped_ = false;
  Bytes content_;  // unstuffed: addresses, length, message, CRC
  FramingCounters counters_;
};

}  // namespace atmos::xrce
