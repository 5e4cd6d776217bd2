#include "atmos_mocap_bridge/qtm/packet.h"

#include <cmath>
#include <cstring>

namespace atmos::qtm {

namespace {

constexpr std::size_t kHeader = 8;           // size, type
constexpr std::size_t kFrameHeader = 16;     // time stamp, frame number, component count
constexpr std::size_t kComponentHeader = 8;  // size, type
constexpr std::size_t kBodiesHeader = 16;    // with body count, drop rate and out-of-sync rate
constexpr std::size_t kBody = 48, kBodyRes = 52;
constexpr std::uint32_t kType6d = 5, kType6dEuler = 6, kType6dRes = 11, kType6dEulerRes = 12;

template <class T>
T read(const char* at) {
  // The little-endian port on a little-endian machine.
  T value;
  std::memcpy(&value, at, sizeof value);
  return value;
}

template <class T>
void write(std::string& out, T value) {
  char bytes[sizeof value];
  std::memcpy(bytes, &value, sizeof value);
  out.append(bytes, sizeof value);
}

template <class T>
void overwrite(std::string& out, std::size_t at, T value) {
  std::memcpy(&out[at], &value, sizeof value);
}

bool read_bodies(std::string_view component, std::size_t body_size, Frame& frame) {
  if (component.size() < kBodiesHeader) return false;
  const char* at = component.data();
  const std::uint32_t count = read<std::uint32_t>(at + 8);
  if ((component.size() - kBodiesHeader) / body_size != count ||
      (component.size() - kBodiesHeader) % body_size != 0)
    return false;
  frame.has_bodies = true;
  frame.drop_rate = read<std::uint16_t>(at + 12);
  frame.out_of_sync_rate = read<std::uint16_t>(at + 14);
  frame.bodies.resize(count);
  at += kBodiesHeader;
  for (Body& body : frame.bodies) {
    std::memcpy(body.position_mm.data(), at, sizeof body.position_mm);
    std::memcpy(body.rotation.data(), at + sizeof body.position_mm, sizeof body.rotation);
    body.residual_mm =
        body_size == kBodyRes ? read<float>(at + kBody) : std::numeric_limits<float>::quiet_NaN();
    at += body_size;
  }
  return true;
}

// Roll, pitch and yaw (degrees) of a column-major rotation R = Rz Ry Rx, QTM's standard definition.
std::array<float, 3> euler_deg(const std::array<float, 9>& r) {
  constexpr float kDeg = 180.0f / static_cast<float>(M_PI);
  return {std::atan2(r[5], r[8]) * kDeg, -std::asin(r[2]) * kDeg, std::atan2(r[1], r[0]) * kDeg};
}

void write_bodies(std::string& out, const Frame& frame, std::uint32_t type) {
  const std::size_t start = out.size();
  write<std::uint32_t>(out, 0);
  write(out, type);
  write(out, static_cast<std::uint32_t>(frame.bodies.size()));
  write(out, frame.drop_rate);
  write(out, frame.out_of_sync_rate);
  for (const Body& body : frame.bodies) {
    for (const float x : body.position_mm) write(out, x);
    if (type == kType6dEuler || type == kType6dEulerRes) {
      for (const float x : euler_deg(body.rotation)) write(out, x);
    } else {
      for (const float x : body.rotation) write(out, x);
    }
    if (type == kType6dRes || type == kType6dEulerRes) write(out, body.residual_mm);
  }
  overwrite(out, start, static_cast<std::uint32_t>(out.size() - start));
}

std::string start_packet(PacketType type) {
  std::string out;
  write<std::uint32_t>(out, 0);
  write(out, static_cast<std::uint32_t>(type));
  return out;
}

std::string finish(std::string out) {
  overwrite(out, 0, static_cast<std::uint32_t>(out.size()));
  return out;
}

}  // namespace

void PacketParser::add(const char* data, std::size_t size) {
  if (broken_) return;
  if (begin_ > 0) {
    buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(begin_));
    begin_ = 0;
  }
  buffer_.insert(buffer_.end(), data, data + size);
}

std::optional<Packet> PacketParser::next() {
  const std::size_t available = buffer_.size() - begin_;
  if (broken_ || available < kHeader) return std::nullopt;
  const char* const at = buffer_.data() + begin_;
  const std::uint32_t size = read<std::uint32_t>(at);
  if (size < kHeader || size > kMostBytes) {
    broken_ = true;
    buffer_.clear();
    begin_ = 0;
    return std::nullopt;
  }
  if (available < size) return std::nullopt;
  begin_ += size;
  return Packet{static_cast<PacketType>(read<std::uint32_t>(at + 4)), {at + kHeader, size - kHeader}};
}

bool decode_frame(std::string_view body, Frame& frame) {
  frame.has_bodies = false;
  frame.drop_rate = frame.out_of_sync_rate = 0;
  frame.bodies.clear();
  if (body.size() < kFrameHeader) return false;
  frame.timestamp_us = read<std::uint64_t>(body.data());
  frame.number = read<std::uint32_t>(body.data() + 8);
  const std::uint32_t components = read<std::uint32_t>(body.data() + 12);
  bool with_residuals = false;
  std::string_view rest = body.substr(kFrameHeader);
  for (std::uint32_t i = 0; i < components; ++i) {
    if (rest.size() < kComponentHeader) return false;
    const std::uint32_t size = read<std::uint32_t>(rest.data());
    const std::uint32_t type = read<std::uint32_t>(rest.data() + 4);
    if (size < kComponentHeader || size > rest.size()) return false;
    if (type == kType6dRes || (type == kType6d && !with_residuals)) {
      with_residuals = type == kType6dRes;
      if (!read_bodies(rest.substr(0, size), with_residuals ? kBodyRes : kBody, frame)) return false;
    }
    rest.remove_prefix(size);
  }
  return rest.empty();
}

std::string_view decode_text(std::string_view body) { return body.substr(0, body.find('\0')); }

std::optional<Event> decode_event(std::string_view body) {
  if (body.empty()) return std::nullopt;
  const auto code = static_cast<std::uint8_t>(body.front());
  if (code < static_cast<std::uint8_t>(Event::kConnected) ||
      code > static_cast<std::uint8_t>(Event::kTrigger))
    return std::nullopt;
  return static_cast<Event>(code);
}

std::string encode_text(PacketType type, std::string_view text) {
  std::string out = start_packet(type);
  out += text;
  out += '\0';
  return finish(out);
}

std::string encode_event(Event event) {
  std::string out = start_packet(PacketType::kEvent);
  out += static_cast<char>(event);
  return finish(out);
}

std::string encode_no_more_data() { return finish(start_packet(PacketType::kNoMoreData)); }

std::string encode_frame(const Frame& frame, unsigned components) {
  constexpr std::pair<Component, std::uint32_t> kKnown[] = {{kComponent6d, kType6d},
                                                            {kComponent6dEuler, kType6dEuler},
                                                            {kComponent6dRes, kType6dRes},
                                                            {kComponent6dEulerRes, kType6dEulerRes}};
  std::string out = start_packet(PacketType::kData);
  write(out, frame.timestamp_us);
  write(out, frame.number);
  std::uint32_t count = 0;
  for (const auto& [component, type] : kKnown) count += (components & component) != 0 ? 1u : 0u;
  write(out, count);
  for (const auto& [component, type] : kKnown) {
    if ((components & component) != 0) write_bodies(out, frame, type);
  }
  return finish(out);
}

}  // namespace atmos::qtm
