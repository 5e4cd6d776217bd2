// DDS-XRCE messages as PX4's client and an agent exchange them: a header, then submessages on multiples of
// four bytes. Builders and bounds-checked readers; nothing here keeps state of a session (docs/xrce.md).
#pragma once

#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <type_traits>

#include "atmos_px4_bridge/xrce/framing.h"

namespace atmos::xrce {

enum class Submessage : std::uint8_t {
  kCreateClient = 0,
  kCreate = 1,
  kGetInfo = 2,
  kDelete = 3,
  kStatusAgent = 4,
  kStatus = 5,
  kInfo = 6,
  kWriteData = 7,
  kReadData = 8,
  kData = 9,
  kAcknack = 10,
  kHeartbeat = 11,
  kFragment = 13,
  kTimestamp = 14,
  kTimestampReply = 15,
};

constexpr std::uint8_t kNoSession = 0x80,
                       kSessionWithKey = 0x80;  // sessions below kSessionWithKey carry a key
constexpr std::uint8_t kNoStream = 0, kBestEffort = 0x01, kReliable = 0x80;
constexpr std::uint8_t kLittleEndian = 0x01;  // flag of every submessage
constexpr std::uint16_t kObjectClient = 0xFFFE;

// Last hexadecimal digit of an object id.
enum class Kind : std::uint8_t {
  kParticipant = 1,
  kTopic = 2,
  kPublisher = 3,
  kSubscriber = 4,
  kDataWriter = 5,
  kDataReader = 6,
  kReplier = 8,
};
constexpr Kind kind_of(std::uint16_t object) { return static_cast<Kind>(object & 0x0F); }

// Answers.
constexpr std::uint8_t kOk = 0x00, kErrorMismatch = 0x81, kErrorUnknownReference = 0x84, kErrorInvalid = 0x85,
                       kErrorIncompatible = 0x86, kErrorResources = 0x87;

struct MessageHeader {
  std::uint8_t session = 0, stream = 0;
  std::uint16_t sequence = 0;
};

// Newer by the half-range rule of sequence numbers.
constexpr bool newer(std::uint16_t a, std::uint16_t b) {
  return a != b && static_cast<std::uint16_t>(a - b) < 0x8000;
}

// A message under construction; the last submessage is not padded.
class MessageBuilder {
 public:
  explicit MessageBuilder(MessageHeader header);
  MessageBuilder& begin(Submessage id);
  MessageBuilder& u8(unsigned value);
  MessageBuilder& u16(unsigned value);  // little-endian
  MessageBuilder& u32(std::uint32_t value);
  MessageBuilder& id(unsigned value);  // object and request ids: high byte first
  MessageBuilder& bytes(const void* data, std::size_t size);
  const Bytes& message() const { return message_; }

 private:
  Bytes message_;
  std::size_t length_at_ = 0;  // of the open submessage
};

// The payload of a submessage, read in order. After the end everything reads as zero and ok() is false.
class PayloadReader {
 public:
  explicit PayloadReader(ByteView payload) : payload_(payload) {}
  std::uint8_t u8() { return number<std::uint8_t>(); }
  std::uint16_t u16() { return number<std::uint16_t>(); }
  std::uint32_t u32() { return number<std::uint32_t>(); }
  std::uint16_t id();
  std::string text();  // 32-bit length with the closing zero, then characters
  ByteView part(std::size_t size);
  ByteView rest() { return part(payload_.size - at_); }
  bool ok() const { return ok_; }

 private:
  template <class T>
  T number() {
    static_assert(std::is_unsigned_v<T>);
    at_ = (at_ + sizeof(T) - 1) / sizeof(T) * sizeof(T);
    T value = 0;
    const ByteView source = part(sizeof(T));
    if (source.data != nullptr) std::memcpy(&value, source.data, sizeof(T));
    return value;
  }
  ByteView payload_;
  std::size_t at_ = 0;
  bool ok_ = true;
};

struct SubmessageView {
  Submessage id;
  std::uint8_t flags;
  ByteView payload;
};

// A message as it came. Submessages end where one does not fit.
class MessageReader {
 public:
  // Nothing for a message that is too short, or of a session with a key in its header (PX4 has none).
  static std::optional<MessageReader> open(ByteView message);
  const MessageHeader& header() const { return header_; }
  std::optional<SubmessageView> next();
  bool broken() const { return broken_; }

 private:
  ByteView message_;
  MessageHeader header_;
  std::size_t at_ = 4;
  bool broken_ = false;
};

// An instant in whole nanoseconds, as TIMESTAMP carries it.
struct Instant {
  std::int32_t seconds = 0;
  std::uint32_t nanoseconds = 0;
};
Instant instant_of(double seconds);
Bytes timestamp_reply(std::uint8_t session, Instant transmit, Instant receive, Instant originate);

}  // namespace atmos::xrce
