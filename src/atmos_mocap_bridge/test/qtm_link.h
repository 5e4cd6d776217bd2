// A session and a server joined in memory, in simulated time.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "atmos_mocap_bridge/qtm/pose.h"
#include "atmos_mocap_bridge/qtm/server.h"
#include "atmos_mocap_bridge/qtm/session.h"

namespace atmos::qtm::test {

inline constexpr double kStart = 1234.5;

inline Frame frame_of(std::size_t bodies, std::uint32_t number, std::uint64_t timestamp_us) {
  Frame frame;
  frame.timestamp_us = timestamp_us;
  frame.number = number;
  for (std::size_t i = 0; i < bodies; ++i)
    frame.bodies.push_back(to_body({0.0,
                                    {static_cast<double>(i), 1e-6 * static_cast<double>(timestamp_us), 0.0},
                                    Eigen::Quaterniond::Identity()}));
  return frame;
}

class Link {
 public:
  explicit Link(const ServerSettings& server, SessionSettings session = {"atmos", 2.0, 8.0})
      : settings(server), session(session, [this](const Frame& frame, const Body& body) {
          received.push_back(
              {frame.number, to_pose_frame(body, 1e-6 * static_cast<double>(frame.timestamp_us))});
        }) {}

  // Lets both sides talk until neither has anything to say; the connection is cut in chunks of `chunk` bytes.
  void talk() {
    while (server) {
      const std::string up = session.take_output(), down = server->take_output();
      if (up.empty() && down.empty()) break;
      for (std::size_t at = 0; at < up.size(); at += chunk) {
        if (!server->receive(up.data() + at, std::min(chunk, up.size() - at))) return disconnect();
      }
      for (std::size_t at = 0; at < down.size(); at += chunk) {
        if (!session.receive(down.data() + at, std::min(chunk, down.size() - at), now)) return disconnect();
      }
    }
  }
  void connect() {
    server = std::make_unique<Server>(settings);
    session.connected(now);
    talk();
  }
  void disconnect() {
    server.reset();
    session.closed(now);
  }
  // What the owner of a socket does at every instant; the server is there or not.
  void step(bool server_runs = true) {
    if (session.wants_connection(now)) {
      if (server_runs)
        connect();
      else
        session.connection_failed(now);
    }
    if (!session.tick(now)) disconnect();
    talk();
  }

  ServerSettings settings;
  std::unique_ptr<Server> server;
  Session session;
  std::size_t chunk = 1 << 16;
  double now = kStart;
  struct Received {
    std::uint32_t number;
    PoseFrame pose;
  };
  std::vector<Received> received;
};

inline ServerSettings two_bodies() { return {{100.0, {{"wall", true}, {"atmos", true}}}, kNewestMinor}; }

}  // namespace atmos::qtm::test
