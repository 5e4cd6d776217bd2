// The endpoint against the recorded session (session.txt): what the agent sent there comes out byte for byte.
// And single rules of the protocol, with messages written by hand.
#include "atmos_px4_bridge/xrce/endpoint.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "session_file.h"

namespace atmos::xrce {
namespace {

constexpr double kBytesPerSecond = 92160.0;  // 921600 baud
constexpr double kStart = 1795325325.591390845;

struct Bench {
  explicit Bench(Firmware firmware = Firmware::kPx4Space)
      : endpoint(firmware, kBytesPerSecond,
                 [this](const std::uint8_t* data, std::size_t size) {
                   for (std::size_t i = 0; i < size; ++i) {
                     if (const auto m = agent.push(data[i])) sent.emplace_back(m->data, m->data + m->size);
                   }
                 },
                 {[this](double) { ++sessions; },
                  [this](Topic topic, ByteView payload, double) {
                    samples.emplace_back(topic, Bytes(payload.data, payload.data + payload.size));
                  },
                  nullptr, [this](const std::string& fault) { faults.push_back(fault); }}) {}

  void take(const Bytes& message) {
    const Bytes line = frame(message, kClientAddress, kAgentAddress);
    endpoint.receive(line.data(), line.size(), now);
  }
  void pass(double duration_s) {
    for (const double end = now + duration_s; now < end;) endpoint.tick(now += 0.001);
  }

