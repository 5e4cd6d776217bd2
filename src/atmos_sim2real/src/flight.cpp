#include "atmos_sim2real/flight.h"

#include <algorithm>
#include <cmath>

namespace atmos {

namespace {

// Cubic Hermite interpolation over an interval of length dt.
double hermite(double p0, double v0, double p1, double v1, double dt, double s) {
  const double s2 = s * s, s3 = s2 * s;
  return (2 * s3 - 3 * s2 + 1) * p0 + (s3 - 2 * s2 + s) * dt * v0 + (-2 * s3 + 3 * s2) * p1 +
         (s3 - s2) * dt * v1;
}

// What drives one axis from frame to frame: velocity changes and ways that forces make along a motion, whose
// velocity is `along`, and how fast those forces bring another velocity back to it [1/s]; white acceleration
// of intensity q per interval [m^2/s^3].
struct Drive {
  std::vector<double> dv, dp, along, damping, q;
};

// Rauch-Tung-Striebel smoother of [position, velocity].
void smooth_axis(const std::vector<double>& times, const std::vector<double>& measured, double variance,
                 const Drive& drive, std::vector<double>& position, std::vector<double>& velocity) {
  const std::size_t n = times.size();
  std::vector<Eigen::Matrix2d> F(n, Eigen::Matrix2d::Identity());
  std::vector<Eigen::Vector2d> x_filtered(n), x_predicted(n);
  std::vector<Eigen::Matrix2d> P_filtered(n), P_predicted(n);
  Eigen::Vector2d x(measured[0], 0.0);
  Eigen::Matrix2d P = Eigen::Vector2d(1e2, 1e1).asDiagonal();
  for (std::size_t i = 0; i < n; ++i) {
    x_predicted[i] = x;
    P_predicted[i] = P;
    const Eigen::Vector2d K = P.col(0) / (P(0, 0) + variance);
    x += K * (measured[i] - x[0]);
    P -= K * P.row(0).eval();
    x_filtered[i] = x;
    P_filtered[i] = P;
    if (i + 1 == n) break;
    const double dt = times[i + 1] - times[i], b = drive.damping[i], q = drive.q[i];
    const double kept = std::exp(-b * dt), way = b * dt > 1e-6 ? (1.0 - kept) / b : dt;
    F[i] << 1, way, 0, kept;
    x = F[i] * x + Eigen::Vector2d((dt - way) * drive.along[i] + drive.dp[i],
                                   (1.0 - kept) * drive.along[i] + drive.dv[i]);
    P = F[i] * P * F[i].transpose();
    P(0, 0) += q * dt * dt * dt / 3.0;
    P(0, 1) += q * dt * dt / 2.0;
    P(1, 0) += q * dt * dt / 2.0;
    P(1, 1) += q * dt;
  }
  position.assign(n, 0.0);
  velocity.assign(n, 0.0);
  Eigen::Vector2d smoothed = x_filtered[n - 1];
  position[n - 1] = smoothed[0];
  velocity[n - 1] = smoothed[1];
  for (std::size_t i = n - 1; i-- > 0;) {
    const Eigen::Matrix2d G = P_filtered[i] * F[i].transpose() * P_predicted[i + 1].inverse();
    smoothed = x_filtered[i] + G * (smoothed - x_predicted[i + 1]);
    position[i] = smoothed[0];
    velocity[i] = smoothed[1];
  }
}

std::vector<Frame> each_alone(const std::vector<PoseSample>& poses) {
  std::vector<Frame> frames;
  for (const PoseSample& pose : poses) frames.push_back({pose, 0.0});
  return frames;
}

// Means of consecutive poses, so many that about 50 a second remain; never over more than the time that these
// take, so that a gap stays one.
std::vector<Frame> averaged(const std::vector<PoseSample>& poses) {
  constexpr double kFrame = 0.02;  // s: a push bends the motion by microns meanwhile
  if (poses.size() < 2) return each_alone(poses);
  std::vector<double> steps;
  for (std::size_t i = 1; i < poses.size(); ++i) steps.push_back(poses[i].time_s - poses[i - 1].time_s);
  const auto middle = steps.begin() + static_cast<long>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  const double step = *middle;
  const auto together = static_cast<std::size_t>(kFrame / step + 0.25);
  if (together < 2) return each_alone(poses);
  const double longest = (static_cast<double>(together) + 0.5) * step;
  std::vector<Frame> means;
  for (std::size_t begin = 0, end = 0; begin < poses.size(); begin = end) {
    PoseSample sum{0.0, 0.0, 0.0, 0.0};
    double squares = 0.0;  // s^2
    const PoseSample& first = poses[begin];
    for (; end < poses.size() && end - begin < together && poses[end].time_s - first.time_s < longest;
         ++end) {
      const double after = poses[end].time_s - first.time_s;
      sum.time_s += after;
      squares += after * after;
      sum.x_m += poses[end].x_m;
      sum.y_m += poses[end].y_m;
      sum.yaw_rad += poses[end].yaw_rad;
    }
    const auto n = static_cast<double>(end - begin);
    const double mean = sum.time_s / n;
    means.push_back(
        {{first.time_s + mean, sum.x_m / n, sum.y_m / n, sum.yaw_rad / n}, squares / n - mean * mean});
  }
  return means;
}

}  // namespace

double vehicle_time(const Plant& plant, double stamp) {
  const PlantProperties& properties = plant.properties();
  return plant.start_s() +
         (stamp - plant.start_s() - properties.mocap_latency_s) / (1.0 + properties.stamp_skew);
}

Box visited(const std::vector<Flight>& flights) {
  Box box{1e9, -1e9, 1e9, -1e9};
  for (const Flight& flight : flights) {
    for (const PoseSample& pose : flight.recording().poses) {
      box.x0 = std::min(box.x0, pose.x_m);
      box.x1 = std::max(box.x1, pose.x_m);
      box.y0 = std::min(box.y0, pose.y_m);
      box.y1 = std::max(box.y1, pose.y_m);
    }
  }
  return box;
}

bool Path::Key::operator==(const Key& other) const {
  return timing.command_delay_s == other.timing.command_delay_s &&
         timing.open_delay_s == other.timing.open_delay_s &&
         timing.close_delay_s == other.timing.close_delay_s &&
         timing.dead_since_s == other.timing.dead_since_s && jumps == other.jumps &&
         latency_s == other.latency_s && skew == other.skew && start_s == other.start_s &&
         longest_step_s == other.longest_step_s && valves == other.valves &&
         com_to_marker == other.com_to_marker && yaw_offset_rad == other.yaw_offset_rad;
}

Flight::Flight(Recording recording) : Flight(std::move(recording), averaged) {}

Flight Flight::of_every_pose(Recording recording) { return Flight(std::move(recording), each_alone); }

Flight::Flight(Recording recording, std::vector<Frame> (*frames_of)(const std::vector<PoseSample>&))
    : recording_(std::move(recording)) {
  for (const Frame& frame : frames_of(recording_.poses)) {
    const PoseSample& pose = frame.pose;
    poses_.push_back(pose);
    spread_s2_.push_back(frame.spread_s2);
    times_.push_back(pose.time_s);
    PlanarState<double> state;
    state.p_WC = {pose.x_m, pose.y_m};
    state.yaw = pose.yaw_rad;
    motion_.push_back(state);
  }
  for (auto& variance : scatter_variance_) variance.assign(times_.size(), 0.0);
  travel_.assign(times_.size(), {0.0, 0.0, 1.0});
}

PlanarState<double> Flight::motion_at(std::size_t i, double fraction) const {
  const PlanarState<double>&a = motion_[i], &b = motion_[i + 1];
  const double dt = times_[i + 1] - times_[i];
  PlanarState<double> at;
  for (int k = 0; k < 2; ++k) at.p_WC[k] = hermite(a.p_WC[k], a.v_WC[k], b.p_WC[k], b.v_WC[k], dt, fraction);
  at.yaw = hermite(a.yaw, a.yaw_rate, b.yaw, b.yaw_rate, dt, fraction);
  at.v_WC = (1.0 - fraction) * a.v_WC + fraction * b.v_WC;
  at.yaw_rate = (1.0 - fraction) * a.yaw_rate + fraction * b.yaw_rate;
  return at;
}

namespace {

// How long a step may be over which a plant's forces are evaluated once [s]. What an effect does must not
// depend on which others are there: an oscillation that long steps blur would lend its evidence to any effect
// with a hidden state.
double longest_step(const Plant& plant) {
  constexpr double kLongest = 0.025;  // s: a lost frame must not hide how the force changes on the way
  constexpr double kShort = 0.01;     // s: of hidden states, and of laws that may change with time
  constexpr double kOfTimeScale = 0.5, kOfPeriod = 0.1;
  double longest = kLongest;
  if (plant.hidden_size() > 1) longest = std::min(kShort, kOfTimeScale * plant.max_step_s());
  for (const Effect& effect : plant.effects()) {
    if (std::holds_alternative<Unmodelled>(effect)) longest = std::min(longest, kShort);
    if (const auto* vibration = std::get_if<FloorVibration>(&effect))
      longest = std::min(longest, kOfPeriod / std::max(vibration->frequency_hz, 1e-3));
  }
  return longest;
}

}  // namespace

std::shared_ptr<const Path> Flight::path(const Plant& plant) const {
  const PlantProperties& properties = plant.properties();
  const Path::Key key{properties.timing,
                      plant.edges(),
                      properties.mocap_latency_s,
                      properties.stamp_skew,
                      plant.start_s(),
                      longest_step(plant),
                      plant.thruster_count(),
                      properties.marker_B - properties.com_B,
                      properties.mocap_yaw_offset_rad};
  return derived_->paths.get(key, [&] { return make_path(plant, key); });
}

Path Flight::make_path(const Plant& plant, const Path::Key& key) const {
  const std::size_t n = frames();
  Path path;
  for (auto& measured : path.measured) measured.resize(n);
  std::vector<double> instants(n);
  for (std::size_t i = 0; i < n; ++i) {
    instants[i] = vehicle_time(plant, times_[i]);
    PlanarState<double> shown;
    const PoseSample& pose = poses_[i];
    shown.p_WC = {pose.x_m, pose.y_m};
    shown.yaw = pose.yaw_rad;
    const PlanarState<double> state = plant.from_measured(shown);
    path.measured[kX][i] = state.p_WC.x();
    path.measured[kY][i] = state.p_WC.y();
    path.measured[kYaw][i] = state.yaw;
  }

  // Hidden states run from t0; forces are needed from the first frame on.
  ValveSchedule schedule(key.valves, key.timing);
  if (key.valves > 0) {
    for (const ThrusterCommand& command : recording_.commands) schedule.add(command);
  }
  constexpr std::size_t kEdges = 8;  // of a command, about
  path.steps.reserve(n + kEdges * recording_.commands.size());
  std::size_t frame = 0;
  for (double begin = std::min(plant.start_s(), instants.front()); begin < instants.back();) {
    double stretch_end = std::min(schedule.next_edge(begin), instants.back());
    const auto jump = std::upper_bound(key.jumps.begin(), key.jumps.end(), begin);
    if (jump != key.jumps.end()) stretch_end = std::min(stretch_end, *jump);
    path.openings.emplace_back(key.valves);
    schedule.openings(begin, path.openings.back().data());
    for (double t = begin; t < stretch_end;) {
      while (frame + 2 < n && instants[frame + 1] <= t) ++frame;
      const bool before_first = t < instants[0];
      double end =
          std::min(stretch_end, before_first ? instants[0] : std::max(instants[frame + 1], t + 1e-9));
      end = std::min(end, t + key.longest_step_s);
      const double middle = 0.5 * (t + end);
      const double span = instants[frame + 1] - instants[frame];
      const double fraction = before_first ? 0.0 : std::clamp((middle - instants[frame]) / span, 0.0, 1.0);
      path.steps.push_back({middle, end - t,
                            before_first ? -1.0 : std::max(0.0, instants[frame + 1] - middle), frame,
                            path.openings.size() - 1, plant.from_measured(motion_at(frame, fraction))});
      t = end;
    }
    begin = stretch_end;
  }
  return path;
}

namespace {

ForceIntegrals at_rest(const Path& path) {
  ForceIntegrals out;
  out.measured = path.measured;
  for (int axis = 0; axis < kAxes; ++axis) {
    out.dv[axis].assign(path.measured[axis].size(), 0.0);
    out.dp[axis].assign(path.measured[axis].size(), 0.0);
  }
  return out;
}

void add(const Path::Step& step, const PlanarAcceleration<double>& body, ForceIntegrals& out) {
  const double dv[kAxes] = {body.a_WC.x() * step.dt, body.a_WC.y() * step.dt,
                            body.yaw_acceleration * step.dt};
  for (int axis = 0; axis < kAxes; ++axis) {
    out.dv[axis][step.frame] += dv[axis];
    out.dp[axis][step.frame] += dv[axis] * step.to_next;
  }
}

}  // namespace

ForceIntegrals Flight::integrate_slow(const Plant& plant, const Reach* reach) const {
  constexpr double kHold = 0.04;  // s: a few millimetres of motion
  const std::shared_ptr<const Path> along = path(plant);
  const std::vector<Path::Step>& steps = along->steps;
  ForceIntegrals out = at_rest(*along);
  const VecX<double> hidden = plant.initial_hidden();
  PlantRate<double> rate;
  for (std::size_t begin = 0, end = 0; begin < steps.size(); begin = end) {
    while (end < steps.size() && steps[end].middle_s - steps[begin].middle_s < kHold) ++end;
    const Path::Step& middle = steps[(begin + end) / 2];
    if (middle.to_next < 0.0 || (reach != nullptr && (middle.state.p_WC - reach->center_m).squaredNorm() >
                                                         reach->radius_m * reach->radius_m))
      continue;
    plant.rate(middle.middle_s, middle.state, hidden, along->openings[middle.openings], rate);
    for (std::size_t i = begin; i < end; ++i) {
      if (steps[i].to_next >= 0.0) add(steps[i], rate.body, out);
    }
  }
  return out;
}

ForceIntegrals Flight::integrate(const Plant& plant, std::vector<VecX<double>>* hidden_at_frame) const {
  const std::size_t n = frames();
  const std::shared_ptr<const Path> along = path(plant);
  ForceIntegrals out = at_rest(*along);
  VecX<double> hidden = plant.initial_hidden(), half = hidden;
  const bool evolves = hidden.size() > 1;
  if (hidden_at_frame != nullptr) hidden_at_frame->assign(n, hidden);
  PlantRate<double> rate;
  for (const Path::Step& step : along->steps) {
    const VecX<double>& openings = along->openings[step.openings];
    plant.rate(step.middle_s, step.state, hidden, openings, rate);
    if (evolves) {
      // Midpoint rule for the hidden states, whose force is taken in the middle of the step too.
      half = hidden + 0.5 * step.dt * rate.hidden;
      plant.rate(step.middle_s, step.state, half, openings, rate);
    }
    hidden += step.dt * rate.hidden;
    const bool before_first = step.to_next < 0.0;
    if (hidden_at_frame != nullptr) (*hidden_at_frame)[before_first ? 0 : step.frame + 1] = hidden;
    if (!before_first) add(step, rate.body, out);
  }
  take_off_bend(out);
  return out;
}

void Flight::take_off_bend(ForceIntegrals& forces) const {
  for (int axis = 0; axis < kAxes; ++axis) {
    for (std::size_t i = 1; i + 1 < frames(); ++i) {
      const double acceleration =
          (forces.dv[axis][i - 1] + forces.dv[axis][i]) / (times_[i + 1] - times_[i - 1]);
      forces.measured[axis][i] -= 0.5 * spread_s2_[i] * acceleration;
    }
  }
}

std::shared_ptr<const std::vector<Whitener>> Flight::whiteners(const NoiseModel& noise) const {
  return derived_->whiteners.get(noise, [&] {
    std::vector<Whitener> made;
    for (int axis = 0; axis < kAxes; ++axis)
      made.emplace_back(times_, scatter_variance_[axis], travel_, noise, static_cast<Axis>(axis));
    return made;
  });
}

Flight Flight::under(std::vector<ThrusterCommand> commands) const {
  Flight other = *this;
  other.recording_.commands = std::move(commands);
  other.derived_ = std::make_shared<Derived>();
  return other;
}

void Flight::smooth(const Plant& plant, const NoiseModel& noise, double looseness) {
  note_scatter(plant, noise.joins_pulses);
  const ForceIntegrals forces = integrate(plant);
  const std::size_t n = frames();
  std::array<std::vector<double>, kAxes> position, velocity;
  for (int axis = 0; axis < kAxes; ++axis) {
    Drive drive{forces.dv[axis], forces.dp[axis], {}, {}, std::vector<double>(n)};
    note_damping(plant, static_cast<Axis>(axis), drive.along, drive.damping);
    const double drift = 2.0 * noise.slow[axis] * noise.slow[axis] * 0.1;
    for (std::size_t i = 0; i + 1 < n; ++i) {
      const double scatter =
          noise.scatter * noise.scatter * scatter_variance_[axis][i] / (times_[i + 1] - times_[i]);
      drive.q[i] = looseness * looseness * (drift + scatter);
    }
    smooth_axis(times_, forces.measured[axis], noise.mocap[axis] * noise.mocap[axis], drive, position[axis],
                velocity[axis]);
  }
  set_motion(plant, position, velocity);
  note_scatter(plant, noise.joins_pulses);
}

void Flight::note_damping(const Plant& plant, Axis axis, std::vector<double>& along,
                          std::vector<double>& damping) const {
  constexpr double kStep = 0.5e-3, kArm = 0.15;  // m/s, less than friction takes to set in; m
  const std::size_t n = frames();
  along.assign(n, 0.0);
  damping.assign(n, 0.0);
  const auto rubs = [](const Effect& effect) {
    return std::holds_alternative<CoulombFriction>(effect) || std::holds_alternative<FrictionPatch>(effect);
  };
  if (std::none_of(plant.effects().begin(), plant.effects().end(), rubs)) return;
  const VecX<double> hidden = plant.initial_hidden(), closed = VecX<double>::Zero(plant.thruster_count());
  PlantRate<double> rate;
  for (std::size_t i = 0; i < n; ++i) {
    const PlanarState<double> state = plant.from_measured(motion_[i]);
    const auto acceleration = [&](double step) {
      PlanarState<double> moved = state;
      (axis == kYaw ? moved.yaw_rate : moved.v_WC[axis]) += step;
      plant.rate(times_[i], moved, hidden, closed, rate);
      return axis == kYaw ? rate.body.yaw_acceleration : rate.body.a_WC[axis];
    };
    const double step = axis == kYaw ? kStep / kArm : kStep;
    along[i] = axis == kYaw ? state.yaw_rate : state.v_WC[axis];
    damping[i] = std::max(0.0, (acceleration(-step) - acceleration(step)) / (2.0 * step));
  }
}

void Flight::track(const Plant& plant, const NoiseModel& noise) {
  // The first pass knows no velocity, the second has those of the first.
  for (int pass = 0; pass < 2; ++pass) {
    note_scatter(plant, noise.joins_pulses);
    const ForceIntegrals forces = integrate(plant);
    const std::size_t n = frames();
    std::array<std::vector<double>, kAxes> position, velocity;
    std::vector<double> innovations(n);
    for (int axis = 0; axis < kAxes; ++axis) {
      position[axis].resize(n);
      velocity[axis].resize(n);
      (*whiteners(noise))[static_cast<std::size_t>(axis)].filter(
          forces.measured[axis].data(), forces.dv[axis].data(), forces.dp[axis].data(), innovations.data(),
          position[axis].data(), velocity[axis].data());
    }
    set_motion(plant, position, velocity);
  }
}

void Flight::set_motion(const Plant& plant, const std::array<std::vector<double>, kAxes>& position,
                        const std::array<std::vector<double>, kAxes>& velocity) {
  for (std::size_t i = 0; i < frames(); ++i) {
    PlanarState<double> state;
    state.p_WC = {position[kX][i], position[kY][i]};
    state.v_WC = {velocity[kX][i], velocity[kY][i]};
    state.yaw = position[kYaw][i];
    state.yaw_rate = velocity[kYaw][i];
    motion_[i] = plant.measured(state);
  }
  derived_ = std::make_shared<Derived>();
}

void Flight::note_travel() {
  constexpr double kChord = 0.005;  // m: of shorter ways noise decides length and direction
  const std::size_t n = frames();
  travel_.assign(n, {1e-9, 1e-9, 1.0});
  Eigen::Vector2d direction = Eigen::Vector2d::Zero();
  for (std::size_t begin = 0, end = 1; end < n; ++end) {
    travel_[end - 1].path_m += (motion_[end].p_WC - motion_[end - 1].p_WC).norm();
    const Eigen::Vector2d chord = motion_[end].p_WC - motion_[begin].p_WC;
    if (chord.norm() < kChord) continue;
    if (begin > 0) travel_[begin - 1].turn = direction.dot(chord.normalized());
    direction = chord.normalized();
    const double share = chord.norm() / static_cast<double>(end - begin);
    for (; begin < end; ++begin) travel_[begin].chord_m = share;
  }
}

namespace {

struct Pulse {
  double begin_s, end_s;
};

// Of one thruster, in order.
std::vector<Pulse> pulses_of(const std::vector<ThrusterCommand>& commands, std::size_t thruster, bool join) {
  constexpr double kTogether = 1e-3;  // s, as the valves' schedule has it
  std::vector<Pulse> pulses;
  for (const ThrusterCommand& command : commands) {
    const double on = std::abs(command.duty[thruster]) * command.period_s;
    if (on <= 0.0) continue;
    if (join && !pulses.empty() && command.stamp_s < pulses.back().end_s + kTogether)
      pulses.back().end_s = command.stamp_s + on;
    else
      pulses.push_back({command.stamp_s, command.stamp_s + on});
  }
  return pulses;
}

}  // namespace

void Flight::note_scatter(const Plant& plant, bool joins_pulses) {
  const std::size_t n = frames();
  const PlantProperties& properties = plant.properties();
  for (auto& variance : scatter_variance_) variance.assign(n, 0.0);
  note_travel();
  derived_ = std::make_shared<Derived>();

  for (std::size_t k = 0; k < properties.thrusters.size(); ++k) {
    const PlanarThruster& thruster = properties.thrusters[k];
    const double force = thruster.force_n;
    const double lever = cross2(thruster.position_m - properties.com_B, thruster.direction);
    std::size_t frame = 0;
    for (const Pulse& pulse : pulses_of(recording_.commands, k, joins_pulses)) {
      const double on = pulse.end_s - pulse.begin_s;
      while (frame + 2 < n && times_[frame + 1] <= pulse.begin_s) ++frame;
      for (std::size_t i = frame; i + 1 < n && times_[i] < pulse.end_s; ++i) {
        const double overlap = std::min(times_[i + 1], pulse.end_s) - std::max(times_[i], pulse.begin_s);
        if (overlap <= 0.0) continue;
        const Eigen::Vector2d push_W =
            rotation_WB(motion_[i].yaw) * thruster.direction * (force / properties.mass_kg);
        const double spin = force * lever / properties.inertia_kg_m2;
        // A pulse's impulse varies as a whole: variance (force * on)^2, spread over its duration.
        scatter_variance_[kX][i] += push_W.x() * push_W.x() * on * overlap;
        scatter_variance_[kY][i] += push_W.y() * push_W.y() * on * overlap;
        scatter_variance_[kYaw][i] += spin * spin * on * overlap;
      }
    }
  }
}

}  // namespace atmos
