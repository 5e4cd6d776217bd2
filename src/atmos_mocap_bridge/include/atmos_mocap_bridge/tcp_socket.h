// A TCP connection and a listening port, thin over POSIX. Neither blocks longer than it is told to.
#pragma once

#include <cstddef>
#include <optional>
#include <string>

namespace atmos {

class TcpSocket {
 public:
  // Nothing when there is no such host, nobody listens or the time is over. Nagle's algorithm is off.
  static std::optional<TcpSocket> connect(const std::string& host, int port, double limit_s);

  explicit TcpSocket(int descriptor);
  TcpSocket(TcpSocket&& other) noexcept;
  TcpSocket& operator=(TcpSocket&& other) noexcept;
  ~TcpSocket();

  // Waits up to `limit_s` for bytes; 0: none came, -1: the connection is over.
  long read(char* data, std::size_t size, double limit_s);
  // False: the connection is over, or the other side did not take all within `limit_s`.
  bool write(const std::string& data, double limit_s);

 private:
  int descriptor_;
};

class TcpListener {
 public:
  // Port 0: any free one. Throws std::runtime_error when the port is taken.
  explicit TcpListener(int port);
  TcpListener(const TcpListener&) = delete;
  TcpListener& operator=(const TcpListener&) = delete;
  ~TcpListener();

  int port() const { return port_; }
  std::optional<TcpSocket> accept(double limit_s);

 private:
  int descriptor_;
  int port_;
};

}  // namespace atmos
