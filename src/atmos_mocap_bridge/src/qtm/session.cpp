#include "atmos_mocap_bridge/qtm/session.h"

#include <strings.h>

#include <algorithm>
#include <utility>

namespace atmos::qtm {

namespace {

constexpr double kFirstWait_s = 0.5;
constexpr double kAskAgain_s = 1.0;  // for parameters

bool starts_with(std::string_view text, std::string_view beginning) {
  return text.size() >= beginning.size() && strncasecmp(text.data(), beginning.data(), beginning.size()) == 0;
}

}  // namespace

Session::Session(const SessionSettings& settings, FrameHandler on_frame)
    : settings_(settings),
      on_frame_(std::move(on_frame)),
      wait_(std::min(kFirstWait_s, settings.max_wait_s)) {}

std::string Session::version() const { return version_agreed_ ? "1." + std::to_string(minor_) : ""; }

std::string Session::take_output() { return std::exchange(output_, {}); }

void Session::connected(double now_s) {
  ++counters_.connections;
  state_ = State::kWelcome;
  parser_ = PacketParser();
  output_.clear();
  version_agreed_ = body_known_ = asked_state_ = false;
  first_frame_ = true;
  last_heard_ = now_s;
}

void Session::connection_failed(double now_s) {
  last_problem_ = "cannot connect";
  go_offline(now_s);
}

void Session::closed(double now_s) {
  if (state_ == State::kOffline) return;
  if (last_problem_.empty()) last_problem_ = "the server closed the connection";
  go_offline(now_s);
}

void Session::go_offline(double now_s) {
  state_ = State::kOffline;
  output_.clear();
  next_attempt_ = now_s + wait_;
  wait_ = std::min(2.0 * wait_, settings_.max_wait_s);
}

bool Session::hang_up(const std::string& why) {
  ++counters_.hang_ups;
  last_problem_ = why;
  return false;
}

void Session::send(const std::string& command) { output_ += encode_text(PacketType::kCommand, command); }

void Session::ask_version() {
  state_ = State::kVersion;
  send("Version 1." + std::to_string(minor_));
}

void Session::ask_parameters(double now_s) {
  parameters_asked_ = now_s;
  send("GetParameters General 6D");
}

bool Session::tick(double now_s) {
  if (state_ == State::kOffline) return true;
  if (now_s - last_heard_ > settings_.silence_s) {
    if (asked_state_ || state_ != State::kStreaming) return hang_up("the server is silent");
    // Without a measurement QTM has nothing to stream; this it always answers.
    asked_state_ = true;
    last_heard_ = now_s;
    send("GetState");
  }
  if (state_ == State::kParameters && now_s - parameters_asked_ > kAskAgain_s) ask_parameters(now_s);
  return true;
}

bool Session::receive(const char* data, std::size_t size, double now_s) {
  if (state_ == State::kOffline) return true;
  if (size > 0) {
    last_heard_ = now_s;
    asked_state_ = false;
  }
  parser_.add(data, size);
  while (const auto packet = parser_.next()) {
    if (!handle(*packet, now_s)) return false;
  }
  if (parser_.broken()) return hang_up("the server sent what is no packet");
  return true;
}

bool Session::handle(const Packet& packet, double now_s) {
  switch (packet.type) {
    case PacketType::kError:
      ++counters_.errors;
      return handle_text(decode_text(packet.body), true, now_s);
    case PacketType::kCommand:
      return handle_text(decode_text(packet.body), false, now_s);
    case PacketType::kXml:
      handle_parameters(decode_text(packet.body));
      return true;
    case PacketType::kData:
      handle_data(packet.body, now_s);
      return true;
    case PacketType::kEvent:
      if (const auto event = decode_event(packet.body)) return handle_event(*event, now_s);
      ++counters_.malformed;
      return true;
    case PacketType::kNoMoreData:  // no measurement is running
    case PacketType::kC3dFile:
    case PacketType::kDiscover:
    case PacketType::kQtmFile:
      return true;
  }
  ++counters_.malformed;
  return true;
}

bool Session::handle_text(std::string_view text, bool error, double now_s) {
  if (error) last_problem_ = "the server says: " + std::string(text);
  switch (state_) {
    case State::kWelcome:
      if (error) return hang_up(last_problem_);
      if (!starts_with(text, "QTM RT Interface")) return hang_up("the server is no QTM");
      minor_ = kNewestMinor;
      ask_version();
      return true;
    case State::kVersion:
      if (!error && starts_with(text, "Version set to")) {
        version_agreed_ = true;
        state_ = State::kParameters;
        ask_parameters(now_s);
        return true;
      }
      if (minor_ == kOldestMinor) return hang_up("the server knows no protocol version from 1.18 to 1.28");
      --minor_;
      ask_version();
      return true;
    case State::kOffline:
    case State::kParameters:  // "Parameters not available": asked again later
    case State::kStreaming:
      return true;
  }
  return true;
}

bool Session::handle_event(Event event, double now_s) {
  switch (event) {
    case Event::kShuttingDown:
      return hang_up("QTM shuts down");
    case Event::kConnected:
    case Event::kCaptureStarted:
    case Event::kRtFromFileStarted:
      // Another measurement may have other bodies.
      if (state_ == State::kStreaming) ask_parameters(now_s);
      return true;
    default:
      return true;
  }
}

void Session::handle_parameters(std::string_view xml) {
  const auto parameters = parse_parameters(xml);
  if (!parameters) {
    ++counters_.malformed;
    return;
  }
  parameters_ = *parameters;
  if (state_ != State::kParameters) return;
  state_ = State::kStreaming;
  last_problem_.clear();
  send("StreamFrames AllFrames 6DRes");
}

void Session::handle_data(std::string_view body, double now_s) {
  if (state_ != State::kStreaming) return;
  if (!decode_frame(body, frame_)) {
    ++counters_.malformed;
    return;
  }
  if (!frame_.has_bodies) return;
  if (!first_frame_ && frame_.number > last_number_ + 1)
    counters_.skipped += frame_.number - last_number_ - 1;
  first_frame_ = false;
  last_number_ = frame_.number;
  const auto index = index_of(parameters_, settings_.body, frame_.bodies.size());
  body_known_ = index.has_value();
  if (!index) {
    ++counters_.without_body;
    if (now_s - parameters_asked_ > kAskAgain_s) ask_parameters(now_s);
    return;
  }
  ++counters_.frames;
  wait_ = std::min(kFirstWait_s, settings_.max_wait_s);
  const Body& found = frame_.bodies[*index];
  if (found.position_mm[0] != found.position_mm[0]) ++counters_.unseen;
  on_frame_(frame_, found);
}

}  // namespace atmos::qtm
