#include "atmos_px4_bridge/xrce/endpoint.h"

#include <algorithm>

namespace atmos::xrce {

namespace {

constexpr std::size_t kMostEntities = 512, kMostWaiting = 64;  // a hundred entities are usual
constexpr std::uint16_t kMostAhead = 16;  // reliable messages kept out of order: the bits of an ACKNACK
constexpr int kWrongLengths = 3;          // samples of a wrong length before the firmware is refused
constexpr char kCookie[] = "XRCE";
constexpr std::uint8_t kVersion[] = {1, 0}, kVendor[] = {1, 0x0F};

}  // namespace

Endpoint::Endpoint(Firmware firmware, double bytes_per_s, Write write, Listener listener)
    : firmware_(firmware), write_(std::move(write)), listener_(std::move(listener)), pacer_(bytes_per_s) {}

void Endpoint::receive(const std::uint8_t* data, std::size_t size, double now_s) {
  now_s_ = now_s;
  pacer_.advance(now_s);
  for (std::size_t i = 0; i < size; ++i) {
    if (const auto message = deframer_.push(data[i])) take_message(*message, now_s);
  }
  flush(now_s);
}

void Endpoint::take_message(ByteView bytes, double now_s) {
  const auto reader = MessageReader::open(bytes);
  if (!reader) {
    ++counters_.malformed;
    return;
  }
  ++counters_.received;
  const MessageHeader& header = reader->header();
  const bool ours = alive() && header.session == session_;
  if (ours && header.stream >= kReliable) return take_reliable(*reader, bytes, now_s);
  if (ours && header.stream != kNoStream) {
    if (best_effort_in_ && !newer(header.sequence, *best_effort_in_)) return;
    if (best_effort_in_) counters_.lost += static_cast<std::uint16_t>(header.sequence - *best_effort_in_ - 1);
    best_effort_in_ = header.sequence;
  }
  read_submessages(*reader, now_s);
}

void Endpoint::take_reliable(const MessageReader& message, ByteView bytes, double now_s) {
  const std::uint16_t sequence = message.header().sequence;
  const auto ahead = static_cast<std::uint16_t>(sequence - expected_);
  if (ahead == 0) {
    ++expected_;
    read_submessages(message, now_s);
    for (auto next = early_.find(expected_); alive() && next != early_.end(); next = early_.find(expected_)) {
      const Bytes kept = std::move(next->second);
      early_.erase(next);
      ++expected_;
      if (const auto reader = MessageReader::open({kept.data(), kept.size()}))
        read_submessages(*reader, now_s);
    }
  } else if (ahead < kMostAhead) {
    early_[sequence] = Bytes(bytes.data, bytes.data + bytes.size);
  }
  if (alive()) acknowledge(false);
}

void Endpoint::read_submessages(MessageReader message, double now_s) {
  const MessageHeader header = message.header();
  while (const auto submessage = message.next()) {
    const bool ours = alive() && header.session == session_;
    switch (submessage->id) {
      case Submessage::kCreateClient:
        if (header.session == kNoSession) on_create_client(*submessage, now_s);
        break;
      case Submessage::kGetInfo:
        on_get_info(*submessage, header);
        break;
      case Submessage::kDelete:
        on_delete(*submessage, header);
        break;
      case Submessage::kTimestamp:
        on_timestamp(*submessage, header, now_s);
        break;
      case Submessage::kCreate:
        if (ours) on_create(*submessage, now_s);
        break;
      case Submessage::kReadData:
        if (ours) on_read_data(*submessage);
        break;
      case Submessage::kWriteData:
        if (ours) on_write_data(*submessage, now_s);
        break;
      case Submessage::kAcknack:
        if (ours) on_acknack(*submessage);
        break;
      case Submessage::kHeartbeat:
        if (ours) on_heartbeat(*submessage);
        break;
      default:
        ++counters_.malformed;  // fragments and answers of agents: PX4 sends none
        break;
    }
  }
  if (message.broken()) ++counters_.malformed;
}

// --- session ---

void Endpoint::open_session(std::uint8_t session, double now_s) {
  drop_session();
  state_ = State::kSettingUp;
  session_ = session;
  created_s_ = asked_s_ = now_s;
  ++counters_.sessions;
  if (listener_.session) listener_.session(now_s);
}

void Endpoint::drop_session() {
  state_ = State::kNoSession;
  verified_ = false;
  wrong_lengths_ = 0;
  entities_.clear();
  readers_ = {};
  expected_ = reliable_out_ = best_effort_out_ = 0;
  early_.clear();
  best_effort_in_.reset();
  in_flight_.clear();
  waiting_.clear();
  control_.clear();
  commands_.clear();
  setpoint_.clear();
  odometry_.clear();
}

void Endpoint::refuse(const std::string& fault) {
  if (state_ == State::kRefused) return;
  state_ = State::kRefused;
  verified_ = false;
  commands_.clear();
  setpoint_.clear();
  odometry_.clear();
  if (listener_.fault) listener_.fault("firmware is not " + std::string(name_of(firmware_)) + ": " + fault);
}

void Endpoint::on_create_client(const SubmessageView& submessage, double now_s) {
  PayloadReader in(submessage.payload);
  const ByteView cookie = in.part(4), version = in.part(2);
  in.part(2 + 4);  // vendor, key: one client on a line
  const std::uint8_t session = in.u8();
  if (!in.ok() || session <= kNoSession) {
    ++counters_.malformed;
    return;
  }
  std::uint8_t status = kOk;
  if (std::memcmp(cookie.data, kCookie, 4) != 0) status = kErrorInvalid;
  if (status == kOk && version.data[0] != kVersion[0]) status = kErrorIncompatible;
  if (status == kOk) open_session(session, now_s);
  MessageBuilder answer({session, kNoStream, 0});
  answer.begin(Submessage::kStatusAgent).u8(status).u8(0);
  put(answer.bytes(kCookie, 4).bytes(kVersion, 2).bytes(kVendor, 2).u8(0).message());
}

void Endpoint::on_get_info(const SubmessageView& submessage, const MessageHeader& header) {
  PayloadReader in(submessage.payload);
  const unsigned request = in.id(), object = in.id();
  if (!in.ok()) {
    ++counters_.malformed;
    return;
  }
  // Who asks outside a session has lost it.
  if (header.session == kNoSession) drop_session();
  const bool known = alive() && header.session == session_;
  MessageBuilder answer({header.session, kNoStream, 0});
  answer.begin(Submessage::kInfo).id(request).id(object).u8(kOk).u8(known ? 1 : 0);
  constexpr std::uint8_t kHas = 1, kAgent = 0x0D;
  answer.u8(kHas).u8(kAgent).bytes(kCookie, 4).bytes(kVersion, 2).bytes(kVendor, 2).u8(0);
  answer.u8(kHas).u8(kAgent).u8(0).u16(1).u16(0).u32(0);  // available; no addresses
  put(answer.message());
}

void Endpoint::on_delete(const SubmessageView& submessage, const MessageHeader& header) {
  PayloadReader in(submessage.payload);
  const unsigned request = in.id(), object = in.id();
  if (!in.ok()) {
    ++counters_.malformed;
    return;
  }
  if (alive() && header.session == session_) {
    if (object == kObjectClient) {
      drop_session();
    } else {
      entities_.erase(static_cast<std::uint16_t>(object));
    }
  }
  MessageBuilder answer({header.session, kNoStream, 0});
  put(answer.begin(Submessage::kStatus).id(request).id(object).u8(kOk).u8(0).message());
}

void Endpoint::on_timestamp(const SubmessageView& submessage, const MessageHeader& header, double now_s) {
  PayloadReader in(submessage.payload);
  Instant originate;
  originate.seconds = static_cast<std::int32_t>(in.u32());
  originate.nanoseconds = in.u32();
  if (!in.ok()) {
    ++counters_.malformed;
    return;
  }
  // Answered before anything else, and without a session, too: a client that waits for its clock to be set
  // can do nothing else.
  const Instant now = instant_of(now_s);
  write(frame(timestamp_reply(header.session, now, now, originate), kAgentAddress, kClientAddress));
  if (listener_.clock) listener_.clock(originate.seconds + originate.nanoseconds * 1e-9, now_s);
}

// --- entities ---

void Endpoint::on_create(const SubmessageView& submessage, double now_s) {
  PayloadReader in(submessage.payload);
  const std::uint16_t request = in.id(), object = in.id();
  if (!in.ok()) {
    ++counters_.malformed;
    return;
  }
  created_s_ = now_s;
  const std::uint8_t status = create(object, in);
  put_reliable(Submessage::kStatus,
               {static_cast<std::uint8_t>(request >> 8), static_cast<std::uint8_t>(request & 0xFF),
                static_cast<std::uint8_t>(object >> 8), static_cast<std::uint8_t>(object & 0xFF), status, 0});
}

std::uint8_t Endpoint::create(std::uint16_t object, PayloadReader& body) {
  body.u8();  // kind: the id has it, too
  body.u8();  // format
  const std::uint32_t size = body.u32();
  const ByteView representation = body.part(size);
  if (!body.ok()) return kErrorInvalid;
  if (entities_.size() >= kMostEntities && entities_.count(object) == 0) return kErrorResources;
  switch (kind_of(object)) {
    case Kind::kTopic:
      return create_topic(object, representation);
    case Kind::kDataReader:
    case Kind::kDataWriter:
      return create_end(object, representation);
    default:
      entities_[object] = {};
      return kOk;
  }
}

std::uint8_t Endpoint::create_topic(std::uint16_t object, ByteView representation) {
  PayloadReader in(representation);
  const std::string name = in.text();
  if (in.u8() != 0) in.text();  // a reference to a type
  const std::string type = in.u8() != 0 ? in.text() : std::string();
  if (!in.ok()) return kErrorInvalid;
  const TopicMatch match = match_topic(name, type, firmware_);
  if (match.kind == TopicMatch::Kind::kContradiction) {
    entities_[object] = {Topic::kCount, true};
    refuse(match.fault);
    return kErrorMismatch;
  }
  entities_[object] = {match.topic, false};
  return kOk;
}

// A reader or a writer: its representation begins with the id of its topic.
std::uint8_t Endpoint::create_end(std::uint16_t object, ByteView representation) {
  PayloadReader in(representation);
  const auto topic = entities_.find(in.id());
  if (!in.ok()) return kErrorInvalid;
  if (topic == entities_.end() || topic->second.refused) return kErrorUnknownReference;
  const Topic what = topic->second.topic;
  entities_[object] = {what, false};
  const bool reads = kind_of(object) == Kind::kDataReader;
  if (reads && what != Topic::kCount && info(what).read_by_px4)
    readers_[index(what)] = {object, 0, true, false};
  return kOk;
}

void Endpoint::on_read_data(const SubmessageView& submessage) {
  PayloadReader in(submessage.payload);
  const std::uint16_t request = in.id(), object = in.id();
  if (!in.ok()) {
    ++counters_.malformed;
    return;
  }
  for (Reader& reader : readers_) {
    if (reader.exists && reader.object == object) reader.request = request, reader.reading = true;
  }
}

void Endpoint::on_write_data(const SubmessageView& submessage, double now_s) {
  PayloadReader in(submessage.payload);
  in.id();
  const std::uint16_t object = in.id();
  const ByteView payload = in.rest();
  if (!in.ok()) {
    ++counters_.malformed;
    return;
  }
  const auto entity = entities_.find(object);
  if (entity == entities_.end() || kind_of(object) != Kind::kDataWriter) return;
  const Topic topic = entity->second.topic;
  if (topic == Topic::kCount || info(topic).read_by_px4) return;
  const std::size_t expected = payload_size(topic, firmware_);
  if (payload.size != expected) {
    ++counters_.malformed;
    if (++wrong_lengths_ >= kWrongLengths)
      refuse(std::string(info(topic).name) + " has " + std::to_string(payload.size) +
             " bytes, expected are " + std::to_string(expected));
    return;
  }
  if (state_ == State::kRefused) return;
  if (topic == Topic::kStatus) verified_ = true;
  if (listener_.sample) listener_.sample(topic, payload, now_s);
}

std::string Endpoint::missing() const {
  std::string names;
  for (std::size_t i = 0; i < kTopics; ++i) {
    const TopicInfo& topic = info(static_cast<Topic>(i));
    if (topic.read_by_px4 && !readers_[i].reading)
      names += (names.empty() ? "" : ", ") + std::string(topic.name);
  }
  return names;
}

void Endpoint::judge_set_up(double now_s) {
  if (state_ != State::kSettingUp || now_s < created_s_ + kQuiet_s) return;
  const std::string names = missing();
  if (names.empty()) {
    state_ = State::kReady;
    return;
  }
  // Before its first reader PX4 may synchronise its clock for many seconds.
  const bool begun = std::any_of(readers_.begin(), readers_.end(), [](const Reader& r) { return r.exists; });
  if (!begun || now_s < created_s_ + kMissing_s) return;
  // PX4 never creates again what it missed: it has to begin anew, which it does when its pings tell it that
  // there is no session.
  drop_session();
  ++counters_.forced;
  if (listener_.fault) listener_.fault("PX4 does not read " + names + ": session dropped");
}

// --- reliable streams ---

void Endpoint::put_reliable(Submessage id, const Bytes& payload) {
  if (waiting_.size() >= kMostWaiting) {
    ++counters_.malformed;  // a client that creates without reading answers
    return;
  }
  waiting_.emplace_back(id, payload);
  fill_window();
}

void Endpoint::fill_window() {
  while (in_flight_.size() < kWindow && !waiting_.empty()) {
    MessageBuilder message({session_, kReliable, reliable_out_});
    const auto& [id, payload] = waiting_.front();
    message.begin(id).bytes(payload.data(), payload.size());
    if (in_flight_.empty()) heartbeat_s_ = now_s_;
    in_flight_.push_back({reliable_out_++, message.message()});
    waiting_.pop_front();
    put(in_flight_.back().message);
  }
}

// The client sends all that is not acknowledged again if any bit is set.
void Endpoint::acknowledge(bool ask_for_next) {
  unsigned missing = ask_for_next ? 1 : 0;
  for (const auto& [sequence, message] : early_) {
    const auto ahead = static_cast<std::uint16_t>(sequence - expected_);
    for (unsigned i = 0; i < ahead; ++i) {
      if (early_.count(static_cast<std::uint16_t>(expected_ + i)) == 0) missing |= 1u << i;
    }
  }
  MessageBuilder message({session_, kNoStream, 0});
  put(message.begin(Submessage::kAcknack).u16(expected_).id(missing).u8(kReliable).message());
}

void Endpoint::on_acknack(const SubmessageView& submessage) {
  PayloadReader in(submessage.payload);
  const std::uint16_t first = in.u16(), missing = in.id();
  const std::uint8_t stream = in.u8();
  if (!in.ok()) {
    ++counters_.malformed;
    return;
  }
  if (stream != kReliable || in_flight_.empty()) return;
  const auto acknowledged = static_cast<std::uint16_t>(first - in_flight_.front().sequence);
  if (acknowledged > in_flight_.size()) return;  // an old one
  in_flight_.erase(in_flight_.begin(), in_flight_.begin() + acknowledged);
  for (std::size_t i = 0; i < in_flight_.size(); ++i) {
    if ((missing >> i & 1u) == 0) continue;
    ++counters_.repeated;
    put(in_flight_[i].message);
  }
  fill_window();
}

void Endpoint::on_heartbeat(const SubmessageView& submessage) {
  PayloadReader in(submessage.payload);
  in.u16();
  const std::uint16_t last = in.u16();
  const std::uint8_t stream = in.u8();
  if (!in.ok()) {
    ++counters_.malformed;
    return;
  }
  if (stream == kReliable) acknowledge(last == expected_ || newer(last, expected_));
}

void Endpoint::tick(double now_s) {
  if (now_s < now_s_) created_s_ = asked_s_ = heartbeat_s_ = now_s;  // a restarted simulator
  now_s_ = now_s;
  judge_set_up(now_s);
  if (alive()) {
    const bool setting_up = now_s < created_s_ + kSettingUp_s;
    if (now_s >= asked_s_ + (setting_up ? kRepair_s : kRemind_s)) {
      asked_s_ = now_s;
      acknowledge(true);
    }
    if (!in_flight_.empty() && now_s >= heartbeat_s_ + kRepair_s) {
      heartbeat_s_ = now_s;
      MessageBuilder message({session_, kNoStream, 0});
      message.begin(Submessage::kHeartbeat).u16(in_flight_.front().sequence);
      put(message.u16(in_flight_.back().sequence).u8(kReliable).message());
    }
  }
  flush(now_s);
}

// --- the line ---

void Endpoint::send(Slot slot, std::vector<Sample> samples, double now_s) {
  if (state_ != State::kReady || (slot == Slot::kSetpoint && !verified_)) return;
  if (slot == Slot::kCommand) {
    if (commands_.size() >= kMostWaiting) commands_.pop_front(), ++counters_.superseded;
    commands_.push_back(std::move(samples));
  } else {
    std::vector<Sample>& place = slot == Slot::kSetpoint ? setpoint_ : odometry_;
    if (!place.empty()) ++counters_.superseded;
    place = std::move(samples);
  }
  flush(now_s);
}

void Endpoint::put(const Bytes& message) {
  if (control_.size() >= kMostWaiting)
    control_.pop_front();  // everything in it is repeated when it is missed
  control_.push_back(frame(message, kAgentAddress, kClientAddress));
  flush(now_s_);
}

void Endpoint::write(const Bytes& frame) {
  pacer_.spend(frame.size());
  ++counters_.sent;
  write_(frame.data(), frame.size());
}

// The message of the samples that are next to go.
Bytes Endpoint::data_message(const std::vector<Sample>& samples) const {
  MessageBuilder message({session_, kBestEffort, best_effort_out_});
  for (const Sample& sample : samples) {
    const Reader& reader = readers_[index(sample.topic)];
    message.begin(Submessage::kData).id(reader.request).id(reader.object);
    message.bytes(sample.payload.data(), sample.payload.size());
  }
  return frame(message.message(), kAgentAddress, kClientAddress);
}

void Endpoint::flush(double now_s) {
  pacer_.advance(now_s);
  while (!control_.empty() && pacer_.takes(control_.front().size())) {
    write(control_.front());
    control_.pop_front();
  }
  if (!control_.empty()) return;
  const auto pass = [this](std::vector<Sample>& samples) {
    if (samples.empty()) return true;
    const Bytes next = data_message(samples);
    if (!pacer_.takes(next.size())) return false;
    ++best_effort_out_;
    samples.clear();
    write(next);
    return true;
  };
  while (!commands_.empty()) {
    if (!pass(commands_.front())) return;
    commands_.pop_front();
  }
  if (pass(setpoint_)) pass(odometry_);
}

}  // namespace atmos::xrce
