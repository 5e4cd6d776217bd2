#include "atmos_px4_bridge/xrce/protocol.h"

#include <cmath>

namespace atmos::xrce {

namespace {

constexpr std::size_t kHeader = 4, kSubheader = 4, kAlignment = 4;

std::size_t aligned(std::size_t at) { return (at + kAlignment - 1) / kAlignment * kAlignment; }

}  // namespace

MessageBuilder::MessageBuilder(MessageHeader header) {
  u8(header.session).u8(header.stream).u16(header.sequence);
}

MessageBuilder& MessageBuilder::begin(Submessage id) {
  message_.resize(aligned(message_.size()), 0);
  message_.push_back(static_cast<std::uint8_t>(id));
  message_.push_back(kLittleEndian);
  const std::size_t at = message_.size();
  message_.resize(at + 2, 0);
  length_at_ = at;
  return *this;
}

MessageBuilder& MessageBuilder::bytes(const void* data, std::size_t size) {
  const auto* const from = static_cast<const std::uint8_t*>(data);
  message_.insert(message_.end(), from, from + size);
  if (length_at_ != 0) {
    const std::size_t length = message_.size() - length_at_ - 2;
    message_[length_at_] = static_cast<std::uint8_t>(length & 0xFFu);
    message_[length_at_ + 1] = static_cast<std::uint8_t>(length >> 8);
  }
  return *this;
}

MessageBuilder& MessageBuilder::u8(unsigned value) {
  const auto byte = static_cast<std::uint8_t>(value);
  return bytes(&byte, 1);
}

MessageBuilder& MessageBuilder::u16(unsigned value) { return u8(value & 0xFFu).u8(value >> 8); }

MessageBuilder& MessageBuilder::u32(std::uint32_t value) { return u16(value & 0xFFFFu).u16(value >> 16); }

MessageBuilder& MessageBuilder::id(unsigned value) { return u8(value >> 8).u8(value & 0xFFu); }

std::uint16_t PayloadReader::id() {
  const unsigned high = u8();
  return static_cast<std::uint16_t>(high << 8 | u8());
}

std::string PayloadReader::text() {
  const std::uint32_t size = u32();
  const ByteView characters = part(size);
  if (characters.data == nullptr || size == 0) return {};
  return {reinterpret_cast<const char*>(characters.data), size - 1};
}

ByteView PayloadReader::part(std::size_t size) {
  if (!ok_ || at_ > payload_.size || size > payload_.size - at_) {
    ok_ = false;
    return {};
  }
  const ByteView out{payload_.data + at_, size};
  at_ += size;
  return out;
}

std::optional<MessageReader> MessageReader::open(ByteView message) {
  if (message.size < kHeader || message.data[0] < kSessionWithKey) return std::nullopt;
  MessageReader reader;
  reader.message_ = message;
  reader.header_ = {message.data[0], message.data[1],
                    static_cast<std::uint16_t>(message.data[2] | message.data[3] << 8)};
  return reader;
}

std::optional<SubmessageView> MessageReader::next() {
  at_ = aligned(at_);
  if (broken_ || at_ >= message_.size) return std::nullopt;
  if (message_.size - at_ < kSubheader) {
    broken_ = true;
    return std::nullopt;
  }
  const std::uint8_t* const head = message_.data + at_;
  const std::size_t length = head[2] | static_cast<std::size_t>(head[3]) << 8;
  // Big-endian payloads never come from PX4.
  if (length > message_.size - at_ - kSubheader || (head[1] & kLittleEndian) == 0) {
    broken_ = true;
    return std::nullopt;
  }
  at_ += kSubheader + length;
  return SubmessageView{static_cast<Submessage>(head[0]), head[1], {head + kSubheader, length}};
}

Instant instant_of(double seconds) {
  const double whole = std::floor(seconds);
  const auto nanoseconds = static_cast<std::uint32_t>(std::lround((seconds - whole) * 1e9));
  constexpr std::uint32_t kSecond = 1000000000u;
  return {static_cast<std::int32_t>(whole) + (nanoseconds >= kSecond ? 1 : 0), nanoseconds % kSecond};
}

Bytes timestamp_reply(std::uint8_t session, Instant transmit, Instant receive, Instant originate) {
  MessageBuilder message({session, kNoStream, 0});
  message.begin(Submessage::kTimestampReply);
  for (const Instant& instant : {transmit, receive, originate})
    message.u32(static_cast<std::uint32_t>(instant.seconds)).u32(instant.nanoseconds);
  return message.message();
}

}  // namespace atmos::xrce
