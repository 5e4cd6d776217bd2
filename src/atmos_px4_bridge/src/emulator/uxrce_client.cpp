#include "atmos_px4_bridge/emulator/uxrce_client.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace atmos {

namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr std::uint8_t kOutside = 0x80, kInside = 0x81;
constexpr double kAnswer_s = 1.0, kPause_s = 0.01, kHeartbeat_s = 0.1, kMostTrip_s = 0.01;
constexpr int kOpenings = 10, kMissedPings = 3;
constexpr std::size_t kWindow = 4, kMostMessage = 512;

std::uint16_t checksum(const Bytes& message) {
  std::uint16_t sum = 0;
  for (const std::uint8_t byte : message) {
    sum ^= byte;
    for (int k = 0; k < 8; ++k)
      sum = static_cast<std::uint16_t>((sum & 1) != 0 ? (sum >> 1) ^ 0xA001 : sum >> 1);
  }
  return sum;
}

void le16(Bytes& out, unsigned v) {
  out.push_back(static_cast<std::uint8_t>(v));
  out.push_back(static_cast<std::uint8_t>(v >> 8));
}
void be16(Bytes& out, unsigned v) {
  out.push_back(static_cast<std::uint8_t>(v >> 8));
  out.push_back(static_cast<std::uint8_t>(v));
}
void le32(Bytes& out, std::uint32_t v) {
  le16(out, v & 0xFFFF);
  le16(out, v >> 16);
}
void align4(Bytes& out) {
  while (out.size() % 4 != 0) out.push_back(0x66);  // the real client's padding is not initialised either
}
std::uint16_t get16(const std::uint8_t* p) { return static_cast<std::uint16_t>(p[0] | p[1] << 8); }
std::uint16_t get_be16(const std::uint8_t* p) { return static_cast<std::uint16_t>(p[0] << 8 | p[1]); }
std::uint32_t get32(const std::uint8_t* p) {
  return get16(p) | static_cast<std::uint32_t>(get16(p + 2)) << 16;
}

Bytes header(unsigned session, unsigned stream, unsigned sequence) {
  Bytes out{static_cast<std::uint8_t>(session), static_cast<std::uint8_t>(stream)};
  le16(out, sequence);
  return out;
}

// Submessages begin on multiples of four; `out` holds submessages only, and so does a message behind its
// header.
void submessage(Bytes& out, unsigned id, unsigned flags, const Bytes& payload) {
  align4(out);
  out.push_back(static_cast<std::uint8_t>(id));
  out.push_back(static_cast<std::uint8_t>(flags));
  le16(out, static_cast<unsigned>(payload.size()));
  out.insert(out.end(), payload.begin(), payload.end());
}

void text(Bytes& out, const std::string& value) {
  align4(out);
  le32(out, static_cast<std::uint32_t>(value.size() + 1));
  out.insert(out.end(), value.begin(), value.end());
  out.push_back(0);
}

Bytes message_of(Bytes head, const Bytes& submessages) {
  head.insert(head.end(), submessages.begin(), submessages.end());
  return head;
}

}  // namespace

UxrceClient::UxrceClient(Config config, Write write, Deliver deliver)
    : config_(std::move(config)),
      write_(std::move(write)),
      deliver_(std::move(deliver)),
      alive_(config_.readers.size(), false) {}

int UxrceClient::readers_alive() const {
  return static_cast<int>(std::count(alive_.begin(), alive_.end(), true));
}

void UxrceClient::send_frame(const Bytes& message) {
  Bytes body{1, 0};
  le16(body, static_cast<unsigned>(message.size()));
  body.insert(body.end(), message.begin(), message.end());
  le16(body, checksum(message));
  Bytes line{0x7E};
  for (const std::uint8_t byte : body) {
    if (byte == 0x7E || byte == 0x7D) {
      line.push_back(0x7D);
      line.push_back(static_cast<std::uint8_t>(byte ^ 0x20));
    } else {
      line.push_back(byte);
    }
  }
  write_(line.data(), line.size());
}

void UxrceClient::receive(const std::uint8_t* data, std::size_t size, double clock_s) {
  now_s_ = clock_s;
  for (std::size_t i = 0; i < size; ++i) on_byte(data[i], clock_s);
}

