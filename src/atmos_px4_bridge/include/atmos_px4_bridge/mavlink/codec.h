// MAVLink 2 framing: encoding, an incremental parser that resynchronises within one frame, decoding. Version
// 1 is understood too, because autopilots speak it until they are spoken to in version 2. Source: the public
// serialisation guide of MAVLink.
#pragma once

#include <cstdint>
#include <cstring>
#include <optional>
#include <vector>

#include "atmos_px4_bridge/mavlink/messages.h"

namespace atmos::mavlink {

#if __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "fields are copied as they are: the wire is little-endian"
#endif

// CRC-16/MCRF4XX of `size` bytes, continued from `crc`.
u16 crc16(const u8* data, std::size_t size, u16 crc = 0xFFFF);

// The table row of a message; nullptr for one that is not in the table.
const MessageInfo* find_message(u32 id);

struct Address {
  u8 system = 0;
  u8 component = 0;
};

inline constexpr std::size_t kMaxFrame = 10 + 255 + 2 + 13;

namespace detail {
// Adds header, truncation of trailing zeros and checksum around the `size` payload bytes at frame + 10.
std::size_t finish_frame(const MessageInfo& info, Address from, u8 sequence, u8* frame);
}  // namespace detail

// Writes `message` as a version 2 frame and returns its length; `frame` has room for kMaxFrame bytes.
template <class Message>
std::size_t encode(const Message& message, Address from, u8 sequence, u8* frame) {
  u8* out = frame + 10;
  const auto write = [&out](const char*, const auto& field) {
    std::memcpy(out, &field, sizeof(field));
    out += sizeof(field);
  };
  Message::visit_base(message, write);
  Message::visit_extension(message, write);
  static constexpr MessageInfo kInfo{Message::kId, Message::kCrcExtra, Message::kBaseSize, Message::kSize,
                                     Message::kName};
  return detail::finish_frame(kInfo, from, sequence, frame);
}

// A checked frame; its payload lies in the parser until the next call.
struct Frame {
  const MessageInfo* info = nullptr;
  Address from;
  u8 sequence = 0;
  const u8* payload = nullptr;
  std::size_t size = 0;  // after truncation; may exceed info->size for a newer definition
};

// The fields of `frame`; nothing when it is another message. Truncated bytes are zeros, bytes beyond our
// definition are ignored.
template <class Message>
std::optional<Message> decode(const Frame& frame) {
  if (frame.info->id != Message::kId) return std::nullopt;
  std::array<u8, Message::kSize> wire{};
  std::memcpy(wire.data(), frame.payload, std::min(frame.size, wire.size()));
  const u8* in = wire.data();
  const auto read = [&in](const char*, auto& field) {
    std::memcpy(&field, in, sizeof(field));
    in += sizeof(field);
  };
  Message message;
  Message::visit_base(message, read);
  Message::visit_extension(message, read);
  return message;
}

struct ParserCounters {
  std::uint64_t frames = 0;
  std::uint64_t bad_crc = 0;
  std::uint64_t skipped_bytes = 0;  // no part of a frame of ours, messages outside the table included
};

// Takes bytes as they come and gives out checked frames. After a failed check it looks on from the very next
// byte, so that no intact frame is lost behind a damaged one.
class Parser {
 public:
  void push(const u8* data, std::size_t size);
  // The next frame, or nothing until more bytes come. To be called until there is nothing before push().
  std::optional<Frame> next();
  const ParserCounters& counters() const { return counters_; }
  // Forgets a begun frame: after a reconnection the rest of it will not come.
  void reset();

 private:
  std::vector<u8> buffer_;
  std::size_t begin_ = 0;
  ParserCounters counters_;
};

}  // namespace atmos::mavlink
