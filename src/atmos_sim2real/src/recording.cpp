#include "atmos_sim2real/recording.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "atmos_model/planar.h"

namespace atmos {

namespace {

constexpr double kLeastDuration = 2.0;  // s of poses
constexpr double kRepeat = 1e-5;        // s, two poses closer than this are one
constexpr double kFarApart = 600.0;  // s: stamps on both sides of such a gap belong to different recordings
constexpr double kFarthest = 1e3;    // m: no floor is that large
constexpr double kLongestPeriod = 10.0;  // s of a command
// A pose that lies this far from both its neighbours, which lie close together, is a mistake of the mocap.
constexpr double kSpike = 0.2, kSpikeYaw = 0.5;  // m, rad

std::string count_of(std::size_t n, const std::string& what) { return std::to_string(n) + " " + what; }

bool finite(const PoseSample& pose) {
  return std::isfinite(pose.time_s) && std::isfinite(pose.x_m) && std::isfinite(pose.y_m) &&
         std::isfinite(pose.yaw_rad) && std::abs(pose.x_m) < kFarthest && std::abs(pose.y_m) < kFarthest;
}

// Keeps the longest stretch of a sorted stream without a gap of kFarApart; returns how many were dropped.
template <class Sample, class TimeOf>
std::size_t keep_longest_stretch(std::vector<Sample>& stream, const TimeOf& time_of) {
  std::size_t best = 0, best_size = 0;
  for (std::size_t begin = 0, i = 1; i <= stream.size(); ++i) {
    if (i < stream.size() && time_of(stream[i]) - time_of(stream[i - 1]) < kFarApart) continue;
    if (i - begin > best_size) {
      best = begin;
      best_size = i - begin;
    }
    begin = i;
  }
  const std::size_t dropped = stream.size() - best_size;
  if (dropped > 0)
    stream = {stream.begin() + static_cast<std::ptrdiff_t>(best),
              stream.begin() + static_cast<std::ptrdiff_t>(best + best_size)};
  return dropped;
}

// Drops single poses far from both neighbours; returns how many.
std::size_t drop_spikes(std::vector<PoseSample>& poses) {
  const auto far = [](const PoseSample& a, const PoseSample& b) {
    return std::hypot(a.x_m - b.x_m, a.y_m - b.y_m) > kSpike ||
           std::abs(wrap_angle(a.yaw_rad - b.yaw_rad)) > kSpikeYaw;
  };
  std::vector<PoseSample> kept;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const bool inside = !kept.empty() && i + 1 < poses.size();
    if (inside && far(kept.back(), poses[i]) && far(poses[i], poses[i + 1]) &&
        !far(kept.back(), poses[i + 1]))
      continue;
    kept.push_back(poses[i]);
  }
  const std::size_t dropped = poses.size() - kept.size();
  poses = std::move(kept);
  return dropped;
}

void clean_poses(Recording& recording) {
  auto& poses = recording.poses;
  const std::size_t all = poses.size();
  poses.erase(std::remove_if(poses.begin(), poses.end(), [](const PoseSample& p) { return !finite(p); }),
              poses.end());
  if (poses.size() < all)
    recording.warnings.push_back(
        count_of(all - poses.size(), "poses are not finite or off any floor: dropped"));

  std::size_t backwards = 0;
  for (std::size_t i = 1; i < poses.size(); ++i) backwards += poses[i].time_s < poses[i - 1].time_s;
  if (backwards > 0) recording.warnings.push_back(count_of(backwards, "poses are out of order: sorted"));
  std::stable_sort(poses.begin(), poses.end(),
                   [](const PoseSample& a, const PoseSample& b) { return a.time_s < b.time_s; });
  if (const std::size_t n = keep_longest_stretch(poses, [](const PoseSample& p) { return p.time_s; }); n > 0)
    recording.warnings.push_back(count_of(n, "poses are stamped far from the others: dropped"));

  std::vector<PoseSample> kept;
  std::size_t repeated = 0, frozen = 0;
  for (const PoseSample& pose : poses) {
    if (!kept.empty() && pose.time_s - kept.back().time_s < kRepeat) {
      ++repeated;
    } else if (!kept.empty() && pose.x_m == kept.back().x_m && pose.y_m == kept.back().y_m &&
               pose.yaw_rad == kept.back().yaw_rad) {
      ++frozen;  // measured poses never repeat to the last bit
    } else {
      kept.push_back(pose);
    }
  }
  if (repeated > 0) recording.warnings.push_back(count_of(repeated, "poses repeat a stamp: dropped"));
  if (frozen > 0)
    recording.warnings.push_back(count_of(frozen, "poses repeat the pose before them: dropped"));
  poses = std::move(kept);
  if (const std::size_t n = drop_spikes(poses); n > 0)
    recording.warnings.push_back(count_of(n, "poses lie far from those before and after: dropped"));
  for (std::size_t i = 1; i < poses.size(); ++i) {
    poses[i].yaw_rad = poses[i - 1].yaw_rad + wrap_angle(poses[i].yaw_rad - poses[i - 1].yaw_rad);
  }
}

void clean_commands(Recording& recording, std::size_t thruster_count) {
  auto& commands = recording.commands;
  const std::size_t all = commands.size();
  std::size_t wrong_size = 0;
  const auto unusable = [&](const ThrusterCommand& c) {
    if (c.duty.size() != thruster_count) {
      ++wrong_size;
      return true;
    }
    return !std::isfinite(c.stamp_s) || !(c.period_s > 0.0) || !(c.period_s <= kLongestPeriod) ||
           std::any_of(c.duty.begin(), c.duty.end(), [](double d) { return !(std::abs(d) <= 1.0); });
  };
  commands.erase(std::remove_if(commands.begin(), commands.end(), unusable), commands.end());
  if (wrong_size > 0 && commands.empty())
    throw std::invalid_argument(recording.name + ": the commands are not for the " +
                                std::to_string(thruster_count) + " thrusters of this vehicle file");
  if (commands.size() < all)
    recording.warnings.push_back(count_of(all - commands.size(), "commands are malformed: dropped"));
  std::stable_sort(commands.begin(), commands.end(),
                   [](const ThrusterCommand& a, const ThrusterCommand& b) { return a.stamp_s < b.stamp_s; });
  if (const std::size_t n =
          keep_longest_stretch(commands, [](const ThrusterCommand& c) { return c.stamp_s; });
      n > 0)
    recording.warnings.push_back(count_of(n, "commands are stamped far from the others: dropped"));
}

}  // namespace

