// The flight controller's rules: which command the valves carry out in which PWM period, and when they are
// closed (docs/architecture.md, "The PWM grid" and "Loss of frames").
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>

#include "atmos_model/actuator_model.h"
#include "atmos_model/allocator.h"
#include "atmos_model/valve_schedule.h"
#include "atmos_model/vehicle.h"
#include "atmos_px4_bridge/flight_controller_config.h"

namespace atmos {

// Who decides when a period without a command is over.
enum class Pacing {
  // The flight controller owns the PWM clock: every period gets an order, by tick() if no command came.
  kRealTime,
  // The simulator waits for the answer to every command, so that only stamps count and the clock is never
  // looked at.
  // The age of odometry is then the controller's rule alone: it judges the very odometry that its command
  // rests on,
  // whereas here odometry and command arrive over two connections, and which came first would differ from run
  // to run.
  kLockstep,
};

// What the valves were told for the period that starts at stamp_s, and why.
struct FlightStatus {
  double stamp_s = 0.0;
  bool flying = false;
  std::string reason;           // empty while flying, else the rule that closed the valves
  std::uint64_t commands = 0;   // counters since start: everything that arrived
  std::uint64_t late = 0;       // arrived after their period began: act for the rest of it
  std::uint64_t expired = 0;    // arrived after their period, or after a newer one: not carried out
  std::uint64_t malformed = 0;  // wrong size, not finite, out of range, off the PWM grid: not carried out
  std::uint64_t scaled = 0;     // wrenches beyond what the thrusters can do
};

// One order to the valves; a later one for the same period replaces the rest of it.
struct ValveOrder {
  ThrusterCommand command;
  FlightStatus status;
};

// Times are ROS seconds. Bad data never throws: it is counted, and the valves close.
class FlightController {
 public:
  static constexpr double kGrid_s = 1e-3;          // a stamp may lie this far from the PWM grid
  static constexpr double kGrace_s = 0.02;         // a command may come this long after its period's start
  static constexpr double kOdometryLimit_s = 0.5;  // older odometry closes the valves

  FlightController(const Vehicle& vehicle, const FlightControllerConfig& config, Pacing pacing);

  // Takes a command that arrived at `now_s`. Returns the order to pass on at once; nothing when the command
  // is not carried out (in real time tick() then closes the period; in lockstep that period has been answered
  // before). In real time valves close at the very instant at which odometry becomes older than the limit:
  // pulses that would last longer are cut there, so that the order that is recorded says what the valves did.
  std::optional<ValveOrder> take_command(const ThrusterCommand& command, double now_s);

  // The same with a planar body wrench [N, N m] for the period that starts at stamp_s: the allocator turns it
  // into duties. A wrench beyond what the thrusters can do is scaled along its direction and counted. With a
  // model the thrusters are those of the model (dead, weak, coupled), and the wrench is about its centre of
  // mass.
  std::optional<ValveOrder> take_wrench(double stamp_s, const BodyWrench& wrench, double now_s);

  // The same with a planar body force [N] and a yaw rate [rad/s]: the rate loop turns the rate into a torque.
  // The force is scaled along with the torque where the thrusters cannot give both.
  std::optional<ValveOrder> take_rate(double stamp_s, const Eigen::Vector2d& force, double yaw_rate,
                                      double now_s);

  // Notes odometry stamped `stamp_s`, with the robot's yaw rate [rad/s], that arrived at `now_s`; a stamp
  // ahead of the clock counts as of now.
  void take_odometry(double stamp_s, double yaw_rate, double now_s);

  // To be called a few times per period in real time: closes the valves for the current period when no
  // command came within kGrace_s of its start, once per period.
  std::optional<ValveOrder> tick(double now_s);

  // Counters, and the state of the newest order.
  const FlightStatus& status() const { return status_; }

 private:
  // The common part of every level: a command, and the fault found in it.
  std::optional<ValveOrder> take(const ThrusterCommand& command, const std::string& fault, double now_s);
  // Empty, or the rule that the command breaks.
  std::string fault_in(const ThrusterCommand& command, double now_s) const;
  // Empty, or why odometry closes the valves at `time_s`.
  std::string odometry_fault(double time_s) const;
  double period_start(double time_s) const;
  ValveOrder order(ThrusterCommand command, const std::string& reason);
  ValveOrder closed(double stamp_s, const std::string& reason);
  void notice_restart(double now_s);

  std::size_t thruster_count_;
  Actuation actuation_;
  std::optional<ActuatorModel> model_;
  Allocator allocator_;   // of the vehicle as the model has it
  ValveSchedule orders_;  // what the model's supply has had to give
  Pid rate_;
  Pwm pwm_;
  Pacing pacing_;
  FlightStatus status_;
  std::string last_fault_;  // of a malformed command since the last order
  double newest_stamp_ = -std::numeric_limits<double>::infinity();  // of the orders given
  double odometry_stamp_ = -std::numeric_limits<double>::infinity();
  double measured_yaw_rate_ = 0.0, measured_stamp_ = -std::numeric_limits<double>::infinity();
  double last_now_ = -std::numeric_limits<double>::infinity();
};

}  // namespace atmos
