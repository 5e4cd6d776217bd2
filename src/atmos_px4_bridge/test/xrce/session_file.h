// The recorded session (session.txt) as data: the messages of both directions, in order.
#pragma once

#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "atmos_px4_bridge/xrce/framing.h"

namespace atmos::xrce::test {

struct Recorded {
  double time_s;
  bool from_client;
  Bytes wire;     // with framing; empty when the file does not have it
  Bytes message;  // without
};

inline Bytes hex(const std::string& text) {
  Bytes bytes;
  std::istringstream in(text);
  for (std::string byte; in >> byte;)
    bytes.push_back(static_cast<std::uint8_t>(std::strtoul(byte.c_str(), nullptr, 16)));
  return bytes;
}

inline std::vector<Recorded> load_session() {
  std::vector<Recorded> session;
  std::ifstream file(XRCE_SESSION);
  for (std::string line; std::getline(file, line);) {
    std::istringstream in(line);
    std::string first, second;
    in >> first >> second;
    if (second == "C>A" || second == "A>C") {
      session.push_back({std::strtod(first.c_str(), nullptr), second == "C>A", {}, {}});
    } else if (first == "wire") {
      session.back().wire = hex(line.substr(line.find("wire") + 4));
    } else if (first == "|") {
      const Bytes more = hex(line.substr(line.find('|') + 1));
      session.back().message.insert(session.back().message.end(), more.begin(), more.end());
    }
  }
  for (Recorded& r : session) {
    Deframer deframer(r.from_client ? kClientAddress : kAgentAddress,
                      r.from_client ? kAgentAddress : kClientAddress);
    for (const std::uint8_t byte : r.wire) {
      const auto message = deframer.push(byte);
      if (message && r.message.empty()) r.message.assign(message->data, message->data + message->size);
    }
  }
  return session;
}

}  // namespace atmos::xrce::test
