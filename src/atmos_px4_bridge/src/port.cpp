#include "atmos_px4_bridge/port.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <optional>
#include <sstream>
#include <stdexcept>

#include "serial_line.h"

namespace atmos {

namespace {

class SerialPort : public Port {
 public:
  SerialPort(std::string path, int baud) : path_(std::move(path)), baud_(baud) {}
  ~SerialPort() override { close(); }

  std::size_t read(std::uint8_t* buffer, std::size_t size) override {
    flush();
    if (fd_ < 0) return 0;
    const ssize_t got = ::read(fd_, buffer, size);
    if (got > 0) return static_cast<std::size_t>(got);
    // A raw terminal without data says EAGAIN; an end of file or an error means that the device has gone.
    if (got == 0 || (errno != EAGAIN && errno != EINTR))
      lost(got == 0 ? "the device has gone" : std::strerror(errno));
    return 0;
  }

  void write(const std::uint8_t* data, std::size_t size) override {
    if (fd_ < 0) return;
    flush();
    if (pending_.size() + size > kMostPending) {
      ++counters_.dropped_frames;
      return;
    }
    pending_.insert(pending_.end(), data, data + size);
    flush();
  }

 private:
  int open() override {
    pending_.clear();
    const int fd = ::open(path_.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (fd < 0) {
      fault_ = path_ + ": " + std::strerror(errno);
      return -1;
    }
    if (!set_raw(fd, baud_)) {
      fault_ = path_ + ": " + std::strerror(errno);
      ::close(fd);
      return -1;
    }
    discard_input(fd);
    return fd;
  }

  void flush() {
    while (fd_ >= 0 && !pending_.empty()) {
      const ssize_t sent = ::write(fd_, pending_.data(), pending_.size());
      if (sent > 0) {
        pending_.erase(pending_.begin(), pending_.begin() + sent);
      } else if (errno == EAGAIN || errno == EINTR) {
        return;
      } else {
        lost(std::strerror(errno));
      }
    }
  }

  void lost(const std::string& why) {
    fault_ = path_ + ": " + why;
    close();
  }

  std::string path_;
  int baud_;
  std::vector<std::uint8_t> pending_;
};

class UdpPort : public Port {
 public:
  UdpPort(std::uint16_t local, std::optional<sockaddr_in> remote) : local_(local), remote_(remote) {}
  ~UdpPort() override { close(); }

  std::size_t read(std::uint8_t* buffer, std::size_t size) override {
    if (fd_ < 0) return 0;
    sockaddr_in from{};
    socklen_t length = sizeof(from);
    const ssize_t got = ::recvfrom(fd_, buffer, size, 0, reinterpret_cast<sockaddr*>(&from), &length);
    if (got <= 0) return 0;
    remote_ = from;
    return static_cast<std::size_t>(got);
  }

  void write(const std::uint8_t* data, std::size_t size) override {
    if (fd_ < 0 || !remote_) return;
    if (::sendto(fd_, data, size, 0, reinterpret_cast<const sockaddr*>(&*remote_), sizeof(*remote_)) < 0)
      ++counters_.dropped_frames;
  }

 private:
  int open() override {
    const int fd = ::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(local_);
    address.sin_addr.s_addr = htonl(INADDR_ANY);
    if (fd >= 0 && ::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0) return fd;
    fault_ = "UDP port " + std::to_string(local_) + ": " + std::strerror(errno);
    if (fd >= 0) ::close(fd);
    return -1;
  }

  std::uint16_t local_;
  std::optional<sockaddr_in> remote_;
};

std::uint16_t port_number(const std::string& device, const std::string& text) {
  std::istringstream in(text);
  int number = 0;
  if (!(in >> number) || !in.eof() || number < 1 || number > 65535)
    throw std::invalid_argument("device '" + device + "': '" + text + "' is no port number");
  return static_cast<std::uint16_t>(number);
}

}  // namespace

bool Port::poll(double time_s) {
  if (fd_ >= 0 || (time_s - attempted_s_ < kRetry_s && time_s >= attempted_s_)) return false;
  attempted_s_ = time_s;
  fd_ = open();
  if (fd_ < 0) return false;
  fault_.clear();
  ++counters_.opened;
  return true;
}

void Port::close() {
  if (fd_ >= 0) ::close(fd_);
  fd_ = -1;
}

std::unique_ptr<Port> make_port(const std::string& device, int baud) {
  if (device.empty()) throw std::invalid_argument("device: must be a path or udp:PORT");
  if (device.rfind("udp:", 0) != 0) {
    if (baud < 1) throw std::invalid_argument("baud: must be > 0");
    return std::make_unique<SerialPort>(device, baud);
  }
  std::vector<std::string> parts;
  std::istringstream in(device.substr(4));
  for (std::string part; std::getline(in, part, ':');) parts.push_back(part);
  if (parts.size() != 1 && parts.size() != 3)
    throw std::invalid_argument("device '" + device + "': must be udp:PORT or udp:PORT:HOST:PORT");
  std::optional<sockaddr_in> remote;
  if (parts.size() == 3) {
    remote.emplace();
    remote->sin_family = AF_INET;
    remote->sin_port = htons(port_number(device, parts[2]));
    if (::inet_pton(AF_INET, parts[1].c_str(), &remote->sin_addr) != 1)
      throw std::invalid_argument("device '" + device + "': '" + parts[1] + "' is no IPv4 address");
  }
  return std::make_unique<UdpPort>(port_number(device, parts[0]), remote);
}

}  // namespace atmos
