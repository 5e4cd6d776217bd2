#include "atmos_mocap_bridge/tcp_socket.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <utility>

namespace atmos {

namespace {

bool wait_for(int descriptor, short events, double limit_s) {
  pollfd entry{descriptor, events, 0};
  return poll(&entry, 1, static_cast<int>(std::ceil(1e3 * limit_s))) > 0;
}

bool connected(int descriptor, const addrinfo& address, double limit_s) {
  if (connect(descriptor, address.ai_addr, address.ai_addrlen) == 0) return true;
  if (errno != EINPROGRESS || !wait_for(descriptor, POLLOUT, limit_s)) return false;
  int error = 0;
  socklen_t size = sizeof error;
  return getsockopt(descriptor, SOL_SOCKET, SO_ERROR, &error, &size) == 0 && error == 0;
}

}  // namespace

std::optional<TcpSocket> TcpSocket::connect(const std::string& host, int port, double limit_s) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* addresses = nullptr;
  if (getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &addresses) != 0) return std::nullopt;
  std::optional<TcpSocket> result;
  for (const addrinfo* one = addresses; one != nullptr && !result; one = one->ai_next) {
    const int descriptor =
        socket(one->ai_family, one->ai_socktype | SOCK_NONBLOCK | SOCK_CLOEXEC, one->ai_protocol);
    if (descriptor < 0) continue;
    TcpSocket candidate(descriptor);
    if (connected(descriptor, *one, limit_s)) result = std::move(candidate);
  }
  freeaddrinfo(addresses);
  return result;
}

TcpSocket::TcpSocket(int descriptor) : descriptor_(descriptor) {
  const int on = 1;
  setsockopt(descriptor_, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
}

TcpSocket::TcpSocket(TcpSocket&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}

TcpSocket& TcpSocket::operator=(TcpSocket&& other) noexcept {
  std::swap(descriptor_, other.descriptor_);
  return *this;
}

TcpSocket::~TcpSocket() {
  if (descriptor_ >= 0) close(descriptor_);
}

long TcpSocket::read(char* data, std::size_t size, double limit_s) {
  if (!wait_for(descriptor_, POLLIN, limit_s)) return 0;
  const ssize_t count = recv(descriptor_, data, size, 0);
  if (count > 0) return count;
  return count < 0 && (errno == EAGAIN || errno == EINTR) ? 0 : -1;
}

bool TcpSocket::write(const std::string& data, double limit_s) {
  std::size_t sent = 0;
  while (sent < data.size()) {
    const ssize_t count = send(descriptor_, data.data() + sent, data.size() - sent, MSG_NOSIGNAL);
    if (count > 0) {
      sent += static_cast<std::size_t>(count);
    } else if (errno != EAGAIN || !wait_for(descriptor_, POLLOUT, limit_s)) {
      return false;
    }
  }
  return true;
}

TcpListener::TcpListener(int port)
    : descriptor_(socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)), port_(port) {
  const int on = 1;
  setsockopt(descriptor_, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_ANY);
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  socklen_t size = sizeof address;
  if (bind(descriptor_, reinterpret_cast<sockaddr*>(&address), size) != 0 || listen(descriptor_, 10) != 0) {
    const std::string why = std::strerror(errno);
    close(descriptor_);
    throw std::runtime_error("cannot listen on port " + std::to_string(port) + ": " + why);
  }
  getsockname(descriptor_, reinterpret_cast<sockaddr*>(&address), &size);
  port_ = ntohs(address.sin_port);
}

TcpListener::~TcpListener() { close(descriptor_); }

std::optional<TcpSocket> TcpListener::accept(double limit_s) {
  if (!wait_for(descriptor_, POLLIN, limit_s)) return std::nullopt;
  const int descriptor = accept4(descriptor_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
  if (descriptor < 0) return std::nullopt;
  return TcpSocket(descriptor);
}

}  // namespace atmos