Recording clean_recording(Recording raw, int thruster_count) {
  Recording recording = std::move(raw);
  if (recording.commands.empty()) throw std::invalid_argument(recording.name + ": no thruster commands");
  clean_commands(recording, static_cast<std::size_t>(thruster_count));
  if (recording.commands.empty())
    throw std::invalid_argument(recording.name + ": no usable thruster command");
  clean_poses(recording);
  if (recording.poses.size() < 2)
    throw std::invalid_argument(recording.name + ": fewer than two usable poses");

  const double first = recording.commands.front().stamp_s;
  const double last = recording.commands.back().stamp_s + recording.commands.back().period_s;
  const double overlap =
      std::min(last, recording.poses.back().time_s) - std::max(first, recording.poses.front().time_s);
  if (overlap < kLeastDuration) {
    std::ostringstream text;
    text.precision(3);
    text << std::fixed << recording.name << ": poses (" << recording.poses.front().time_s << " to "
         << recording.poses.back().time_s << " s) and commands (" << first << " to " << last
         << " s) overlap by less than 2 s: are the clocks apart?";
    throw std::invalid_argument(text.str());
  }
  // Before the first command nothing is known of the valves.
  auto& poses = recording.poses;
  poses.erase(poses.begin(), std::find_if(poses.begin(), poses.end(),
                                          [&](const PoseSample& p) { return p.time_s >= first - 1e-6; }));
  poses.erase(
      std::find_if(poses.begin(), poses.end(), [&](const PoseSample& p) { return p.time_s > last + 1.0; }),
      poses.end());
  if (poses.size() < 50)
    throw std::invalid_argument(recording.name + ": fewer than 50 poses while commands were given");
  return recording;
}

}  // namespace atmos
