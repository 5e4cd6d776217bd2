#include "atmos_mocap_bridge/tcp_socket.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace atmos {
namespace {

constexpr double kLimit_s = 5.0;

TEST(TcpSocket, BytesGoBothWays) {
  TcpListener listener(0);
  auto client = TcpSocket::connect("127.0.0.1", listener.port(), kLimit_s);
  ASSERT_TRUE(client);
  auto server = listener.accept(kLimit_s);
  ASSERT_TRUE(server);
  char buffer[16];
  ASSERT_TRUE(client->write("hello", kLimit_s));
  ASSERT_EQ(server->read(buffer, sizeof buffer, kLimit_s), 5);
  EXPECT_EQ(std::string(buffer, 5), "hello");
  EXPECT_EQ(client->read(buffer, sizeof buffer, 0.0), 0) << "nothing was sent";
  ASSERT_TRUE(server->write("x", kLimit_s));
  EXPECT_EQ(client->read(buffer, sizeof buffer, kLimit_s), 1);
}

TEST(TcpSocket, TheEndOfAConnectionIsSeen) {
  TcpListener listener(0);
  auto client = TcpSocket::connect("127.0.0.1", listener.port(), kLimit_s);
  auto server = listener.accept(kLimit_s);
  ASSERT_TRUE(client && server);
  server.reset();
  char byte;
  EXPECT_EQ(client->read(&byte, 1, kLimit_s), -1);
}

TEST(TcpSocket, AReaderThatDoesNotReadEndsTheWriting) {
  TcpListener listener(0);
  auto client = TcpSocket::connect("127.0.0.1", listener.port(), kLimit_s);
  auto server = listener.accept(kLimit_s);
  ASSERT_TRUE(client && server);
  const std::string much(1 << 26, 'x');
  EXPECT_FALSE(server->write(much, 0.01));
}

TEST(TcpSocket, NobodyListens) {
  int port = 0;
  {
    const TcpListener listener(0);
    port = listener.port();
    EXPECT_THROW(TcpListener second(port), std::runtime_error);
  }
  EXPECT_FALSE(TcpSocket::connect("127.0.0.1", port, kLimit_s));
  EXPECT_FALSE(TcpSocket::connect("no.such.host.invalid", port, 0.1));
}

}  // namespace
}  // namespace atmos
