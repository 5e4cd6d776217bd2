// For tests: a planar robot, the emulated Pixhawk, a line that can be damaged, and the bridge, all in
// simulated time. Deterministic.
#pragma once

#include <algorithm>
#include <deque>
#include <functional>
#include <random>
#include <utility>
#include <vector>

#include "atmos_model/allocation.h"
#include "atmos_model/valve_schedule.h"
#include "atmos_model/vehicle.h"
#include "atmos_px4_bridge/emulator/pixhawk_emulator.h"
#include "atmos_px4_bridge/px4_bridge.h"

namespace atmos::test {

inline Vehicle bench_vehicle() { return load_vehicle(ATMOS_CONFIG_DIR "/vehicle/atmos.yaml"); }

// One direction of a serial line: bytes arrive after their transmission time at the given rate.
class Line {
 public:
  explicit Line(double bytes_per_s) : byte_s_(1.0 / bytes_per_s) {}
  void write(const mavlink::u8* data, std::size_t size, double now_s) {
    bytes += size;
    for (std::size_t i = 0; i < size; ++i) {
      free_s_ = std::max(free_s_, now_s) + byte_s_;
      mavlink::u8 byte = data[i];
      if (corruption > 0.0 && chance_(random_) < corruption)
        byte ^= static_cast<mavlink::u8>(1u << (random_() % 8));
      if (!unplugged) in_flight_.emplace_back(std::max(free_s_, stalled_until_s), byte);
    }
  }
  std::vector<mavlink::u8> read(double now_s) {
    std::vector<mavlink::u8> out;
    if (now_s < stalled_until_s) return out;
    while (!in_flight_.empty() && in_flight_.front().first <= now_s) {
      out.push_back(in_flight_.front().second);
      in_flight_.pop_front();
    }
    return out;
  }
  void cut() { in_flight_.clear(); }

  double corruption = 0.0;  // share of bytes with one bit turned
  double stalled_until_s = 0.0;
  bool unplugged = false;
  std::uint64_t bytes = 0;

 private:
  double byte_s_, free_s_ = 0.0;
  std::deque<std::pair<double, mavlink::u8>> in_flight_;
  std::mt19937 random_{7};
  std::uniform_real_distribution<double> chance_{0.0, 1.0};
};

// A controller: called once per PWM period with the state, returns a set-point (nothing: it is silent).
struct BodyState {
  Eigen::Vector2d p, v;  // world
  double yaw, yaw_rate;
};
using Law = std::function<std::optional<Setpoint>(double, const BodyState&)>;

inline BridgeConfig bench_config(Firmware firmware, LinkChoice link = LinkChoice::kMavlink) {
  BridgeConfig config = load_bridge(ATMOS_CONFIG_DIR "/px4/bridge.yaml", link);
  if (config.mavlink) config.mavlink->firmware = firmware;
  return config;
}

class FlightBench {
 public:
  static constexpr double kStart = 1234.5, kStep = 0.001;
  static constexpr double kBytesPerSecond = 92160.0;  // 921600 baud, 8N1

  explicit FlightBench(Firmware firmware, Law control, LinkChoice link = LinkChoice::kMavlink)
      : vehicle(bench_vehicle()),
        law(std::move(control)),
        bridge(bench_config(firmware, link), vehicle, {writer(down), writer(xrce_down)}),
        pixhawk(pixhawk_config(firmware), vehicle, writer(up), kStart,
                link == LinkChoice::kMavlink ? PixhawkEmulator::Write() : writer(xrce_up)),
        valves_(static_cast<int>(vehicle.thrusters.size())),
        matrices_(thruster_matrices(vehicle)) {}

  static PixhawkConfig pixhawk_config(Firmware firmware) {
    PixhawkConfig config;
    config.firmware = firmware;
    config.parameters = PixhawkParameters::load(ATMOS_CONFIG_DIR "/px4/pixhawk.yaml");
    config.clock_skew = 2e-5;
    config.clock_exchanges = 50;  // instead of PX4's 500: five seconds less for each start
    return config;
  }

  // `see` is called every millisecond.
  void fly(double duration_s, const std::function<void()>& see = nullptr) {
    const int steps = static_cast<int>(std::lround(duration_s / kStep));
    for (int k = 0; k < steps; ++k) {
      step();
      if (see) see();
    }
  }
  // Until flying; false when it does not come to that within the limit.
  bool take_off(double limit_s = 10.0) {
    bridge.manager().request(true);
    return fly_until([this] { return flying(); }, limit_s);
  }
  bool fly_until(const std::function<bool()>& done, double limit_s) {
    for (double end = now + limit_s; now < end;) {
      step();
      if (done()) return true;
    }
    return false;
  }
  bool flying() const {
    return bridge.manager().status().state == OffboardSession::State::kFlying && pixhawk.armed() &&
           pixhawk.mode() == FlightMode::kOffboard;
  }
  // Valves that are open now.
  int open_valves() const {
    const auto openings = valves_.openings(now);
    return static_cast<int>(
        std::count_if(openings.begin(), openings.end(), [](double o) { return o > 0.0; }));
  }
  // Seconds since a valve was open.
  double closed_for_s() const { return now - open_s_; }
  void reboot() { valves_.add(pixhawk.reboot(now), now); }
  void for_each_line(const std::function<void(Line&)>& act) {
    for (Line* line : {&down, &up, &xrce_down, &xrce_up}) act(*line);
  }
  void unplug() {
    for_each_line([](Line& line) { line.unplugged = true, line.cut(); });
  }
  void plug() {
    for_each_line([](Line& line) { line.unplugged = false; });
    if (bridge.mavlink() != nullptr) bridge.mavlink()->restart();
    if (bridge.xrce() != nullptr) bridge.xrce()->restart();
  }

