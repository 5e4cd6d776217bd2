// Byte streams to an autopilot: a serial device that may be unplugged at any time, or UDP to a simulator.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace atmos {

struct PortCounters {
  std::uint64_t opened = 0;          // times the device was opened
  std::uint64_t dropped_frames = 0;  // not written because the line did not take them in time
};

// Never blocks and never throws; what fails closes the port, and poll() opens it again.
class Port {
 public:
  static constexpr double kRetry_s = 0.2;
  static constexpr std::size_t kMostPending =
      2048;  // bytes: 22 ms at 921600 baud; older set-points are worthless

  virtual ~Port() = default;
  // Opens a closed port if the last attempt was kRetry_s ago. `time_s`: any clock that runs. True when it has
  // just been opened.
  bool poll(double time_s);
  bool is_open() const { return fd_ >= 0; }
  // Why the last attempt to open failed; empty when open.
  const std::string& fault() const { return fault_; }
  // What has come, at most `size` bytes; 0 when there is nothing.
  virtual std::size_t read(std::uint8_t* buffer, std::size_t size) = 0;
  // Sends a frame as a whole, now or as soon as the line takes it; drops it when too much is waiting.
  virtual void write(const std::uint8_t* data, std::size_t size) = 0;
  const PortCounters& counters() const { return counters_; }

 protected:
  // A file descriptor, or -1 with fault_ set.
  virtual int open() = 0;
  void close();

  int fd_ = -1;
  std::string fault_;
  PortCounters counters_;

 private:
  double attempted_s_ = -1e300;
};

// "udp:LOCAL_PORT" answers whoever speaks first; "udp:LOCAL_PORT:HOST:PORT" speaks first; anything else is
// the path of a serial device, 8N1 at any baud rate. Throws std::invalid_argument naming what is wrong.
std::unique_ptr<Port> make_port(const std::string& device, int baud);

}  // namespace atmos
