// Every parser of the XRCE link against garbage, under the address and undefined-behaviour sanitizers: bytes
// of the line, messages within intact frames, payloads, names. 100,000 inputs; ATMOS_LONG_TESTS=1: a million.
#include <gtest/gtest.h>

#include <cstdlib>
#include <random>

#include "atmos_px4_bridge/emulator/uxrce_client.h"
#include "atmos_px4_bridge/xrce/endpoint.h"
#include "session_file.h"

namespace atmos::xrce {
namespace {

using Random = std::mt19937_64;

int inputs() { return std::getenv("ATMOS_LONG_TESTS") != nullptr ? 1000000 : 100000; }

// Something wrong with a message of the recorded session, or no message at all.
Bytes damaged(Bytes message, const Bytes& other, Random& random) {
  switch (random() % 6) {
    case 0:
      message.resize(random() % 300);
      for (auto& byte : message) byte = static_cast<std::uint8_t>(random());
      break;
    case 1:  // truncated
      message.resize(random() % (message.size() + 1));
      break;
    case 2:  // some bytes changed, most of all in the heads of submessages
      for (int k = 0; k < 4; ++k)
        message[random() % (random() % 2 == 0 ? std::min<std::size_t>(message.size(), 16) : message.size())] =
            static_cast<std::uint8_t>(random());
      break;
    case 3: {  // a length or a text's size that is too large, or just too large
      const std::size_t at = 4 + random() % (message.size() - 4);
      message[at] = static_cast<std::uint8_t>(random() % 3 == 0 ? 0xFF : message[at] + 1);
      break;
    }
    case 4: {  // spliced
      message.resize(random() % message.size());
      message.insert(message.end(), other.begin() + static_cast<long>(random() % other.size()), other.end());
      break;
    }
    default:  // as it is, but of another time: sequence number and stream
      message[1] = static_cast<std::uint8_t>(random() % 4 == 0 ? random() : message[1]);
      message[2] = static_cast<std::uint8_t>(random());
      message[3] = static_cast<std::uint8_t>(random() % 8 == 0 ? random() : message[3]);
      break;
  }
  return message;
}

// What the endpoint sends, looked at: no acknowledgement moves backwards, nothing is longer than the client
// takes.
struct Watch {
  void take(const std::uint8_t* data, std::size_t size) {
    for (std::size_t i = 0; i < size; ++i) {
      const auto m = deframer.push(data[i]);
      if (!m) continue;
      ASSERT_GE(m->size, 8u);
      ASSERT_LE(m->size, kMostOutbound);
      if (m->data[4] == 6) ++answers;
      if (m->data[4] == 4) acknowledged = 0;
      if (m->data[4] != 10) continue;
      const auto first = static_cast<std::uint16_t>(m->data[8] | m->data[9] << 8);
      ASSERT_LT(static_cast<std::uint16_t>(first - acknowledged), 0x8000) << "backwards";
      acknowledged = first;
    }
  }
  Deframer deframer{kAgentAddress, kClientAddress};
  std::uint16_t acknowledged = 0;
  std::uint64_t answers = 0;
};

Bytes ping(std::uint8_t session) {
  MessageBuilder m({session, kNoStream, 0});
  return frame(m.begin(Submessage::kGetInfo).id(10).id(0xFFFD).u32(2).message(), kClientAddress,
               kAgentAddress);
}

TEST(Fuzz, TheEndpointSurvivesAndAnswersTheNextWholeFrame) {
  Random random(4711);
  std::vector<Bytes> messages;
  Bytes create_client;
  for (const auto& recorded : test::load_session()) {
    if (!recorded.from_client) continue;
    messages.push_back(recorded.message);
    if (recorded.message[4] == 0) create_client = frame(recorded.message, kClientAddress, kAgentAddress);
  }
  Watch watch;
  std::uint64_t samples = 0;
  Endpoint endpoint(
      Firmware::kPx4Space, 1e9, [&](const std::uint8_t* data, std::size_t size) { watch.take(data, size); },
      Endpoint::Listener{[&](double) { watch.acknowledged = 0; }, [&](Topic, ByteView, double) { ++samples; },
                         nullptr, nullptr});
  double now = 1234.5;
  for (int i = 0; i < inputs(); ++i) {
    now += 0.001;
    if (i % 50 == 0) endpoint.receive(create_client.data(), create_client.size(), now);
    const Bytes& message =
        messages[static_cast<std::size_t>(i % 50 < 30 ? i % 50 : random() % messages.size())];
    const Bytes other = messages[random() % messages.size()];
    Bytes line;
    if (random() % 3 != 0) {  // the frame is whole, what is in it is not
      Bytes content = random() % 4 == 0 ? message : damaged(message, other, random);
      if (content.size() > 3 && random() % 2 == 0) {  // and it is the one that is expected
        content[2] = static_cast<std::uint8_t>(endpoint.next_expected());
        content[3] = static_cast<std::uint8_t>(endpoint.next_expected() >> 8);
      }
      line = frame(content, kClientAddress, kAgentAddress);
    } else {
      line = damaged(frame(message, kClientAddress, kAgentAddress),
                     frame(other, kClientAddress, kAgentAddress), random);
    }
    endpoint.receive(line.data(), line.size(), now);
    endpoint.tick(now);
    endpoint.send(static_cast<Endpoint::Slot>(random() % 3), {{Topic::kOffboardControlMode, Bytes(15, 1)}},
                  now);
    const std::uint64_t before = watch.answers;
    const Bytes good = ping(0x99);
    endpoint.receive(good.data(), good.size(), now);
    ASSERT_EQ(watch.answers, before + 1) << "input " << i;
    if (::testing::Test::HasFatalFailure()) return;
  }
  const FramingCounters& f = endpoint.framing();
  const EndpointCounters& c = endpoint.counters();
  std::printf(
      "%d inputs: %lu whole frames, %lu bad checksums, %lu broken, %lu malformed messages, %lu sessions, %lu "
      "samples\n",
      inputs(), static_cast<unsigned long>(f.frames), static_cast<unsigned long>(f.bad_crc),
      static_cast<unsigned long>(f.broken), static_cast<unsigned long>(c.malformed),
      static_cast<unsigned long>(c.sessions), static_cast<unsigned long>(samples));
  EXPECT_GT(c.malformed, 1000u);
  EXPECT_GT(samples, 10u);
}

TEST(Fuzz, TheEmulatedClientSurvives) {
  Random random(815);
  std::vector<Bytes> messages;
  for (const auto& recorded : test::load_session()) {
    if (!recorded.from_client) messages.push_back(recorded.message);
  }
  std::uint64_t sent = 0, delivered = 0;
  UxrceClient client(
      {{{"offboard_control_mode", "OffboardControlMode"}, {"actuator_motors", "ActuatorMotors"}}, 3},
      [&](const std::uint8_t*, std::size_t) { ++sent; },
      [&](const std::string&, const std::uint8_t*, std::size_t) { ++delivered; });
  double clock = 1.0;
  for (int i = 0; i < inputs(); ++i) {
    clock += 0.01;
    const Bytes& message = messages[random() % messages.size()];
    const Bytes line =
        frame(random() % 3 == 0 ? message : damaged(message, messages[random() % messages.size()], random),
              kAgentAddress, kClientAddress);
    client.receive(line.data(), line.size(), clock);
    client.tick(clock);
    client.publish({"vehicle_status", "VehicleStatus"}, line.data(), std::min<std::size_t>(line.size(), 82),
                   clock);
  }
  EXPECT_GT(sent, 100u);
}

template <class Message>
void fuzz_payload(Random& random, Firmware firmware) {
  Bytes payload(random() % 260);
  for (auto& byte : payload) byte = static_cast<std::uint8_t>(random());
  Message message;
  if (decode({payload.data(), payload.size()}, firmware, message)) {
    EXPECT_EQ(encode(message, firmware).size(), payload.size());
  }
}

TEST(Fuzz, PayloadsAndNames) {
  Random random(42);
  const std::string parts[] = {"rt/",
                               "fmu/",
                               "in/",
                               "out/",
                               "/fmu/in/",
                               "/fmu/out/",
                               "vehicle_status",
                               "_v",
                               "1",
                               "999",
                               "trajectory_setpoint",
                               "_",
                               ""};
  for (int i = 0; i < inputs(); ++i) {
    const auto firmware = static_cast<Firmware>(random() % 4);
    switch (i % 8) {
      case 0:
        fuzz_payload<VehicleStatus>(random, firmware);
        break;
      case 1:
        fuzz_payload<VehicleLocalPosition>(random, firmware);
        break;
      case 2:
        fuzz_payload<BatteryStatus>(random, firmware);
        break;
      case 3:
        fuzz_payload<VehicleCommandAck>(random, firmware);
        break;
      case 4:
        fuzz_payload<VehicleAttitude>(random, firmware);
        break;
      case 5:
        fuzz_payload<SensorCombined>(random, firmware);
        break;
      case 6:
        fuzz_payload<VehicleOdometry>(random, firmware);
        break;
      default: {
        std::string name;
        for (int k = 0; k < 6; ++k) name += parts[random() % std::size(parts)];
        match_topic(name, name, firmware);
        break;
      }
    }
  }
}

}  // namespace
}  // namespace atmos::xrce