void UxrceClient::on_byte(std::uint8_t byte, double clock_s) {
  if (byte == 0x7E) {
    raw_.clear();
    in_frame_ = true;
    escape_ = false;
    return;
  }
  if (!in_frame_) return;
  if (byte == 0x7D) {
    escape_ = true;
    return;
  }
  raw_.push_back(escape_ ? static_cast<std::uint8_t>(byte ^ 0x20) : byte);
  escape_ = false;
  if (raw_.size() < 4) return;
  const std::size_t length = get16(raw_.data() + 2);
  if (length > kMostMessage) {
    in_frame_ = false;
    return;
  }
  if (raw_.size() < length + 6) return;
  in_frame_ = false;
  const Bytes message(raw_.begin() + 4, raw_.begin() + 4 + static_cast<long>(length));
  if (raw_[0] != 0 || raw_[1] != 1 || checksum(message) != get16(raw_.data() + 4 + length)) return;
  on_message(message, clock_s);
}

void UxrceClient::on_message(const Bytes& message, double clock_s) {
  if (message.size() < 8) return;
  inbound_s_ = clock_s;
  const std::uint8_t session = message[0], stream = message[1];
  const std::uint16_t sequence = get16(message.data() + 2);
  if (phase_ == Phase::kPing || phase_ == Phase::kOpening || stream == 0) return read(message, clock_s);
  if (session != kInside) return;
  if (stream >= 0x80) return on_reliable(message, sequence, clock_s);
  const auto ahead = static_cast<std::uint16_t>(sequence - best_effort_in_.value_or(0xFFFF));
  if (ahead == 0 || ahead >= 0x8000) return;
  best_effort_in_ = sequence;
  read(message, clock_s);
}

void UxrceClient::on_reliable(const Bytes& message, std::uint16_t sequence, double clock_s) {
  const auto ahead = static_cast<std::uint16_t>(sequence - in_);
  if (ahead < kWindow) early_[sequence] = message;
  bool taken = false;
  for (auto next = early_.find(in_); next != early_.end(); next = early_.find(in_)) {
    const Bytes current = next->second;
    early_.erase(next);
    ++in_;
    taken = true;
    send_acknack(static_cast<std::uint16_t>(in_ - 1));
    read(current, clock_s);
    if (phase_ == Phase::kPing) return;
  }
  if (!taken) send_acknack(sequence);
}

// What is missing up to the last number that is known to exist.
void UxrceClient::send_acknack(std::uint16_t last_announced) {
  unsigned bits = 0;
  for (unsigned i = 0; i < kWindow; ++i) {
    const auto number = static_cast<std::uint16_t>(in_ + i);
    const auto left = static_cast<std::uint16_t>(last_announced - number);
    if (left < 0x8000 && early_.count(number) == 0) bits |= 1u << i;
  }
  Bytes payload;
  le16(payload, in_);
  be16(payload, bits);
  payload.push_back(0x80);
  Bytes body;
  submessage(body, 10, 1, payload);
  send_frame(message_of(header(kInside, 0, 0), body));
}

void UxrceClient::read(const Bytes& message, double clock_s) {
  const std::uint8_t session = message[0];
  std::size_t at = 4;
  while (at + 4 <= message.size()) {
    const unsigned id = message[at];
    const std::size_t length = get16(message.data() + at + 2);
    const std::uint8_t* const payload = message.data() + at + 4;
    if (at + 4 + length > message.size()) return;
    switch (id) {
      case 4:  // STATUS_AGENT
        if (phase_ == Phase::kOpening && session == kInside && length >= 11 && payload[0] == 0)
          begin_creating();
        break;
      case 5:  // STATUS; on stream 0 it would answer a DELETE
        if (message[1] != 0 && length >= 6) on_status(payload);
        break;
      case 6:  // INFO
        if (length < 8) break;
        if (phase_ == Phase::kPing && session == kOutside) {
          phase_ = Phase::kOpening;
          attempts_ = 0;
          due_s_ = clock_s;
        } else if (session == kInside && payload[5] != 0) {
          pinged_s_.reset();
          missed_pings_ = 0;
        }
        break;
      case 9:  // DATA
        if (length >= 4) on_data(payload, length);
        break;
      case 10:
        if (length >= 5 && payload[4] == 0x80) on_acknack(get16(payload), get_be16(payload + 2));
        break;
      case 11:
        if (length >= 5 && payload[4] == 0x80) send_acknack(get16(payload + 2));
        break;
      case 15:
        if (length >= 24) on_time_reply(payload, clock_s);
        break;
      default:
        return;
    }
    at = (at + 4 + length + 3) / 4 * 4;
  }
}

