// Packets of the QTM real-time protocol, little-endian port (Qualisys, "QTM Real-time Server Protocol
// Documentation", versions 1.18 to 1.28: their 6DOF packets are the same).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace atmos::qtm {

enum class PacketType : std::uint32_t {
  kError = 0,
  kCommand = 1,
  kXml = 2,
  kData = 3,
  kNoMoreData = 4,
  kC3dFile = 5,
  kEvent = 6,
  kDiscover = 7,
  kQtmFile = 8,
};

enum class Event : std::uint8_t {
  kConnected = 1,
  kConnectionClosed = 2,
  kCaptureStarted = 3,
  kCaptureStopped = 4,
  kCaptureFetchingFinished = 5,
  kCalibrationStarted = 6,
  kCalibrationStopped = 7,
  kRtFromFileStarted = 8,
  kRtFromFileStopped = 9,
  kWaitingForTrigger = 10,
  kCameraSettingsChanged = 11,
  kShuttingDown = 12,
  kCaptureSaved = 13,
  kReprocessingStarted = 14,
  kReprocessingStopped = 15,
  kTrigger = 16,
};

// One packet without its header. `body` lives until the parser is used again.
struct Packet {
  PacketType type;
  std::string_view body;
};

// Cuts a byte stream into packets. A size that no packet can have breaks the stream for good: nothing after
// it can be trusted.
class PacketParser {
 public:
  // Longest packet that is taken, header included; the largest expected are the parameters (XML).
  static constexpr std::size_t kMostBytes = 1 << 20;

  void add(const char* data, std::size_t size);
  // The next complete packet; nothing when more bytes are needed or the stream is broken.
  std::optional<Packet> next();
  bool broken() const { return broken_; }
  std::size_t memory() const { return buffer_.capacity(); }

 private:
  std::vector<char> buffer_;
  std::size_t begin_ = 0;  // of what is not yet consumed
  bool broken_ = false;
};

// Components of data packets that carry bodies; a set of them is a bit mask.
enum Component : unsigned {
  kComponent6d = 1u << 5,
  kComponent6dEuler = 1u << 6,
  kComponent6dRes = 1u << 11,
  kComponent6dEulerRes = 1u << 12,
};

// A rigid body in QTM's frame; not-a-number where QTM does not see it.
struct Body {
  std::array<float, 3> position_mm;
  std::array<float, 9> rotation;                                // body to QTM's frame, column by column
  float residual_mm = std::numeric_limits<float>::quiet_NaN();  // only in 6DRes
};

struct Frame {
  std::uint64_t timestamp_us = 0;  // server's clock
  std::uint32_t number = 0;
  std::uint16_t drop_rate = 0, out_of_sync_rate = 0;  // of the cameras' 2D data
  bool has_bodies = false;                            // the packet had a 6D or 6DRes component
  std::vector<Body> bodies;                           // in the order of the 6D parameters
};

// Reads a data packet's 6DRes, else 6D component and passes over all others; false: malformed. Reuses the
// memory of `frame`.
bool decode_frame(std::string_view body, Frame& frame);
// The text of an error, command or XML packet, without what follows the terminating zero.
std::string_view decode_text(std::string_view body);
std::optional<Event> decode_event(std::string_view body);

std::string encode_text(PacketType type, std::string_view text);
std::string encode_event(Event event);
std::string encode_no_more_data();
// Data packet with each of the components asked for (6D, 6DRes; Euler angles are roll, pitch, yaw).
std::string encode_frame(const Frame& frame, unsigned components);

}  // namespace atmos::qtm
