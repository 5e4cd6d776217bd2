// The client's side of one connection after another to a QTM server.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <string>

#include "atmos_mocap_bridge/qtm/packet.h"
#include "atmos_mocap_bridge/qtm/parameters.h"

namespace atmos::qtm {

// Protocol versions, newest first by minor number.
inline constexpr int kNewestMinor = 28, kOldestMinor = 18;

struct SessionSettings {
  std::string body;   // whose pose is wanted
  double silence_s;   // > 0; after so long without a byte the server is asked, after twice as long given up
  double max_wait_s;  // > 0; longest pause between attempts to connect
};

// welcome -> version -> parameters -> stream, told by its owner what the socket does and what time it is; it
// owns neither. Asks for the newest version that the server takes, for the parameters again whenever the
// frames do not fit them, and hangs up on a server that is silent, breaks the protocol or shuts down.
// Attempts to connect wait 0.5 s, 1 s, 2 s, ... up to max_wait_s; frames reset the pause.
class Session {
 public:
  enum class State { kOffline, kWelcome, kVersion, kParameters, kStreaming };
  struct Counters {
    std::uint64_t connections = 0;
    std::uint64_t frames = 0;        // delivered, seen or not
    std::uint64_t unseen = 0;        // of these
    std::uint64_t skipped = 0;       // numbers missing between frames of one connection
    std::uint64_t malformed = 0;     // data, event or XML packets that cannot be read
    std::uint64_t without_body = 0;  // frames in which the body has no place
    std::uint64_t errors = 0;        // error packets
    std::uint64_t hang_ups = 0;      // connections that were ended from this side
  };
  // `body` is not-a-number in its elements where QTM does not see it.
  using FrameHandler = std::function<void(const Frame& frame, const Body& body)>;

  Session(const SessionSettings& settings, FrameHandler on_frame);

  // Whether it is time to try to connect.
  bool wants_connection(double now_s) const { return state_ == State::kOffline && now_s >= next_attempt_; }
  void connected(double now_s);
  void connection_failed(double now_s);
  void closed(double now_s);  // by the server, or by the owner because receive() or tick() said so
  // Both return false when the owner is to close the connection and say closed().
  bool receive(const char* data, std::size_t size, double now_s);
  bool tick(double now_s);
  // What is to be sent; empties it.
  std::string take_output();

  State state() const { return state_; }
  const Counters& counters() const { return counters_; }
  // Of the protocol, e.g. "1.28"; empty before it is agreed on.
  std::string version() const;
  const Parameters& parameters() const { return parameters_; }
  // The newest frame had a place for the body.
  bool body_known() const { return body_known_; }
  // What the server last complained about, or why the connection ended.
  const std::string& last_problem() const { return last_problem_; }
  std::size_t memory() const { return parser_.memory(); }

 private:
  bool handle(const Packet& packet, double now_s);
  bool handle_text(std::string_view text, bool error, double now_s);
  bool handle_event(Event event, double now_s);
  void handle_parameters(std::string_view xml);
  void handle_data(std::string_view body, double now_s);
  void send(const std::string& command);
  void ask_version();
  void ask_parameters(double now_s);
  bool hang_up(const std::string& why);
  void go_offline(double now_s);

  SessionSettings settings_;
  FrameHandler on_frame_;
  State state_ = State::kOffline;
  PacketParser parser_;
  std::string output_;
  Parameters parameters_;
  Frame frame_;
  Counters counters_;
  std::string last_problem_;
  int minor_ = 0;  // version asked for or agreed on
  bool version_agreed_ = false;
  bool body_known_ = false;
  bool first_frame_ = true;
  std::uint32_t last_number_ = 0;
  double last_heard_ = 0.0;  // or asked
  bool asked_state_ = false;
  double parameters_asked_ = -std::numeric_limits<double>::infinity();
  double next_attempt_ = -std::numeric_limits<double>::infinity();
  double wait_;
};

}  // namespace atmos::qtm