// Moving on means to forget as many slots as the number has moved, whichever way it moved.
void UxrceClient::on_acknack(std::uint16_t first, unsigned bits) {
  const auto moved = static_cast<std::uint16_t>(first - out_acknowledged_);
  if (moved >= 0x8000) destroyed_ = true;
  const std::size_t forgotten = std::min<std::size_t>(moved, unacknowledged_.size());
  unacknowledged_.erase(unacknowledged_.begin(), unacknowledged_.begin() + static_cast<long>(forgotten));
  out_acknowledged_ = first;
  if (bits == 0) return;
  for (const auto& [sequence, message] : unacknowledged_) send_frame(message);
}

void UxrceClient::on_status(const std::uint8_t* payload) {
  if (!group_) return;
  const std::uint16_t request = get_be16(payload);
  if (payload[4] > 1) return;  // refused: waited for in vain
  auto& requests = group_->requests;
  requests.erase(std::remove(requests.begin(), requests.end(), request), requests.end());
  if (group_->sent && requests.empty()) next_step(now_s_);
}

void UxrceClient::on_data(const std::uint8_t* payload, std::size_t size) {
  // Callbacks are installed behind the last reader.
  const unsigned object = get_be16(payload + 2), number = object >> 4;
  if ((phase_ != Phase::kClock && phase_ != Phase::kRunning) || (object & 0xF) != 6 || number < 0x800 ||
      number - 0x800 >= config_.readers.size() || !alive_[number - 0x800])
    return;
  data_s_ = now_s_;
  ++samples_;
  deliver_(config_.readers[number - 0x800].name, payload + 4, size - 4);
}

void UxrceClient::on_time_reply(const std::uint8_t* payload, double clock_s) {
  const auto seconds = [](const std::uint8_t* p) {
    return static_cast<std::int32_t>(get32(p)) + get32(p + 4) * 1e-9;
  };
  const double transmit = seconds(payload), originate = seconds(payload + 16);
  if (!asked_s_ || std::abs(originate - *asked_s_) > 1e-6 || transmit <= 0.0) return;
  asked_s_.reset();
  next_ask_s_ = clock_s + (phase_ == Phase::kClock ? kPause_s : 1.0);
  round_trip_s_ = clock_s - originate;
  if (round_trip_s_ >= kMostTrip_s) return;
  const double offset = transmit - 0.5 * (clock_s + originate);
  ++exchanges_;
  offset_s_ += (offset - offset_s_) / std::min(exchanges_, 100);
  if (phase_ == Phase::kClock && exchanges_ >= config_.clock_exchanges) {
    phase_ = Phase::kRunning;
    data_s_ = clock_s;
  }
}

void UxrceClient::ask_time(double clock_s) {
  asked_s_ = std::floor(clock_s * 1e6) * 1e-6;
  Bytes payload;
  const auto microseconds = static_cast<std::uint64_t>(std::llround(*asked_s_ * 1e6));
  le32(payload, static_cast<std::uint32_t>(microseconds / 1000000));
  le32(payload, static_cast<std::uint32_t>(microseconds % 1000000 * 1000));
  Bytes body;
  submessage(body, 14, 1, payload);
  send_frame(message_of(header(kInside, 0, 0), body));
  next_ask_s_ = clock_s + (phase_ == Phase::kClock ? kAnswer_s : kPause_s);
}

void UxrceClient::send_ping(std::uint8_t session) {
  Bytes payload;
  be16(payload, 10);
  be16(payload, 0xFFFD);
  le32(payload, 2);
  Bytes body;
  submessage(body, 2, 1, payload);
  send_frame(message_of(header(session, 0, 0), body));
}

// --- entities ---

