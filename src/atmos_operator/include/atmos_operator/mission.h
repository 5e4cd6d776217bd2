// A mission: a program of set-points and trajectories that can be started, stopped where the robot is, and
// started again.
#pragma once

#include <optional>
#include <vector>

#include "atmos_model/scenario.h"
#include "atmos_operator/setpoint_player.h"

namespace atmos {

struct MissionProgram {
  std::vector<SetPoint> set_points;              // as the readers return them: not empty, first at 0
  std::vector<TrajectorySettings> trajectories;  // may be empty
};

// A trajectory of a run that began at t0: the part from `from_s` after its own start to its end.
struct StampedTrajectory {
  TrajectorySettings settings;
  double t0 = 0.0;      // ROS seconds
  double from_s = 0.0;  // >= 0

  double stamp() const { return t0 + settings.time_s + from_s; }
};

// What is to be published, in this order.
struct MissionOrders {
  std::vector<StampedSetPoint> points;
  std::vector<StampedTrajectory> trajectories;
};

enum class MissionState { kIdle, kRunning, kFinished, kStopped };
const char* name_of(MissionState state);  // "idle", "running", "finished", "stopped"

// Times are ROS seconds. A listener keeps what was announced to it until something with the same stamp comes
// later; so everything that was announced for the future is remembered here, and replaced when plans change.
class Mission {
 public:
  explicit Mission(MissionProgram program) : program_(std::move(program)) {}

  // Begins the program at `now`, whether or not it has run before.
  MissionOrders start(double now);
  // Ends the program: `hold` (its stamp is not read) holds from now on. Nothing to do unless running or
  // finished.
  MissionOrders stop(double now, const StampedSetPoint& hold);
  // What has become due: every set-point that holds, and the one after it. To be asked a few times a second.
  MissionOrders due(double now);
  // What somebody who starts to listen at `now` must be told.
  MissionOrders announced(double now) const;

  // kFinished: the last set-point holds and the last trajectory is over.
  MissionState state(double now) const;
  // The set-point of the program that holds; none before the first start or once stopped.
  std::optional<StampedSetPoint> in_force(double now) const;

 private:
  StampedTrajectory run_of(const TrajectorySettings& settings) const { return {settings, t0_, 0.0}; }
  void remember(const MissionOrders& orders);
  // Stamps after `now` for which something has been announced.
  std::vector<double> pending(double now) const;

  MissionProgram program_;
  double t0_ = 0.0;
  std::optional<SetpointPlayer> player_;  // while there is a run
  std::optional<StampedSetPoint> hold_;   // once stopped
  std::vector<double> announced_stamps_;
};

}  // namespace atmos