  double now = kStart;
  Deframer agent{kAgentAddress, kClientAddress};
  std::vector<Bytes> sent;
  std::vector<std::pair<Topic, Bytes>> samples;
  std::vector<std::string> faults;
  int sessions = 0;
  Endpoint endpoint;
};

std::uint8_t id_of(const Bytes& message) { return message.size() > 4 ? message[4] : 0xFF; }
bool is(const Bytes& message, Submessage id) { return id_of(message) == static_cast<std::uint8_t>(id); }
// Sent by a timer, not as an answer.
bool timed(const Bytes& m) {
  return is(m, Submessage::kHeartbeat) || (is(m, Submessage::kAcknack) && m.size() == 13 && m[11] != 0);
}

// --- messages of a client, by hand ---

Bytes create_client(std::uint8_t session = 0x81, const char* cookie = "XRCE", std::uint8_t major = 1) {
  MessageBuilder m({kNoSession, kNoStream, 0});
  m.begin(Submessage::kCreateClient).bytes(cookie, 4).u8(major).u8(0).u8(1).u8(0x0F).u32(0x01000000);
  return m.u8(session).u8(0).u16(508).message();
}

void add_text(MessageBuilder& m, std::size_t& at, const std::string& text) {
  while (at % 4 != 0) m.u8(0), ++at;
  m.u32(static_cast<std::uint32_t>(text.size() + 1)).bytes(text.c_str(), text.size() + 1);
  at += 4 + text.size() + 1;
}

// READ_DATA of the reader before (if any) and CREATE of topic, subscriber or publisher, reader or writer, as
// PX4 groups them.
Bytes create_group(std::uint16_t sequence, unsigned number, const std::string& topic, const std::string& type,
                   unsigned request, int read_before = -1, bool reader = true) {
  MessageBuilder m({0x81, kReliable, sequence});
  if (read_before >= 0)
    m.begin(Submessage::kReadData)
        .id(request++)
        .id(static_cast<unsigned>(read_before) << 4 | 6)
        .u8(1)
        .u8(0)
        .u8(0);
  if (read_before >= 0) m.u8(1).u16(0xFFFF).u16(0).u16(0).u16(0);
  std::size_t at = 0;
  std::size_t size = 4 + topic.size() + 1 + 2;
  size = (size + 3) / 4 * 4 + 4 + type.size() + 1;
  m.begin(Submessage::kCreate).id(request++).id(number << 4 | 2).u8(2).u8(3).u16(0);
  m.u32(static_cast<std::uint32_t>(size));
  add_text(m, at, topic);
  m.u8(0).u8(1), at += 2;
  add_text(m, at, type);
  m.id(0x0011);
  const unsigned group = reader ? 4 : 3, end = reader ? 6 : 5;
  m.begin(Submessage::kCreate)
      .id(request++)
      .id(number << 4 | group)
      .u8(group)
      .u8(3)
      .u16(0)
      .u32(2)
      .u16(0)
      .id(0x0011);
  m.begin(Submessage::kCreate).id(request++).id(number << 4 | end).u8(end).u8(3).u16(0).u32(2);
  return m.id(number << 4 | 2).id(number << 4 | group).message();
}

const char* const kReaders[28] = {"register_ext_component_request",
                                  "unregister_ext_component",
                                  "config_overrides_request",
                                  "arming_check_reply",
                                  "mode_completed",
                                  "config_control_setpoints",
                                  "distance_sensor",
                                  "telemetry_status",
                                  "offboard_control_mode",
                                  "onboard_computer_status",
                                  "obstacle_distance",
                                  "sensor_optical_flow",
                                  "goto_setpoint",
                                  "manual_control_input",
                                  "trajectory_setpoint",
                                  "vehicle_attitude_setpoint",
                                  "vehicle_mocap_odometry",
                                  "vehicle_rates_setpoint",
                                  "vehicle_visual_odometry",
                                  "vehicle_command",
                                  "vehicle_command_mode_executor",
                                  "vehicle_thrust_setpoint",
                                  "vehicle_torque_setpoint",
                                  "differential_drive_setpoint",
                                  "vehicle_trajectory_bezier",
                                  "actuator_motors",
                                  "actuator_servos",
                                  "aux_global_position"};

std::string type_of(const std::string& name) {
  for (std::size_t i = 0; i < kTopics; ++i) {
    if (name == info(static_cast<Topic>(i)).name)
      return "px4_msgs::msg::dds_::" + std::string(info(static_cast<Topic>(i)).type) + "_";
  }
  return "px4_msgs::msg::dds_::Other_";
}

Bytes reader_group(unsigned k, Firmware firmware = Firmware::kPx4Space) {
  const unsigned request = k == 0 ? 11 : 14 + 4 * (k - 1);
  std::string name = kReaders[k];
  for (std::size_t i = 0; i < kTopics; ++i) {
    const int v = version(static_cast<Topic>(i), firmware);
    if (name == info(static_cast<Topic>(i)).name && v > 0) name += "_v" + std::to_string(v);
  }
  return create_group(static_cast<std::uint16_t>(k + 1), 0x800 + k, "rt/fmu/in/" + name, type_of(kReaders[k]),
                      request, k == 0 ? -1 : static_cast<int>(0x800 + k - 1));
}

Bytes acknack(unsigned first) {
  MessageBuilder m({0x81, kNoStream, 0});
  return m.begin(Submessage::kAcknack).u16(first).u16(0).u8(kReliable).message();
}

TEST(Replay, TheRecordedSessionIsAnsweredByteForByte) {
  const auto session = test::load_session();
  Bench bench;
  std::vector<Bytes> expected;
  std::size_t elided = 0;  // messages of the agent that the record leaves out

  const auto acknowledge_all = [&bench] {
    unsigned next = 0;
    for (const Bytes& m : bench.sent) {
      if (m.size() > 3 && m[1] == kReliable) next = std::max(next, (m[2] | m[3] << 8) + 1u);
    }
    bench.take(acknack(next));
  };
  // Readers that the record leaves out, written by hand after its pattern.
  const auto fill_in = [&](unsigned from, unsigned to) {
    for (unsigned k = from; k <= to; ++k) {
      bench.take(reader_group(k));
      bench.pass(0.01);
      acknowledge_all();
      elided += 4;
    }
  };

  for (const auto& recorded : session) {
    const Bytes& m = recorded.message;
    const unsigned sequence = m.size() > 3 ? m[2] | m[3] << 8 : 0;
    if (recorded.from_client) {
      if (m[1] == kReliable && sequence == 9) fill_in(2, 7);
      bench.now = std::max(bench.now, kStart + recorded.time_s);
      bench.take(m);
      bench.endpoint.tick(bench.now);
      continue;
    }
    if (m[1] == kReliable && sequence == 83) fill_in(9, 27), elided -= 3;  // whose last answers are shown
    if (is(m, Submessage::kHeartbeat)) continue;                           // a timer's
    if (is(m, Submessage::kData) && m[1] == kReliable) continue;           // the service, which is not used
    expected.push_back(m);
    if (!is(m, Submessage::kData)) continue;
    // DATA: the sample is decoded and handed to the endpoint again. Commands do not wait for the status.
    if (bench.endpoint.state() != Endpoint::State::kReady) bench.pass(0.4);
    for (; sequence == 762 && elided < 97 + 756; ++elided) {
      bench.endpoint.send(Endpoint::Slot::kCommand, {{Topic::kOffboardControlMode, Bytes(15, 0)}}, bench.now);
      bench.pass(0.002);
    }
    const unsigned object = m[10] << 8 | m[11];
    const Topic topic = object == 0x8126   ? Topic::kVisualOdometry
                        : object == 0x8086 ? Topic::kOffboardControlMode
                        : object == 0x8196 ? Topic::kActuatorMotors
                        : object == 0x8136 ? Topic::kCommand
                                           : Topic::kTrajectorySetpoint;
    bench.endpoint.send(Endpoint::Slot::kCommand, {{topic, Bytes(m.begin() + 12, m.end())}}, bench.now);
    bench.pass(0.01);
  }
  EXPECT_EQ(elided, 97u + 756u);

  std::vector<Bytes> sent;
  std::copy_if(bench.sent.begin(), bench.sent.end(), std::back_inserter(sent),
               [](const Bytes& m) { return !timed(m); });
  std::size_t at = 0, skipped = 0, stamps = 0;
  for (Bytes m : expected) {
    if (is(m, Submessage::kTimestampReply)) {
      // The record has nanoseconds of its own clock; ours is the time handed in. What is echoed is exact.
      while (at < sent.size() && !is(sent[at], Submessage::kTimestampReply)) ++at, ++skipped;
      ASSERT_LT(at, sent.size());
      EXPECT_TRUE(std::equal(m.begin(), m.begin() + 8, sent[at].begin()));
      EXPECT_TRUE(std::equal(m.begin() + 24, m.end(), sent[at].begin() + 24));
      ++at, ++stamps;
      continue;
    }
    const std::size_t before = at;
    while (at < sent.size() && sent[at] != m) ++at;
    ASSERT_LT(at, sent.size()) << "not sent: session " << int(m[0]) << " stream " << int(m[1]) << " sequence "
                               << (m[2] | m[3] << 8) << " id " << int(m[4]);
    skipped += at - before;
    ++at;
  }
  EXPECT_EQ(stamps, 2u);
  EXPECT_EQ(skipped + sent.size() - at, elided) << "something was sent that the record does not have";
  EXPECT_EQ(expected.size(), 45u);
  EXPECT_TRUE(bench.faults.empty()) << bench.faults.front();
  ASSERT_EQ(bench.samples.size(), 2u);
  EXPECT_EQ(bench.samples[0].first, Topic::kBattery);
  EXPECT_EQ(bench.samples[1].first, Topic::kStatus);
  EXPECT_EQ(bench.endpoint.state(), Endpoint::State::kNoSession);  // deleted at the end
}

TEST(Replay, TimeRepliesAreThoseOfTheRecord) {
  int replies = 0;
  for (const auto& recorded : test::load_session()) {
    if (!is(recorded.message, Submessage::kTimestampReply)) continue;
    PayloadReader in({recorded.message.data() + 8, recorded.message.size() - 8});
    const auto instant = [&in] {
      const auto seconds = static_cast<std::int32_t>(in.u32());
      return Instant{seconds, in.u32()};
    };
    const Instant transmit = instant(), receive = instant(), originate = instant();
    EXPECT_EQ(timestamp_reply(0x81, transmit, receive, originate), recorded.message);
    ++replies;
  }
  EXPECT_EQ(replies, 2);
  const Instant now = instant_of(1795325325.5);
  EXPECT_EQ(now.seconds, 1795325325);
  EXPECT_EQ(now.nanoseconds, 500000000u);
  EXPECT_EQ(instant_of(3.9999999999).seconds, 4);
  EXPECT_EQ(instant_of(3.9999999999).nanoseconds, 0u);
}

TEST(Session, WrongCookieAndVersionAreRefused) {
  Bench bench;
  bench.take(create_client(0x81, "XRCF"));
  ASSERT_EQ(bench.sent.size(), 1u);
  EXPECT_EQ(bench.sent.back()[8], 0x85);
  bench.take(create_client(0x81, "XRCE", 2));
  EXPECT_EQ(bench.sent.back()[8], 0x86);
  EXPECT_EQ(bench.endpoint.state(), Endpoint::State::kNoSession);
  EXPECT_EQ(bench.sessions, 0);
}

Bytes get_info(std::uint8_t session) {
  MessageBuilder m({session, kNoStream, 0});
  return m.begin(Submessage::kGetInfo).id(10).id(0xFFFD).u32(2).message();
}

// Byte 13 of an INFO: whether there is a session.
TEST(Session, PingsTellWhetherThereIsASession) {
  Bench bench;
  bench.take(get_info(0x81));
  ASSERT_TRUE(is(bench.sent.back(), Submessage::kInfo));
  EXPECT_EQ(bench.sent.back()[13], 0) << "PX4 must learn that its session is gone";
  bench.take(create_client());
  bench.take(get_info(0x81));
  EXPECT_EQ(bench.sent.back()[13], 1);
  bench.take(get_info(0x82));
  EXPECT_EQ(bench.sent.back()[13], 0);
  bench.take(get_info(0x80));
  EXPECT_EQ(bench.sent.back()[13], 0);
  EXPECT_EQ(bench.endpoint.state(), Endpoint::State::kNoSession) << "who pings outside a session has lost it";
}

TEST(Streams, ReliableMessagesAreTakenInOrderAndAcknowledgedOnwardsOnly) {
  Bench bench;
  bench.take(create_client());
  bench.take(reader_group(1));  // sequence 2: ahead
  bench.take(reader_group(2));
  EXPECT_EQ(bench.endpoint.next_expected(), 0);
  ASSERT_TRUE(is(bench.sent.back(), Submessage::kAcknack));
  EXPECT_EQ(bench.sent.back()[8], 0);
  EXPECT_EQ(bench.sent.back()[11], 0x03) << "0 and 1 are missing";
  MessageBuilder participant({0x81, kReliable, 0});
  bench.take(
      participant.begin(Submessage::kCreate).id(10).id(0x0011).u8(1).u8(1).u16(0).u32(0).u16(0).message());
  EXPECT_EQ(bench.endpoint.next_expected(), 1);
  bench.take(reader_group(0));
  EXPECT_EQ(bench.endpoint.next_expected(), 4);
  bench.take(reader_group(0));  // a duplicate
  EXPECT_EQ(bench.endpoint.next_expected(), 4);
  unsigned newest = 0;
  for (const Bytes& m : bench.sent) {
    if (!is(m, Submessage::kAcknack)) continue;
    EXPECT_GE(m[8], newest);
    newest = m[8];
  }
  // Answers in flight: no more than the client can hold, until it acknowledges.
  const auto statuses = [&bench] {
    return std::count_if(bench.sent.begin(), bench.sent.end(),
                         [](const Bytes& m) { return is(m, Submessage::kStatus); });
  };
  EXPECT_EQ(statuses(), 4);
  bench.pass(0.001);
  bench.take(acknack(3));
  bench.pass(0.01);
  EXPECT_EQ(statuses(), 7);
}

TEST(Streams, TheNextMessageIsAskedForAndHeartbeatsRepeat) {
  Bench bench;
  bench.take(create_client());
  MessageBuilder participant({0x81, kReliable, 0});
  bench.take(
      participant.begin(Submessage::kCreate).id(10).id(0x0011).u8(1).u8(1).u16(0).u32(0).u16(0).message());
  const std::size_t before = bench.sent.size();
  bench.pass(1.0);
  int asked = 0, heartbeats = 0;
  for (std::size_t i = before; i < bench.sent.size(); ++i) {
    asked += is(bench.sent[i], Submessage::kAcknack) && bench.sent[i][11] == 1 ? 1 : 0;
    heartbeats += is(bench.sent[i], Submessage::kHeartbeat) ? 1 : 0;
  }
  EXPECT_NEAR(asked, 25, 2);
  EXPECT_NEAR(heartbeats, 25, 2);
  bench.take(acknack(1));
  bench.pass(6.0);
  bench.sent.clear();
  bench.pass(5.0);
  EXPECT_NEAR(bench.sent.size(), 10, 1) << "reminders twice a second, no heartbeats";
}

TEST(Streams, BestEffortNumbersWrapAndGapsAreCounted) {
  Bench bench;
  bench.take(create_client());
  bench.take(create_group(0, 0x10B, "rt/fmu/out/vehicle_status", type_of("vehicle_status"), 11, -1, false));
  const auto write = [&bench](std::uint16_t sequence) {
    MessageBuilder m({0x81, kBestEffort, sequence});
    bench.take(m.begin(Submessage::kWriteData).id(1).id(0x10B5).bytes(Bytes(82, 0).data(), 82).message());
  };
  for (unsigned k = 0; k < 70000; ++k) write(static_cast<std::uint16_t>(k));
  EXPECT_EQ(bench.samples.size(), 70000u);
  EXPECT_EQ(bench.endpoint.counters().lost, 0u);
  write(static_cast<std::uint16_t>(70010));
  EXPECT_EQ(bench.endpoint.counters().lost, 10u);
  write(static_cast<std::uint16_t>(70005));  // late: not taken
  EXPECT_EQ(bench.samples.size(), 70001u);
}

// Brings a bench to the end of the set-up.
void set_up(Bench& bench, Firmware firmware) {
  bench.take(create_client());
  MessageBuilder participant({0x81, kReliable, 0});
  bench.take(
      participant.begin(Submessage::kCreate).id(10).id(0x0011).u8(1).u8(1).u16(0).u32(0).u16(0).message());
  unsigned answers = 1;
  for (unsigned k = 0; k < 28; ++k) {
    bench.take(reader_group(k, firmware));
    bench.pass(0.005);
    bench.take(acknack(answers += 3));
  }
}
void add_status_writer(Bench& bench, const char* name) {
  bench.take(create_group(29, 0x10B, std::string("rt/fmu/out/") + name, type_of("vehicle_status"), 200, 0x81B,
                          false));
}
void write_status(Bench& bench, std::uint16_t sequence, std::size_t size) {
  MessageBuilder m({0x81, kBestEffort, sequence});
  bench.take(m.begin(Submessage::kWriteData).id(1).id(0x10B5).bytes(Bytes(size, 0).data(), size).message());
}
std::size_t data_count(const Bench& bench) {
  return static_cast<std::size_t>(std::count_if(bench.sent.begin(), bench.sent.end(),
                                                [](const Bytes& m) { return is(m, Submessage::kData); }));
}
void send(Bench& bench, Endpoint::Slot slot) {
  bench.endpoint.send(slot, {{Topic::kOffboardControlMode, Bytes(15, 0)}}, bench.now);
  bench.pass(0.01);
}

TEST(SetUp, NothingIsSentBeforeItIsQuietAndNoSetpointBeforeTheFirmwareIsKnown) {
  Bench bench;
  set_up(bench, Firmware::kPx4Space);
  send(bench, Endpoint::Slot::kOdometry);
  EXPECT_EQ(bench.endpoint.state(), Endpoint::State::kSettingUp);
  add_status_writer(bench, "vehicle_status");
  bench.pass(0.28);
  send(bench, Endpoint::Slot::kOdometry);
  EXPECT_EQ(data_count(bench), 0u);
  bench.pass(0.03);
  EXPECT_EQ(bench.endpoint.state(), Endpoint::State::kReady);
  send(bench, Endpoint::Slot::kOdometry);
  EXPECT_EQ(data_count(bench), 1u);
  send(bench, Endpoint::Slot::kSetpoint);
  EXPECT_EQ(data_count(bench), 1u) << "the status has not come yet";
  write_status(bench, 0, 82);
  EXPECT_TRUE(bench.endpoint.verified());
  send(bench, Endpoint::Slot::kSetpoint);
  EXPECT_EQ(data_count(bench), 2u);
}

TEST(SetUp, AMissingReaderEndsTheSessionSoThatPx4BeginsAnew) {
  Bench bench;
  bench.take(create_client());
  bench.take(create_group(0, 0x800, "rt/fmu/in/offboard_control_mode", type_of("offboard_control_mode"), 11));
  bench.pass(2.9);
  EXPECT_EQ(bench.endpoint.state(), Endpoint::State::kSettingUp);
  bench.pass(0.2);
  EXPECT_EQ(bench.endpoint.state(), Endpoint::State::kNoSession);
  EXPECT_EQ(bench.endpoint.counters().forced, 1u);
  bench.take(get_info(0x81));
  EXPECT_EQ(bench.sent.back()[13], 0);
  // Its clock is served all the same: PX4 may be in the middle of setting it.
  MessageBuilder stamp({0x81, kNoStream, 0});
  bench.take(stamp.begin(Submessage::kTimestamp).u32(5).u32(7).message());
  EXPECT_TRUE(is(bench.sent.back(), Submessage::kTimestampReply));
}

TEST(SetUp, BeforeTheFirstReaderPx4MayTakeItsTime) {
  Bench bench;
  bench.take(create_client());
  bench.pass(20.0);
  EXPECT_EQ(bench.endpoint.state(), Endpoint::State::kSettingUp);
}

TEST(Firmware, AVersionThatContradictsIsRefused) {
  for (const Firmware configured :
       {Firmware::kPx4Space, Firmware::kPx4_1_16, Firmware::kPx4_1_17, Firmware::kPx4_1_18}) {
    for (const Firmware real :
         {Firmware::kPx4Space, Firmware::kPx4_1_16, Firmware::kPx4_1_17, Firmware::kPx4_1_18}) {
      Bench bench(configured);
      set_up(bench, real);
      const int v = version(Topic::kStatus, real);
      add_status_writer(bench, v == 0 ? "vehicle_status" : ("vehicle_status_v" + std::to_string(v)).c_str());
      bench.pass(0.5);
      write_status(bench, 0, payload_size(Topic::kStatus, real));
      send(bench, Endpoint::Slot::kSetpoint);
      const bool same = configured == real;
      EXPECT_EQ(data_count(bench), same ? 1u : 0u) << name_of(configured) << " " << name_of(real);
      EXPECT_EQ(bench.faults.empty(), same);
      if (!same) {
        EXPECT_EQ(bench.endpoint.state(), Endpoint::State::kRefused);
        EXPECT_NE(bench.faults[0].find(name_of(configured)), std::string::npos) << bench.faults[0];
      }
    }
  }
}

TEST(Firmware, WrongLengthsAreNeverReadAndThenRefused) {
  Bench bench;
  set_up(bench, Firmware::kPx4Space);
  add_status_writer(bench, "vehicle_status");
  bench.pass(0.5);
  write_status(bench, 0, 80);
  write_status(bench, 1, 83);
  EXPECT_TRUE(bench.samples.empty());
  EXPECT_FALSE(bench.endpoint.verified());
  EXPECT_EQ(bench.endpoint.state(), Endpoint::State::kReady);
  write_status(bench, 2, 80);
  EXPECT_EQ(bench.endpoint.state(), Endpoint::State::kRefused);
  write_status(bench, 3, 82);
  send(bench, Endpoint::Slot::kSetpoint);
  EXPECT_EQ(data_count(bench), 0u);
  // Another firmware may be on it after a restart.
  bench.take(create_client());
  EXPECT_EQ(bench.endpoint.state(), Endpoint::State::kSettingUp);
}

TEST(Pace, ANewerSetpointReplacesTheOneThatWaits) {
  Bench bench;
  set_up(bench, Firmware::kPx4Space);
  add_status_writer(bench, "vehicle_status");
  bench.pass(0.5);
  write_status(bench, 0, 82);
  const std::size_t before = data_count(bench);
  for (std::uint8_t k = 0; k < 50; ++k)
    bench.endpoint.send(Endpoint::Slot::kSetpoint, {{Topic::kActuatorMotors, Bytes(68, k)}}, bench.now);
  EXPECT_LE(data_count(bench), before + 2) << "no more than a burst at once";
  bench.pass(0.02);
  EXPECT_EQ(data_count(bench), before + 3);
  const auto newest = std::find_if(bench.sent.rbegin(), bench.sent.rend(),
                                   [](const Bytes& m) { return is(m, Submessage::kData); });
  EXPECT_EQ(newest->back(), 49) << "the newest is sent";
  EXPECT_GT(bench.endpoint.counters().superseded, 40u);
}

}  // namespace
}  // namespace atmos::xrce