void UxrceClient::begin_creating() {
  phase_ = Phase::kCreating;
  ++sessions_;
  request_ = 10;
  step_ = 0;
  std::fill(alive_.begin(), alive_.end(), false);
  pending_read_.clear();
  out_ = out_acknowledged_ = in_ = best_effort_out_ = 0;
  unacknowledged_.clear();
  early_.clear();
  best_effort_in_.reset();
  writers_.clear();
  exchanges_ = 0;
  asked_s_.reset();
  pinged_s_.reset();
  missed_pings_ = 0;
  destroyed_ = false;

  group_.emplace();
  Bytes name;
  const std::string xml =
      "<dds><participant><rtps><name>/px4_micro_xrce_dds</name></rtps></participant></dds>";
  group_->requests.push_back(request_);
  Bytes payload;
  be16(payload, request_++);
  be16(payload, 0x0011);
  payload.push_back(1), payload.push_back(2);
  text(payload, xml);
  payload.push_back(0), payload.push_back(0), payload.push_back(0);
  submessage(group_->submessages, 1, 5, payload);
  advance_groups(now_s_);
}

void UxrceClient::add_create(Bytes& out, unsigned number, unsigned kind, const Bytes& representation,
                             unsigned parent) {
  Bytes payload;
  be16(payload, request_++);
  be16(payload, number << 4 | kind);
  payload.push_back(static_cast<std::uint8_t>(kind)), payload.push_back(3);
  align4(payload);
  le32(payload, static_cast<std::uint32_t>(representation.size()));
  payload.insert(payload.end(), representation.begin(), representation.end());
  be16(payload, parent);
  submessage(out, 1, 5, payload);
}

void UxrceClient::add_read(Bytes& out, unsigned number, unsigned kind, unsigned stream) {
  Bytes payload;
  be16(payload, request_++);
  be16(payload, number << 4 | kind);
  for (const unsigned byte : {stream, 0u, 0u, 1u}) payload.push_back(static_cast<std::uint8_t>(byte));
  for (const unsigned value : {0xFFFFu, 0u, 0u, 0u}) le16(payload, value);
  submessage(out, 8, 1, payload);
}

UxrceClient::Group UxrceClient::topic_group(const Topic& topic, unsigned number, bool reader,
                                            int read_before) {
  Group group;
  if (read_before >= 0) add_read(group.submessages, static_cast<unsigned>(read_before), 6, 1);
  Bytes representation;
  text(representation, std::string("rt/fmu/") + (reader ? "in/" : "out/") + topic.name);
  representation.push_back(0), representation.push_back(1);
  text(representation, std::string("px4_msgs::msg::dds_::") + topic.type + "_");
  for (unsigned k = 0; k < 3; ++k) group.requests.push_back(static_cast<std::uint16_t>(request_ + k));
  add_create(group.submessages, number, 2, representation, 0x0011);
  add_create(group.submessages, number, reader ? 4 : 3, {0, 0}, 0x0011);
  Bytes end;
  be16(end, number << 4 | 2);
  end.push_back(1), end.push_back(0);
  le16(end, reader ? 0x0002 : 0x000A);
  if (reader) {
    end.push_back(1), end.push_back(0);
    le16(end, 2);
    end.resize(end.size() + 5, 0);
  } else {
    end.resize(end.size() + 5, 0);
  }
  add_create(group.submessages, number, reader ? 6 : 5, end, number << 4 | (reader ? 4u : 3u));
  return group;
}

// Sends the group when there is room, and gives it up after a second.
void UxrceClient::advance_groups(double clock_s) {
  if (!group_) return;
  if (!group_->sent) {
    if (unacknowledged_.size() >= kWindow) {
      if (group_->sent_s == 0.0) group_->sent_s = clock_s;
      if (clock_s > group_->sent_s + kAnswer_s) next_step(clock_s);
      return;
    }
    const Bytes message = message_of(header(kInside, 0x80, out_), group_->submessages);
    unacknowledged_.emplace_back(out_++, message);
    group_->sent = true;
    group_->sent_s = clock_s;
    heartbeat_s_ = clock_s;
    send_frame(message);
    return;
  }
  if (clock_s > group_->sent_s + kAnswer_s) next_step(clock_s);
}

