// The endpoint and the emulated client of PX4, which share no code, over a line that loses, damages and
// delays frames. Simulated time; every run has its seed.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <memory>
#include <random>

#include "atmos_px4_bridge/emulator/uorb_messages.h"
#include "atmos_px4_bridge/emulator/uxrce_client.h"
#include "atmos_px4_bridge/xrce/endpoint.h"

namespace atmos::xrce {
namespace {

constexpr double kStart = 1234.5, kBytesPerSecond = 92160.0;

const std::vector<UxrceClient::Topic> kReaders = {
    {"register_ext_component_request", "RegisterExtComponentRequest"},
    {"offboard_control_mode", "OffboardControlMode"},
    {"trajectory_setpoint", "TrajectorySetpoint"},
    {"vehicle_attitude_setpoint", "VehicleAttitudeSetpoint"},
    {"vehicle_mocap_odometry", "VehicleOdometry"},
    {"vehicle_rates_setpoint", "VehicleRatesSetpoint"},
    {"vehicle_visual_odometry", "VehicleOdometry"},
    {"vehicle_command", "VehicleCommand"},
    {"vehicle_thrust_setpoint", "VehicleThrustSetpoint"},
    {"vehicle_torque_setpoint", "VehicleTorqueSetpoint"},
    {"actuator_motors", "ActuatorMotors"},
    {"actuator_servos", "ActuatorServos"}};

// With as many readers as PX4Space has.
std::vector<UxrceClient::Topic> readers() {
  std::vector<UxrceClient::Topic> all = kReaders;
  while (all.size() < 28) all.push_back({"actuator_servos", "ActuatorServos"});
  return all;
}

// One direction: a frame is lost as a whole; the others take their time, byte by byte.
class Wire {
 public:
  Wire(double loss, unsigned seed) : loss_(loss), random_(seed) {}
  void write(const std::uint8_t* data, std::size_t size, double now_s) {
    if (cut || chance_(random_) < loss_) return;
    for (std::size_t i = 0; i < size; ++i) {
      free_s_ = std::max(free_s_, now_s) + 1.0 / kBytesPerSecond;
      bytes_.emplace_back(free_s_, data[i]);
    }
    written += size;
  }
  Bytes read(double now_s) {
    Bytes out;
    for (; !bytes_.empty() && bytes_.front().first <= now_s; bytes_.pop_front())
      out.push_back(bytes_.front().second);
    return out;
  }
  bool cut = false;
  std::uint64_t written = 0;

 private:
  double loss_, free_s_ = 0.0;
  std::mt19937 random_;
  std::uniform_real_distribution<double> chance_{0.0, 1.0};
  std::deque<std::pair<double, std::uint8_t>> bytes_;
};

struct Bench {
  explicit Bench(double loss = 0.0, unsigned seed = 1, int clock_exchanges = 500, double step = 0.001)
      : step_s(step), down(loss, 2 * seed), up(loss, 2 * seed + 1), exchanges(clock_exchanges) {
    start_endpoint();
    start_client();
  }
  void start_endpoint() {
    endpoint = std::make_unique<Endpoint>(
        Firmware::kPx4Space, kBytesPerSecond,
        [this](const std::uint8_t* data, std::size_t size) { down.write(data, size, now); },
        Endpoint::Listener{nullptr, [this](Topic, ByteView, double) { ++samples; }, nullptr,
                           [this](const std::string& fault) { faults.push_back(fault); }});
  }
  void start_client() {
    boot_s = now;
    client = std::make_unique<UxrceClient>(
        UxrceClient::Config{readers(), exchanges},
        [this](const std::uint8_t* data, std::size_t size) { up.write(data, size, now); },
        [this](const std::string& topic, const std::uint8_t*, std::size_t) { ++delivered, last = topic; });
  }
  void step() {
    now += step_s;
    const Bytes to_px4 = down.read(now), to_us = up.read(now);
    client->receive(to_px4.data(), to_px4.size(), now - boot_s + 1.0);
    client->tick(now - boot_s + 1.0);
    endpoint->receive(to_us.data(), to_us.size(), now);
    endpoint->tick(now);
  }
  bool until(const std::function<bool()>& done, double limit_s) {
    for (const double end = now + limit_s; now < end;) {
      step();
      if (done()) return true;
    }
    return false;
  }
  void pass(double duration_s) {
    until([] { return false; }, duration_s);
  }
  void send_odometry() {
    endpoint->send(Endpoint::Slot::kOdometry, {{Topic::kVisualOdometry, Bytes(114, 0)}}, now);
  }
  void send_setpoint() {
    endpoint->send(Endpoint::Slot::kSetpoint,
                   {{Topic::kOffboardControlMode, Bytes(15, 0)}, {Topic::kActuatorMotors, Bytes(68, 0)}},
                   now);
  }
  // What PX4Space publishes at 100 Hz, and its status.
  void publish() {
    const double clock_s = now - boot_s + 1.0;
    const std::uint8_t zeros[256] = {};
    for (const auto& [name, type, size] : {std::tuple{"vehicle_status", "VehicleStatus", 82},
                                           {"sensor_combined", "SensorCombined", 48},
                                           {"vehicle_angular_velocity", "VehicleAngularVelocity", 40},
                                           {"vehicle_attitude", "VehicleAttitude", 49},
                                           {"vehicle_local_position", "VehicleLocalPosition", 200},
                                           {"vehicle_odometry", "VehicleOdometry", 114}})
      client->publish({name, type}, zeros, static_cast<std::size_t>(size), clock_s);
  }
  bool all_there() const {
    return client->readers_alive() == 28 && endpoint->state() == Endpoint::State::kReady;
  }