  Vehicle vehicle;
  double now = kStart;
  BodyState body{{0.0, 0.0}, {0.0, 0.0}, 0.0, 0.0};
  Law law;
  bool odometry_on = true;
  // MAVLink's and XRCE's, to the autopilot and from it.
  Line down{kBytesPerSecond}, up{kBytesPerSecond}, xrce_down{kBytesPerSecond}, xrce_up{kBytesPerSecond};
  Px4Bridge bridge;
  PixhawkEmulator pixhawk;
  BodyWrench disturbance = BodyWrench::Zero();  // force in world axes

 private:
  std::function<void(const std::uint8_t*, std::size_t)> writer(Line& line) {
    return [this, &line](const std::uint8_t* data, std::size_t size) { line.write(data, size, now); };
  }
  void step() {
    now += kStep;
    ++count_;
    const auto to_pixhawk = down.read(now), to_bridge = up.read(now);
    if (bridge.mavlink() != nullptr) bridge.mavlink()->receive(to_bridge.data(), to_bridge.size(), now);
    if (!to_pixhawk.empty()) pixhawk.receive(to_pixhawk.data(), to_pixhawk.size(), now);
    const auto to_client = xrce_down.read(now), to_endpoint = xrce_up.read(now);
    if (bridge.xrce() != nullptr) {
      bridge.xrce()->receive(to_endpoint.data(), to_endpoint.size(), now);
      bridge.xrce()->tick(now);
      pixhawk.receive_xrce(to_client.data(), to_client.size(), now);
    }
    if (count_ % 10 == 0 && odometry_on) bridge.manager().take_odometry(odometry(), now);
    // 20 ms before the period begins, as the controller does.
    if (count_ % 100 == 80) {
      if (const auto setpoint = law(now, body)) bridge.manager().take_setpoint(*setpoint, now);
    }
    if (count_ % 20 == 0) bridge.tick(now);
    if (count_ % 4 == 0) {
      pixhawk.sense({0.0, 0.0, body.yaw_rate}, {0.0, 0.0, 9.81});
      if (const auto order = pixhawk.tick(now)) valves_.add(*order, now);
    }
    move();
  }

  OdometrySample odometry() const {
    OdometrySample sample;
    sample.stamp_s = now;
    sample.p_WB << body.p, 0.0;
    sample.q_WB = Eigen::AngleAxisd(body.yaw, Eigen::Vector3d::UnitZ());
    sample.v_WB_B << Eigen::Rotation2Dd(-body.yaw) * body.v, 0.0;
    sample.w_WB_B.z() = body.yaw_rate;
    sample.pose_covariance.diagonal().setConstant(1e-6);
    sample.twist_covariance.diagonal().setConstant(1e-5);
    return sample;
  }

  void move() {
    const auto openings = valves_.openings(now);
    Eigen::VectorXd thrust(static_cast<Eigen::Index>(openings.size()));
    for (std::size_t i = 0; i < openings.size(); ++i) {
      thrust[static_cast<Eigen::Index>(i)] = openings[i] * vehicle.thrusters[i].force_n;
      if (openings[i] > 0.0) open_s_ = now;
    }
    const Eigen::Vector3d force_B = matrices_.D * thrust, torque_B = matrices_.L * thrust;
    const Eigen::Vector2d force_W = Eigen::Rotation2Dd(body.yaw) * force_B.head<2>() + disturbance.head<2>();
    body.v += force_W / vehicle.mass_kg * kStep;
    body.p += body.v * kStep;
    body.yaw_rate += (torque_B.z() + disturbance.z()) / vehicle.inertia_kg_m2.z() * kStep;
    body.yaw += body.yaw_rate * kStep;
    if (count_ % 1000 == 0) valves_.forget_before(now - 1.0);
  }

  ValveSchedule valves_;
  AllocationMatrices matrices_;
  double open_s_ = -1e9;
  long count_ = 0;
};

// A PD law that goes to a pose, at the level asked for.
inline Law go_to(Level level, const Eigen::Vector2d& p, double yaw) {
  const auto allocator = std::make_shared<Allocator>(bench_vehicle());
  return [=](double, const BodyState& body) {
    const double kMass = 16.8, kInertia = 0.297;
    const Eigen::Vector2d a = 0.25 * (p - body.p) - 0.9 * body.v;
    const Eigen::Vector2d f =
        Eigen::Rotation2Dd(-body.yaw) * Eigen::Vector2d((kMass * a).array().max(-1.5).min(1.5));
    const double error = std::remainder(yaw - body.yaw, 2.0 * M_PI);
    const double torque = std::clamp(kInertia * (1.0 * error - 2.0 * body.yaw_rate), -0.3, 0.3);
    Setpoint setpoint;
    setpoint.level = level;
    setpoint.force_B << f, 0.0;
    switch (level) {
      case Level::kPosition:
        setpoint.p_WB << p, std::numeric_limits<double>::quiet_NaN();
        setpoint.yaw = yaw;
        break;
      case Level::kAttitude:
        setpoint.q_WB = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ());
        break;
      case Level::kRate:
        setpoint.w_WB_B = {0.0, 0.0, std::clamp(0.6 * error, -0.5, 0.5)};
        break;
      case Level::kWrench:
        setpoint.torque_B.z() = torque;
        break;
      case Level::kThrusters:
        setpoint.duty = allocator->allocate({f.x(), f.y(), torque}).duty;
        break;
    }
    return setpoint;
  };
}

}  // namespace atmos::test