// The group is there, or was waited for in vain.
void UxrceClient::next_step(double clock_s) {
  const bool complete = group_->sent && group_->requests.empty();
  group_.reset();
  if (phase_ == Phase::kRunning) return;  // a writer: used all the same
  const unsigned readers = static_cast<unsigned>(config_.readers.size());
  int read_before = -1;
  if (step_ == 0 && !complete) {
    phase_ = Phase::kEnded;
    return;
  }
  if (step_ >= 1 && step_ <= readers) {
    alive_[step_ - 1] = complete;
    if (complete) read_before = static_cast<int>(0x800 + step_ - 1);
  }
  ++step_;
  if (step_ <= readers) {
    group_ = topic_group(config_.readers[step_ - 1], 0x800 + step_ - 1, true, read_before);
  } else if (step_ == readers + 1) {
    Group group;
    if (read_before >= 0) add_read(group.submessages, static_cast<unsigned>(read_before), 6, 1);
    Bytes names;
    for (const char* name : {"vehicle_command", "px4_msgs::srv::dds_::VehicleCommand_Request_",
                             "px4_msgs::srv::dds_::VehicleCommand_Response_"})
      text(names, name);
    names.push_back(1);
    text(names, "rq/fmu/vehicle_commandRequest");
    names.push_back(1);
    text(names, "rr/fmu/vehicle_commandReply");
    group.requests.push_back(request_);
    add_create(group.submessages, 0x800, 8, names, 0x0011);
    group_ = group;
  } else {
    phase_ = Phase::kClock;
    next_ask_s_ = clock_s;
  }
  advance_groups(clock_s);
}

void UxrceClient::disconnect() {
  phase_ = Phase::kPing;
  due_s_ = now_s_;
  group_.reset();
  unacknowledged_.clear();
}

void UxrceClient::publish(const Topic& topic, const void* payload, std::size_t size, double clock_s) {
  now_s_ = clock_s;
  if (phase_ != Phase::kRunning || group_) return;  // one thread: while a writer is created nothing is sent
  const auto writer = writers_.find(topic.name);
  if (writer == writers_.end()) {
    const unsigned number = 0x100 + 7 * static_cast<unsigned>(writers_.size());
    writers_[topic.name] = number;
    group_ = topic_group(topic, number, false, -1);
    advance_groups(clock_s);
    return;
  }
  Bytes body, data;
  be16(data, request_++);
  be16(data, writer->second << 4 | 5);
  const auto* const from = static_cast<const std::uint8_t*>(payload);
  data.insert(data.end(), from, from + size);
  submessage(body, 7, 1, data);
  align4(body);
  send_frame(message_of(header(kInside, 1, best_effort_out_++), body));
}

void UxrceClient::tick(double clock_s) {
  now_s_ = clock_s;
  switch (phase_) {
    case Phase::kEnded:
      return;
    case Phase::kPing:
      if (clock_s < due_s_) return;
      due_s_ = clock_s + kAnswer_s;
      return send_ping(kOutside);
    case Phase::kOpening: {
      if (clock_s < due_s_) return;
      if (attempts_++ == kOpenings) {
        phase_ = Phase::kEnded;
        return;
      }
      due_s_ = clock_s + kAnswer_s;
      Bytes payload{'X', 'R', 'C', 'E', 1, 0, 1, 0x0F, 0, 0, 0, 1, kInside, 0, 0xFC, 0x01};
      Bytes body;
      submessage(body, 0, 1, payload);
      return send_frame(message_of(header(kOutside, 0, 0), body));
    }
    default:
      break;
  }
  advance_groups(clock_s);
  // Any inbound frame puts the heartbeat off.
  if (group_ && !unacknowledged_.empty() && clock_s > std::max(inbound_s_, heartbeat_s_) + kHeartbeat_s) {
    heartbeat_s_ = clock_s;
    Bytes payload;
    le16(payload, unacknowledged_.front().first);
    le16(payload, unacknowledged_.back().first);
    payload.push_back(0x80);
    Bytes body;
    submessage(body, 11, 1, payload);
    send_frame(message_of(header(kInside, 0, 0), body));
  }
  if ((phase_ == Phase::kClock || phase_ == Phase::kRunning) && clock_s >= next_ask_s_) {
    if (asked_s_ && phase_ == Phase::kRunning) {
      asked_s_.reset();
      next_ask_s_ = clock_s + 1.0;
    } else {
      ask_time(clock_s);
    }
  }
  if (phase_ != Phase::kRunning) return;
  // Asked only while nothing comes.
  if (clock_s < data_s_ + kAnswer_s) {
    pinged_s_.reset();
    missed_pings_ = 0;
    return;
  }
  if (pinged_s_ && clock_s < *pinged_s_ + kAnswer_s) return;
  if (pinged_s_ && ++missed_pings_ >= kMissedPings) return disconnect();
  pinged_s_ = clock_s;
  send_ping(kInside);
}

}  // namespace atmos
