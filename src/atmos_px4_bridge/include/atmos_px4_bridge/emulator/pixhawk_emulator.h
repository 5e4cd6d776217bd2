// A Pixhawk with PX4Space as far as its serial lines show it: MAVLink, uxrce_dds_client, arming and modes,
// offboard rules, estimator input, cascade, PWM. Stands in for the hardware behind the very bridge that flies
// it (docs/px4_bridge.md, "Emulator"). Times are ROS seconds; the emulated autopilot has a clock of its own.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>

#include "atmos_model/valve_schedule.h"
#include "atmos_model/vehicle.h"
#include "atmos_px4_bridge/cascade.h"
#include "atmos_px4_bridge/emulator/pixhawk_parameters.h"
#include "atmos_px4_bridge/emulator/uxrce_client.h"
#include "atmos_px4_bridge/emulator/vision_estimator.h"
#include "atmos_px4_bridge/mavlink/codec.h"
#include "atmos_px4_bridge/mavlink/mavlink_link.h"

namespace atmos {

struct PixhawkConfig {
  Firmware firmware = Firmware::kStock;
  PixhawkParameters parameters;
  double pwm_phase_s = 0.02;    // of the PWM edges after whole multiples of the period in ROS time
  double latch_lead_s = 0.016;  // before an edge: the simulator must have the order when the period begins
  double clock_skew = 0.0;      // s/s, of the autopilot's clock
  int clock_exchanges = 500;    // of the XRCE client, before it runs
};

class PixhawkEmulator {
 public:
  using Write = std::function<void(const mavlink::u8*, std::size_t)>;

  // `xrce`: where the bytes of uxrce_dds_client go; empty when it is not started (UXRCE_DDS_CFG 0).
  PixhawkEmulator(const PixhawkConfig& config, const Vehicle& vehicle, Write write, double now_s,
                  Write xrce = nullptr);

  void receive(const mavlink::u8* data, std::size_t size, double now_s);
  void receive_xrce(const std::uint8_t* data, std::size_t size, double now_s);
  // The inertial sensors, body FLU [rad/s, m/s^2].
  void sense(const Eigen::Vector3d& gyro_B, const Eigen::Vector3d& acceleration_B);
  void take_battery(double voltage_v, double share) { voltage_v_ = voltage_v, charge_ = share; }

  // Runs control and streams up to now; at 100 Hz or more. Returns the order to the valves of the period
  // whose latch has passed.
  std::optional<ThrusterCommand> tick(double now_s);
  // Power off and on: disarmed, manual, clock at zero, parameters kept. Valves close at once.
  ThrusterCommand reboot(double now_s);

  bool armed() const { return armed_; }
  FlightMode mode() const { return mode_; }
  const PixhawkParameters& parameters() const { return config_.parameters; }
  std::uint64_t ignored() const { return ignored_; }  // set-points without an effect on this firmware
  // Set-points by XRCE outside offboard mode, or of a level that the mode message does not name. PX4 takes
  // them all the same, against its own controllers.
  std::uint64_t stray() const { return stray_; }
  const UxrceClient* xrce() const { return xrce_ ? &*xrce_ : nullptr; }

 private:
  // Seconds since power on; the line is served from the first second on.
  double clock(double now_s) const { return 1.0 + (now_s - boot_s_) * (1.0 + config_.clock_skew); }
  template <class Message>
  void send(const Message& message);
  void say(mavlink::u8 severity, const std::string& text);
  void dispatch(const mavlink::Frame& frame, double now_s);
  void on_odometry(const mavlink::Odometry& message, double now_s);
  void on_attitude_target(const mavlink::SetAttitudeTarget& message, double now_s);
  void on_position_target(const mavlink::SetPositionTargetLocalNed& message, double now_s);
  void on_actuator_controls(const mavlink::SetActuatorControlTarget& message, double now_s);
  mavlink::u8 run_command(const mavlink::CommandLong& message, double now_s);
  mavlink::u8 set_mode(FlightMode mode, double now_s);
  mavlink::u8 arm(bool arm, bool force, double now_s);
  void offboard_alive(double now_s);
  void check_failsafes(double now_s);
  Setpoint manual_setpoint(double now_s);
  void control(double now_s);
  void stream(double now_s);
  void send_stream(mavlink::u32 id, double now_s);
  void report_parameter(const std::string& name);
  void start_xrce();
  void on_uorb(const std::string& topic, const std::uint8_t* payload, std::size_t size, double now_s);
  void take_uorb_setpoint(Level level, double now_s);
  std::uint64_t agent_us(double clock_s) const;
  template <class Message>
  void publish(const UxrceClient::Topic& topic, Message message, double clock_s);
  void publish_all(double now_s);
  bool for_us(mavlink::u8 system, mavlink::u8 component) const;
  static constexpr double kNever = -std::numeric_limits<double>::infinity();

  PixhawkConfig config_;
  Vehicle vehicle_;
  Write write_;
  double boot_s_;
  mavlink::Parser parser_;
  mavlink::u8 sequence_ = 0;
  Cascade cascade_;
  VisionEstimator estimator_;
  Eigen::Vector3d gyro_B_ = Eigen::Vector3d::Zero(), acceleration_B_ = Eigen::Vector3d::Zero();
  double voltage_v_ = 25.2, charge_ = 1.0;

  bool armed_ = false;
  FlightMode mode_ = FlightMode::kManual;
  Setpoint offboard_;
  double offboard_s_ = kNever,
         offboard_since_ = kNever;  // newest proof of life, begin of the unbroken stream
  mavlink::ManualControl sticks_;
  double sticks_s_ = kNever;
  Setpoint hold_;  // of position and stabilised mode
  bool holding_ = false;
  double hold_yaw_ = 0.0, control_s_ = kNever;
  std::optional<double> clock_offset_;  // sender's time minus ours, from TIMESYNC
  std::vector<double> test_duty_;       // actuator test
  double test_until_s_ = kNever;
  bool battery_told_ = false;

  std::vector<double> duty_;
  double next_edge_s_;
  std::map<mavlink::u32, double> interval_s_, streamed_s_;
  std::uint64_t ignored_ = 0, stray_ = 0;

  Write xrce_write_;
  std::optional<UxrceClient> xrce_;
  std::map<Level, Setpoint> uorb_;   // newest of each level
  std::optional<Level> uorb_level_;  // of the newest mode message
  double published_s_ = kNever, status_s_ = kNever, slow_s_ = kNever;
  bool status_armed_ = false;
  FlightMode status_mode_ = FlightMode::kUnknown;
  double receiving_s_ = 0.0;
};

}  // namespace atmos
