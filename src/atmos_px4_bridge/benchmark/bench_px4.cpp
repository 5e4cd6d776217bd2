// What the link costs: encoding and decoding the traffic of a flight, and the share of the line it takes.
#include <unistd.h>

#include <cstdio>
#include <string>
#include <vector>

#include "../test/mavlink/fields.h"
#include "atmos_model/benchmark_row.h"
#include "atmos_model/steady_clock.h"
#include "atmos_px4_bridge/emulator/pseudo_terminal.h"
#include "atmos_px4_bridge/link_budget.h"
#include "atmos_px4_bridge/mavlink/px4.h"
#include "atmos_px4_bridge/port.h"
#include "atmos_px4_bridge/px4_bridge.h"

namespace {

using namespace atmos::mavlink;
using atmos::print_row;
using atmos::steady_seconds;

// Encodes, parses and decodes messages of a flight in the proportion in which they are sent.
void codec_rate() {
  std::mt19937_64 random(1);
  const Odometry odometry = test::random_message<Odometry>(random);
  const SetAttitudeTarget target = test::random_message<SetAttitudeTarget>(random);
  const HighresImu imu = test::random_message<HighresImu>(random);
  const AttitudeQuaternion attitude = test::random_message<AttitudeQuaternion>(random);
  constexpr int kRounds = 100000, kRepeats = 9, kPerRound = 6;
  std::vector<double> rates;
  double sum = 0.0;
  for (int repeat = 0; repeat < kRepeats; ++repeat) {
    Parser parser;
    std::uint64_t frames = 0;
    const double begin = steady_seconds();
    for (int i = 0; i < kRounds; ++i) {
      u8 bytes[kPerRound * kMaxFrame];
      std::size_t size = 0;
      u8 sequence = static_cast<u8>(i);
      const auto put = [&](const auto& message) {
        size += encode(message, {1, 1}, sequence++, bytes + size);
      };
      put(odometry), put(odometry), put(target), put(imu), put(attitude), put(attitude);
      parser.push(bytes, size);
      while (const auto frame = parser.next()) {
        ++frames;
        if (const auto m = decode<Odometry>(*frame)) sum += m->x;
        if (const auto m = decode<SetAttitudeTarget>(*frame)) sum += m->thrust;
        if (const auto m = decode<HighresImu>(*frame)) sum += m->zgyro;
        if (const auto m = decode<AttitudeQuaternion>(*frame)) sum += m->q1;
      }
    }
    rates.push_back(static_cast<double>(frames) / (steady_seconds() - begin));
  }
  std::fprintf(stderr, "bench_px4: checksum %g\n", sum);
  print_row("px4/codec_messages_per_s", "1/s", rates);
}

// From a set-point handed to the bridge to its last byte at the other end of a serial device (a
// pseudo-terminal).
void setpoint_to_wire() {
  using namespace atmos;
  const std::string device = "/tmp/bench_px4_" + std::to_string(::getpid());
  PseudoTerminal terminal(device);
  const auto port = make_port(device, 921600);
  port->poll(0.0);
  BridgeConfig config = load_bridge(ATMOS_CONFIG_DIR "/px4/bridge_patched.yaml", LinkChoice::kMavlink);
  Px4Bridge bridge(config, load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml"),
                   {[&](const u8* data, std::size_t size) { port->write(data, size); }, {}});
  Setpoint setpoint;
  setpoint.level = Level::kRate;
  setpoint.w_WB_B.z() = 0.1;
  setpoint.force_B.x() = 1.0;
  OdometrySample odometry;
  std::vector<double> ms;
  double now = 1000.0;
  for (int k = 0; k < 20000; ++k) {
    now += 0.01;
    odometry.stamp_s = now;
    bridge.manager().take_odometry(odometry, now);
    bridge.manager().hear(now);
    u8 buffer[4096];
    while (terminal.read(buffer, sizeof(buffer)) > 0) {
    }
    const double begin = steady_seconds();
    bridge.manager().take_setpoint(setpoint, now);
    Parser parser;
    bool arrived = false;
    while (!arrived) {
      parser.push(buffer, terminal.read(buffer, sizeof(buffer)));
      while (const auto frame = parser.next()) arrived |= frame->info->id == SetAttitudeTarget::kId;
    }
    ms.push_back(1e3 * (steady_seconds() - begin));
  }
  print_row("px4/setpoint_to_wire", "ms", ms);
}

// The share of the line, computed from the message tables.
void budget() {
  for (const bool mavlink : {true, false}) {
    const auto rows =
        mavlink ? atmos::mavlink_traffic() : atmos::xrce_traffic(atmos::xrce::Firmware::kPx4Space);
    const std::string name = mavlink ? "px4/line_share/" : "px4/xrce_line_share/";
    for (const auto& row : rows)
      std::fprintf(stderr, "  %-24s %s %4.0f B x %5.1f Hz = %7.1f B/s\n", row.message.c_str(),
                   row.to_autopilot ? "to the autopilot" : "from it         ", row.bytes, row.rate_hz,
                   row.bytes * row.rate_hz);
    for (const int baud : {57600, 115200, 460800, 921600}) {
      for (const bool to : {true, false})
        print_row(name + std::to_string(baud) + (to ? "/to_autopilot" : "/from_autopilot"), "1",
                  atmos::line_share(rows, to, baud));
    }
  }
}

// From bytes that come in on a pseudo-terminal to those of the time reply at its other end, polled as the
// node does.
void time_reply() {
  using namespace atmos;
  const std::string device = "/tmp/bench_px4_" + std::to_string(::getpid());
  PseudoTerminal terminal(device);
  const auto port = make_port(device, 921600);
  port->poll(0.0);
  xrce::Endpoint endpoint(xrce::Firmware::kPx4Space, 92160.0,
                          [&](const u8* data, std::size_t size) { port->write(data, size); }, {});
  xrce::MessageBuilder ask({0x81, 0, 0});
  const auto request = xrce::frame(ask.begin(xrce::Submessage::kTimestamp).u32(5).u32(7).message(),
                                   xrce::kClientAddress, xrce::kAgentAddress);
  std::vector<double> ms;
  double now = 1000.0;
  u8 buffer[4096];
  for (int k = 0; k < 20000; ++k) {
    now += 0.01;
    xrce::Deframer deframer(xrce::kAgentAddress, xrce::kClientAddress);
    const double begin = steady_seconds();
    terminal.write(request.data(), request.size());
    for (bool arrived = false; !arrived;) {
      while (const std::size_t size = port->read(buffer, sizeof(buffer))) endpoint.receive(buffer, size, now);
      const std::size_t size = terminal.read(buffer, sizeof(buffer));
      for (std::size_t i = 0; i < size; ++i) arrived |= deframer.push(buffer[i]).has_value();
    }
    ms.push_back(1e3 * (steady_seconds() - begin));
  }
  print_row("px4/xrce_time_reply", "ms", ms);
}

}  // namespace

int main() {
  codec_rate();
  setpoint_to_wire();
  time_reply();
  budget();
  return 0;
}
