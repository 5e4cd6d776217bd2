// The server's side of one connection: what QTM answers to a client.
#pragma once

#include <cstdint>
#include <string>

#include "atmos_mocap_bridge/qtm/packet.h"
#include "atmos_mocap_bridge/qtm/parameters.h"

namespace atmos::qtm {

struct ServerSettings {
  Parameters parameters;  // frequency_hz included
  int newest_minor;       // of the protocol versions 1.1 to 1.<newest_minor>
};

// Answers Version, QTMVersion, ByteOrder, GetState, GetParameters, GetCurrentFrame and StreamFrames (over
// this connection; 6D, 6DRes, 6DEuler and 6DEulerRes). Commands that need control of QTM are refused as QTM
// refuses them to clients without it. Greets at once.
class Server {
 public:
  explicit Server(const ServerSettings& settings);

  // False: the client breaks the protocol and the connection is to be closed.
  bool receive(const char* data, std::size_t size);
  // A new frame; goes out if the client streams at such a rate or waits for one.
  void add(const Frame& frame);
  void add(Event event);
  bool streaming() const { return streaming_; }
  // What is to be sent; empties it.
  std::string take_output();

 private:
  void answer(const std::string& command);
  void stream(const std::string& rate, unsigned components);
  void say(std::string_view text);
  void complain(std::string_view text);

  ServerSettings settings_;
  PacketParser parser_;
  std::string output_;
  std::string version_ = "1.1";  // until the client asks for another
  Event state_ = Event::kRtFromFileStarted;
  bool streaming_ = false;
  unsigned components_ = 0;         // streamed
  unsigned single_components_ = 0;  // asked for once
  double divisor_ = 1.0;            // every divisor-th frame is streamed
  double due_ = 1.0;                // frames until the next one
};

}  // namespace atmos::qtm
