#include "atmos_px4_bridge/xrce/framing.h"

#include <array>

namespace atmos::xrce {

namespace {

constexpr std::uint8_t kBegin = 0x7E, kEscape = 0x7D, kFlip = 0x20;
constexpr std::size_t kHeader = 4, kCrc = 2;  // addresses and length; behind the message

constexpr std::array<std::uint16_t, 256> crc_table() {
  constexpr std::uint16_t kPolynomial = 0xA001;  // 8005, reflected
  std::array<std::uint16_t, 256> table{};
  for (unsigned byte = 0; byte < 256; ++byte) {
    unsigned crc = byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 1u) != 0 ? (crc >> 1) ^ kPolynomial : crc >> 1;
    table[byte] = static_cast<std::uint16_t>(crc);
  }
  return table;
}
constexpr auto kTable = crc_table();

void put(Bytes& out, unsigned byte) {
  const auto b = static_cast<std::uint8_t>(byte);
  if (b == kBegin || b == kEscape) {
    out.push_back(kEscape);
    out.push_back(b ^ kFlip);
  } else {
    out.push_back(b);
  }
}

}  // namespace

std::uint16_t crc16(const std::uint8_t* data, std::size_t size) {
  std::uint16_t crc = 0;
  for (std::size_t i = 0; i < size; ++i)
    crc = static_cast<std::uint16_t>((crc >> 8) ^ kTable[(crc ^ data[i]) & 0xFFu]);
  return crc;
}

Bytes frame(const Bytes& message, std::uint8_t source, std::uint8_t destination) {
  Bytes out;
  out.reserve(message.size() + 16);
  out.push_back(kBegin);
  put(out, source);
  put(out, destination);
  put(out, static_cast<unsigned>(message.size() & 0xFFu));
  put(out, static_cast<unsigned>(message.size() >> 8));
  for (const std::uint8_t byte : message) put(out, byte);
  const std::uint16_t crc = crc16(message.data(), message.size());
  put(out, crc & 0xFFu);
  put(out, static_cast<unsigned>(crc >> 8));
  return out;
}

std::optional<ByteView> Deframer::push(std::uint8_t byte) {
  if (byte == kBegin) {
    if (inside_ && !content_.empty()) ++counters_.broken;
    inside_ = true;
    escaped_ = false;
    content_.clear();
    return std::nullopt;
  }
  if (!inside_) {
    ++counters_.skipped_bytes;
    return std::nullopt;
  }
  if (byte == kEscape) {
    escaped_ = true;
    return std::nullopt;
  }
  content_.push_back(escaped_ ? byte ^ kFlip : byte);
  escaped_ = false;
  if (content_.size() < kHeader) return std::nullopt;
  const std::size_t size = content_[2] | static_cast<std::size_t>(content_[3]) << 8;
  if (size > kMostInbound) {
    ++counters_.broken;
    inside_ = false;
    return std::nullopt;
  }
  if (content_.size() < kHeader + size + kCrc) return std::nullopt;
  return end();
}

std::optional<ByteView> Deframer::end() {
  inside_ = false;
  const std::size_t size = content_.size() - kHeader - kCrc;
  const ByteView message{content_.data() + kHeader, size};
  const unsigned stated = content_[kHeader + size] | static_cast<unsigned>(content_[kHeader + size + 1]) << 8;
  if (crc16(message.data, message.size) != stated) {
    ++counters_.bad_crc;
    return std::nullopt;
  }
  if (content_[0] != source_ || content_[1] != destination_) {
    ++counters_.foreign;
    return std::nullopt;
  }
  ++counters_.frames;
  return message;
}

}  // namespace atmos::xrce