  double now = kStart, boot_s = kStart, step_s;
  Wire down, up;  // to PX4, from it
  int exchanges;
  std::unique_ptr<Endpoint> endpoint;
  std::unique_ptr<UxrceClient> client;
  std::uint64_t samples = 0, delivered = 0;
  std::string last;
  std::vector<std::string> faults;
};

TEST(Handshake, TakesAFewTensOfMillisecondsOnAGoodLine) {
  Bench bench;
  EXPECT_TRUE(bench.until([&] { return bench.client->readers_alive() == 28; }, 0.5));
  EXPECT_TRUE(bench.until([&] { return bench.all_there(); }, 0.5));
  EXPECT_FALSE(bench.client->stream_destroyed());
  std::printf("set up and quiet after %.3f s\n", bench.now - kStart);
}

class Loss : public ::testing::TestWithParam<double> {};

TEST_P(Loss, EveryTopicIsThereIn100Of100Runs) {
  int whole = 0;
  double longest = 0.0;
  std::uint64_t forced = 0;
  for (unsigned seed = 1; seed <= 100; ++seed) {
    Bench bench(GetParam(), seed);
    if (bench.until([&] { return bench.all_there() || bench.client->phase() == UxrceClient::Phase::kEnded; },
                    30.0) &&
        bench.all_there())
      ++whole;
    EXPECT_FALSE(bench.client->stream_destroyed()) << seed;
    longest = std::max(longest, bench.now - kStart);
    forced += bench.endpoint->counters().forced;
  }
  EXPECT_EQ(whole, 100);
  std::printf(
      "%.0f %% of the frames lost in both directions: %d of 100, longest %.2f s, %lu sessions begun anew\n",
      100.0 * GetParam(), whole, longest, static_cast<unsigned long>(forced));
}

INSTANTIATE_TEST_SUITE_P(Handshake, Loss, ::testing::Values(0.05, 0.10, 0.20));

// --- losing each other ---

class Reconnection : public ::testing::Test {
 protected:
  Reconnection() : bench(0.0, 1, 50) {
    fly(3.0);
    EXPECT_TRUE(flies());
  }
  // Odometry and set-points, and whether they arrive at the end.
  void fly(double duration_s) {
    int k = 0;
    bench.until(
        [&] {
          if (++k % 10 == 0) bench.send_odometry(), bench.publish();
          if (k % 20 == 0) bench.send_setpoint();
          return false;
        },
        duration_s);
  }
  bool flies() {
    const std::uint64_t before = bench.delivered, samples = bench.samples;
    fly(0.2);
    return bench.delivered >= before + 35 && bench.samples > samples;
  }
  // Seconds until set-points arrive again.
  double recovery(double limit_s) {
    for (const double begin = bench.now; bench.now < begin + limit_s;) {
      if (flies()) return bench.now - begin;
    }
    return limit_s;
  }
  Bench bench;
};

TEST_F(Reconnection, AfterACableUnpluggedFor3s) {
  bench.down.cut = bench.up.cut = true;
  fly(3.0);
  bench.down.cut = bench.up.cut = false;
  const double s = recovery(10.0);
  std::printf("3 s unplugged: flies again after %.1f s\n", s);
  EXPECT_LT(s, 6.0);
}

TEST_F(Reconnection, AfterALongSilence) {
  bench.down.cut = bench.up.cut = true;
  fly(20.0);
  bench.down.cut = bench.up.cut = false;
  EXPECT_LT(recovery(10.0), 6.0);
  EXPECT_EQ(bench.client->sessions(), 2);
}

TEST_F(Reconnection, AfterARebootOfPx4) {
  for (int k = 0; k < 3; ++k) {
    bench.start_client();
    const double s = recovery(10.0);
    std::printf("PX4 rebooted: flies again after %.1f s\n", s);
    EXPECT_LT(s, 4.0);
  }
  EXPECT_EQ(bench.endpoint->counters().sessions, 4u);
}

TEST_F(Reconnection, AfterARestartOfOurs) {
  bench.start_endpoint();
  const double s = recovery(10.0);
  std::printf("endpoint restarted: flies again after %.1f s\n", s);
  EXPECT_LT(s, 8.0);
  EXPECT_EQ(bench.client->sessions(), 2);
}

TEST_F(Reconnection, WhileTheClockIsBeingSet) {
  bench.exchanges = 500;
  bench.start_client();
  ASSERT_TRUE(bench.until([&] { return bench.client->phase() == UxrceClient::Phase::kClock; }, 2.0));
  bench.start_endpoint();
  EXPECT_LT(recovery(30.0), 20.0) << "time is answered without a session, too";
}

// A client that did not get a reader never creates it again: the session is dropped.
TEST(Repair, ATopicThatIsDeadLeadsToANewSession) {
  Bench bench(0.0, 1, 50);
  ASSERT_TRUE(bench.until([&] { return bench.client->readers_alive() == 5; }, 0.5));
  bench.down.cut = bench.up.cut = true;
  bench.pass(1.1);  // longer than the client waits
  bench.down.cut = bench.up.cut = false;
  EXPECT_TRUE(bench.until([&] { return bench.all_there(); }, 20.0));
  EXPECT_GE(bench.client->sessions(), 2);
  EXPECT_FALSE(bench.client->stream_destroyed());
}

// The recovered client itself: without repairs by the endpoint it would lose topics, and an acknowledgement
// that moves backwards destroys its stream.
TEST(EmulatedClient, HasTheWeaknessThatTheEndpointGuardsAgainst) {
  Bench bench;
  ASSERT_TRUE(bench.until([&] { return bench.client->readers_alive() == 10; }, 0.5));
  MessageBuilder back({0x81, kNoStream, 0});
  back.begin(Submessage::kAcknack).u16(1).u16(0).u8(kReliable);
  const Bytes line = frame(back.message(), kAgentAddress, kClientAddress);
  bench.client->receive(line.data(), line.size(), bench.now - bench.boot_s + 1.0);
  EXPECT_TRUE(bench.client->stream_destroyed());
}

// --- time and load ---

TEST(Load, TimeIsAnsweredWithin2msAndBurstsStayBelow256Bytes) {
  // All of PX4's topics at 100 Hz, odometry at 100 Hz, set-points at 60 Hz, and the time asked for 90 times a
  // second.
  constexpr double kStep = 0.0002;
  Bench bench(0.0, 1, 20, kStep);
  int k = 0;
  const auto traffic = [&] {
    ++k;
    if (k % 50 == 0) bench.publish();
    if (k % 50 == 7) bench.send_odometry();
    if (k % 83 == 11) bench.send_setpoint();
    return false;
  };
  bench.until(traffic, 4.0);
  ASSERT_EQ(bench.client->phase(), UxrceClient::Phase::kRunning);

  constexpr double kWindow = 0.005;
  std::deque<std::pair<double, std::size_t>> recent;  // frames to PX4 within the window
  std::size_t in_window = 0, most_in_window = 0;
  double waiting = 0.0, drained_s = bench.now, most_waiting = 0.0, latest = 0.0, line_free_s = 0.0;
  double asked_s = -1.0;
  int answers = 0;
  Deframer deframer(kAgentAddress, kClientAddress);
  bench.endpoint = nullptr;  // a new one, whose frames are looked at
  std::vector<double> latencies;
  bench.endpoint = std::make_unique<Endpoint>(
      Firmware::kPx4Space, kBytesPerSecond,
      [&](const std::uint8_t* data, std::size_t size) {
        // The receive buffer of a flight controller that reads 46 kB/s (half of the line) when it comes to
        // it.
        waiting = std::max(0.0, waiting - (bench.now - drained_s) * 0.5 * kBytesPerSecond) +
                  static_cast<double>(size);
        drained_s = bench.now;
        most_waiting = std::max(most_waiting, waiting);
        recent.emplace_back(bench.now, size);
        in_window += size;
        for (; recent.front().first < bench.now - kWindow; recent.pop_front())
          in_window -= recent.front().second;
        most_in_window = std::max(most_in_window, in_window);
        const double begins_s = std::max(line_free_s, bench.now);
        line_free_s = begins_s + static_cast<double>(size) / kBytesPerSecond;
        for (std::size_t i = 0; i < size; ++i) {
          const auto m = deframer.push(data[i]);
          if (m && m->size > 4 && m->data[4] == 15 && asked_s > 0.0) {
            latencies.push_back(begins_s - asked_s);
            latest = std::max(latest, begins_s - asked_s);
            ++answers;
            asked_s = -1.0;
          }
        }
        bench.down.write(data, size, bench.now);
      },
      Endpoint::Listener{});
  ASSERT_TRUE(
      bench.until([&] { return traffic() || bench.endpoint->state() == Endpoint::State::kReady; }, 20.0));
  bench.until(traffic, 3.0);
  const std::uint64_t down = bench.down.written, up = bench.up.written;
  latencies.clear(), latest = most_waiting = 0.0, answers = 0, most_in_window = 0;
  constexpr double kDuration = 10.0;
  for (const double end = bench.now + kDuration; bench.now < end;) {
    bench.step();
    traffic();
    if (k % 55 != 0) continue;
    MessageBuilder ask({0x81, kNoStream, 0});
    const Bytes line =
        frame(ask.begin(Submessage::kTimestamp).u32(5).u32(7).message(), kClientAddress, kAgentAddress);
    asked_s = bench.now;
    bench.endpoint->receive(line.data(), line.size(), bench.now);
  }
  EXPECT_GT(answers, 800);
  EXPECT_LT(latest, 0.002);
  EXPECT_LT(most_waiting, 256.0);
  std::sort(latencies.begin(), latencies.end());
  std::printf(
      "time replies begin after %.2f ms (median), %.2f ms (largest of %d); receive buffer at most %.0f B, "
      "%zu B in 5 ms;\n"
      "to PX4 %.1f kB/s, from it %.1f kB/s of %.1f\n",
      1e3 * latencies[latencies.size() / 2], 1e3 * latest, answers, most_waiting, most_in_window,
      1e-3 * static_cast<double>(bench.down.written - down) / kDuration,
      1e-3 * static_cast<double>(bench.up.written - up) / kDuration, 1e-3 * kBytesPerSecond);
  EXPECT_LT(static_cast<double>(bench.down.written - down) / kDuration, 0.5 * kBytesPerSecond);
  EXPECT_LT(static_cast<double>(bench.up.written - up) / kDuration, 0.8 * kBytesPerSecond);
}

}  // namespace
}  // namespace atmos::xrce
