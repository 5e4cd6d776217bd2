#include "atmos_px4_bridge/mavlink/codec.h"

namespace atmos::mavlink {

namespace {

constexpr u8 kStart1 = 0xFE, kStart2 = 0xFD;
constexpr std::size_t kHeader1 = 6, kHeader2 = 10, kChecksum = 2, kSignature = 13;
constexpr u8 kSigned = 0x01;
constexpr std::size_t kSlices = 8;
constexpr u32 kIndexed = 512;  // ids below have an entry of their own in the look-up table

// table[k][b]: what byte b adds to the checksum when k more bytes follow, so that eight are taken at a time.
struct CrcTable {
  u16 entry[kSlices][256];
};

constexpr CrcTable make_crc_table() {
  CrcTable table{};
  for (unsigned b = 0; b < 256; ++b) {
    u16 crc = static_cast<u16>(b);
    for (int bit = 0; bit < 8; ++bit) crc = static_cast<u16>((crc >> 1) ^ ((crc & 1u) ? 0x8408 : 0));
    table.entry[0][b] = crc;
  }
  for (std::size_t k = 1; k < kSlices; ++k) {
    for (unsigned b = 0; b < 256; ++b) {
      const u16 before = table.entry[k - 1][b];
      table.entry[k][b] = static_cast<u16>((before >> 8) ^ table.entry[0][before & 0xFF]);
    }
  }
  return table;
}

constexpr CrcTable kCrc = make_crc_table();

struct Index {
  const MessageInfo* by_id[kIndexed];
};

constexpr Index make_index() {
  Index index{};
  for (const MessageInfo& info : kMessages) index.by_id[info.id] = &info;
  return index;
}

constexpr Index kIndex = make_index();

u16 checksum(const u8* frame, std::size_t end, u8 crc_extra) {
  return crc16(&crc_extra, 1, crc16(frame + 1, end - 1));
}

}  // namespace

u16 crc16(const u8* data, std::size_t size, u16 crc) {
  const auto& t = kCrc.entry;
  for (; size >= kSlices; size -= kSlices, data += kSlices) {
    const unsigned low = (crc & 0xFFu) ^ data[0], high = (crc >> 8) ^ data[1];
    crc = static_cast<u16>(t[7][low] ^ t[6][high] ^ t[5][data[2]] ^ t[4][data[3]] ^ t[3][data[4]] ^
                           t[2][data[5]] ^ t[1][data[6]] ^ t[0][data[7]]);
  }
  for (; size > 0; --size, ++data) crc = static_cast<u16>((crc >> 8) ^ t[0][(crc ^ *data) & 0xFF]);
  return crc;
}

const MessageInfo* find_message(u32 id) { return id < kIndexed ? kIndex.by_id[id] : nullptr; }

std::size_t detail::finish_frame(const MessageInfo& info, Address from, u8 sequence, u8* frame) {
  std::size_t length = info.size;
  while (length > 1 && frame[kHeader2 + length - 1] == 0) --length;
  frame[0] = kStart2;
  frame[1] = static_cast<u8>(length);
  frame[2] = frame[3] = 0;
  frame[4] = sequence;
  frame[5] = from.system;
  frame[6] = from.component;
  frame[7] = static_cast<u8>(info.id);
  frame[8] = static_cast<u8>(info.id >> 8);
  frame[9] = static_cast<u8>(info.id >> 16);
  const std::size_t end = kHeader2 + length;
  const u16 crc = checksum(frame, end, info.crc_extra);
  frame[end] = static_cast<u8>(crc);
  frame[end + 1] = static_cast<u8>(crc >> 8);
  return end + kChecksum;
}

void Parser::push(const u8* data, std::size_t size) {
  buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(begin_));
  begin_ = 0;
  buffer_.insert(buffer_.end(), data, data + size);
}

void Parser::reset() {
  buffer_.clear();
  begin_ = 0;
}

std::optional<Frame> Parser::next() {
  while (begin_ < buffer_.size()) {
    const u8* const frame = buffer_.data() + begin_;
    const std::size_t available = buffer_.size() - begin_;
    const bool version2 = frame[0] == kStart2;
    const auto skip = [this] { ++begin_, ++counters_.skipped_bytes; };
    if (!version2 && frame[0] != kStart1) {
      skip();
      continue;
    }
    const std::size_t header = version2 ? kHeader2 : kHeader1;
    if (available < header) return std::nullopt;

    const u8 incompatible = version2 ? frame[2] : 0;
    const u32 id = version2 ? frame[7] | frame[8] << 8 | frame[9] << 16 : frame[5];
    const MessageInfo* const info = find_message(id);
    const std::size_t length = frame[1];
    if (info == nullptr || (incompatible & ~kSigned) != 0 || (!version2 && length != info->base_size)) {
      skip();
      continue;
    }
    const std::size_t end = header + length;
    const std::size_t total = end + kChecksum + (incompatible & kSigned ? kSignature : 0);
    if (available < total) return std::nullopt;
    if (checksum(frame, end, info->crc_extra) != (frame[end] | frame[end + 1] << 8)) {
      ++counters_.bad_crc;
      skip();
      continue;
    }
    begin_ += total;
    ++counters_.frames;
    const u8* const address = frame + (version2 ? 5 : 3);
    return Frame{info, {address[0], address[1]}, address[-1], frame + header, length};
  }
  return std::nullopt;
}

}  // namespace atmos::mavlink
