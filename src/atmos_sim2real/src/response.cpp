#include "atmos_sim2real/response.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "atmos_model/planar.h"

namespace atmos {

namespace {

constexpr double kGrid = 0.01;          // s
constexpr int kHalf = 50;               // grid steps: second differences over +-0.5 s
constexpr int kStride = 10;             // grid steps between the instants that are used
constexpr double kLongestBridge = 0.2;  // s between poses that are interpolated
constexpr double kJoined = 1e-3;        // s between pulses that are one
constexpr double kLargestShift = 12.0;  // s
constexpr double kShiftStep = 0.1;      // s
constexpr double kArm = 0.15;           // m: makes yaw comparable with translation
constexpr std::size_t kFewestInstants = 100;

// Bounds of what the vocabulary of effects can mean.
constexpr double kUnsuspiciousShift = 0.35;  // s
constexpr double kClearCorrelation = 0.35;
constexpr double kMuchBetter = 0.5;    // unexplained share of the motion, against that without a shift
constexpr double kMoves = 8.0;         // variance of the motion over that of the noise
constexpr double kFollows = 0.3;       // correlation
constexpr double kClear = 4.0;         // standard deviations
constexpr double kElsewhere = 0.5;     // cosine of the angle between observed and stated push
constexpr double kInProportion = 0.8;  // correlation
constexpr double kWeakest = 1.0 / 3.0, kStrongest = 3.0;

// Poses and openings on a regular grid, with integrals that make means over any stretch cheap.
struct Sampled {
  double begin_s = 0.0;
  std::size_t n = 0;
  std::vector<char> known;               // whether a pose is known there
  std::vector<Eigen::Vector3d> pose;     // x, y, yaw
  std::vector<std::vector<float>> open;  // per thruster, mean over each grid step
  // The same for one more second of opening at the end of every pulse, all of it in one grid step.
  std::vector<std::vector<float>> longer;
};

Sampled sample(const Recording& recording, std::size_t thrusters) {
  Sampled out;
  out.begin_s = recording.poses.front().time_s;
  out.n = static_cast<std::size_t>(recording.duration_s() / kGrid) + 1;
  out.known.assign(out.n, 0);
  out.pose.assign(out.n, Eigen::Vector3d::Zero());
  std::size_t at = 0;
  for (std::size_t i = 0; i < out.n; ++i) {
    const double t = out.begin_s + kGrid * static_cast<double>(i);
    while (at + 2 < recording.poses.size() && recording.poses[at + 1].time_s <= t) ++at;
    const PoseSample &a = recording.poses[at], &b = recording.poses[at + 1];
    const double u = (t - a.time_s) / (b.time_s - a.time_s);
    out.known[i] = b.time_s - a.time_s < kLongestBridge;
    out.pose[i] = {a.x_m + u * (b.x_m - a.x_m), a.y_m + u * (b.y_m - a.y_m),
                   a.yaw_rad + u * (b.yaw_rad - a.yaw_rad)};
  }
  out.open.assign(thrusters, std::vector<float>(out.n, 0.0F));
  out.longer = out.open;
  for (std::size_t c = 0; c < recording.commands.size(); ++c) {
    const ThrusterCommand& command = recording.commands[c];
    double until = command.stamp_s + command.period_s;
    if (c + 1 < recording.commands.size()) until = std::min(until, recording.commands[c + 1].stamp_s);
    for (std::size_t k = 0; k < thrusters; ++k) {
      const double close = std::min(until, command.stamp_s + std::abs(command.duty[k]) * command.period_s);
      const double first = std::floor((command.stamp_s - out.begin_s) / kGrid);
      const double sign = command.duty[k] < 0.0 ? -1.0 : 1.0;
      for (double step = std::max(first, 0.0); step < static_cast<double>(out.n); step += 1.0) {
        const double t = out.begin_s + kGrid * step;
        const double overlap = std::min(close, t + kGrid) - std::max(command.stamp_s, t);
        if (t >= close) break;
        if (overlap > 0.0)
          out.open[k][static_cast<std::size_t>(step)] += static_cast<float>(sign * overlap / kGrid);
      }
      const double closed = std::floor((close - out.begin_s) / kGrid);
      const bool goes_on = c + 1 < recording.commands.size() && recording.commands[c + 1].duty[k] != 0.0 &&
                           recording.commands[c + 1].stamp_s < close + kJoined;
      if (command.duty[k] != 0.0 && !goes_on && closed >= 0.0 && closed < static_cast<double>(out.n))
        out.longer[k][static_cast<std::size_t>(closed)] += static_cast<float>(sign / kGrid);
    }
  }
  return out;
}

// Twice integrated over a second difference: what a constant unit acceleration within the steps contributes.
double weight(int step) { return kGrid * kGrid * (kHalf - std::abs(step + 0.5)); }

struct Instant {
  Eigen::Vector3d second_difference;  // x, y [m], yaw times kArm [m]
  // Of each thruster: integral of opening, and of opening turned into the world.
  Eigen::MatrixXd turned;  // 3 x thrusters: cos, sin, 1
};

std::vector<Instant> instants(const Sampled& s) {
  std::vector<Instant> out;
  const auto thrusters = static_cast<Eigen::Index>(s.open.size());
  const int n = static_cast<int>(s.n);
  for (int i = kHalf; i + kHalf < n; i += kStride) {
    bool known = true;
    for (int j = i - kHalf; j <= i + kHalf; j += 5) known = known && s.known[static_cast<std::size_t>(j)];
    if (!known) continue;
    const auto pose = [&](int j) { return s.pose[static_cast<std::size_t>(j)]; };
    Instant at{pose(i + kHalf) - 2.0 * pose(i) + pose(i - kHalf), Eigen::MatrixXd::Zero(3, thrusters)};
    at.second_difference.z() *= kArm;
    for (int step = -kHalf; step < kHalf; ++step) {
      const double yaw = pose(i + step).z();
      const Eigen::Vector3d turn(std::cos(yaw), std::sin(yaw), 1.0);
      for (Eigen::Index k = 0; k < thrusters; ++k) {
        const float open = s.open[static_cast<std::size_t>(k)][static_cast<std::size_t>(i + step)];
        if (open != 0.0F) at.turned.col(k) += weight(step) * static_cast<double>(open) * turn;
      }
    }
    out.push_back(std::move(at));
  }
  return out;
}

Eigen::Vector3d predicted(const Instant& at, const std::vector<Eigen::Vector3d>& push) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < push.size(); ++k) {
    const Eigen::Vector3d turned = at.turned.col(static_cast<Eigen::Index>(k));
    sum.x() += turned.x() * push[k].x() - turned.y() * push[k].y();
    sum.y() += turned.y() * push[k].x() + turned.x() * push[k].y();
    sum.z() += kArm * turned.z() * push[k].z();
  }
  return sum;
}

// Motion against prediction over the whole recording, for one shift of the poses.
struct Agreement {
  double correlation = 0.0, strength = 1.0, yaw_strength = 1.0, seen = 0.0;  // seen: variance, m^2
  std::size_t instants = 0;
};

// Coarser and cheaper than instants(): mean accelerations over kStride grid steps.
std::vector<Eigen::Vector3d> accelerations(const Sampled& s, const std::vector<std::vector<float>>& open,
                                           const std::vector<Eigen::Vector3d>& push, int shift) {
  const int n = static_cast<int>(s.n) / kStride;
  std::vector<Eigen::Vector3d> acceleration(static_cast<std::size_t>(n), Eigen::Vector3d::Zero());
  for (int bin = 0; bin < n; ++bin) {
    const int commanded = bin * kStride - shift;
    if (commanded < 0 || commanded + kStride > static_cast<int>(s.n)) continue;
    Eigen::Vector3d mean_B = Eigen::Vector3d::Zero();
    for (std::size_t k = 0; k < push.size(); ++k) {
      float sum = 0.0F;
      for (int i = 0; i < kStride; ++i) sum += open[k][static_cast<std::size_t>(commanded + i)];
      if (sum != 0.0F) mean_B += static_cast<double>(sum) / kStride * push[k];
    }
    const double yaw = s.pose[static_cast<std::size_t>(bin * kStride + kStride / 2)].z();
    auto& a = acceleration[static_cast<std::size_t>(bin)];
    a.head<2>() = rotation_WB(yaw) * mean_B.head<2>();
    a.z() = kArm * mean_B.z();
  }
  return acceleration;
}

// Sums of products of what is seen, what is expected, and what pulses that are a second longer would add.
struct Products {
  double expected = 0.0, both = 0.0, longer = 0.0, seen_expected = 0.0, seen_longer = 0.0;

  // How much stronger the motion is than expected, where all pulses may be longer or shorter by as much as
  // valves do that close later than they open; what cannot be told from it is taken for that.
  double strength() const {
    constexpr double kLongest = 0.05;  // s
    constexpr double kRidge = 1e-3;
    if (!(expected > 0.0)) return 1.0;
    const double slack = kRidge * expected;
    const double h11 = expected + slack, h12 = kLongest * both;
    const double h22 = kLongest * kLongest * longer + slack;
    const double g1 = seen_expected - expected, g2 = kLongest * (seen_longer - both);
    const double share = std::clamp((g2 * h11 - g1 * h12) / (h11 * h22 - h12 * h12), -1.0, 1.0);
    return 1.0 + (g1 - h12 * share) / h11;
  }
};

Agreement agreement(const Sampled& s, const std::vector<Eigen::Vector3d>& push, int shift) {
  const int n = static_cast<int>(s.n) / kStride, half = kHalf / kStride;
  const std::vector<Eigen::Vector3d> acceleration = accelerations(s, s.open, push, shift);
  std::vector<Eigen::Vector3d> of_longer;
  if (shift == 0) of_longer = accelerations(s, s.longer, push, shift);
  std::vector<Eigen::Vector3d> seen, expected, longer;
  for (int bin = half; bin + half < n; ++bin) {
    bool known = bin * kStride - kHalf - shift >= 0 && bin * kStride + kHalf - shift < static_cast<int>(s.n);
    for (int j = bin - half; j <= bin + half; ++j)
      known = known && s.known[static_cast<std::size_t>(j * kStride)];
    if (!known) continue;
    const auto pose = [&](int at) { return s.pose[static_cast<std::size_t>(at * kStride)]; };
    Eigen::Vector3d difference = pose(bin + half) - 2.0 * pose(bin) + pose(bin - half);
    difference.z() *= kArm;
    const auto motion = [&](const std::vector<Eigen::Vector3d>& of) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (int j = -half; j < half; ++j)
        sum += (half - std::abs(j + 0.5)) * of[static_cast<std::size_t>(bin + j)];
      return Eigen::Vector3d(sum * (kGrid * kStride) * (kGrid * kStride));
    };
    seen.push_back(difference);
    expected.push_back(motion(acceleration));
    if (shift == 0) longer.push_back(motion(of_longer));
  }
  Agreement out;
  out.instants = seen.size();
  if (seen.empty()) return out;
  const auto take_off_mean = [](std::vector<Eigen::Vector3d>& motion) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& at : motion) sum += at;
    for (Eigen::Vector3d& at : motion) at -= sum / static_cast<double>(motion.size());
  };
  take_off_mean(seen);
  take_off_mean(expected);
  take_off_mean(longer);
  const auto products = [](const std::vector<Eigen::Vector3d>& a, const std::vector<Eigen::Vector3d>& b) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < a.size(); ++i) sum += a[i].cwiseProduct(b[i]);
    return sum;
  };
  const Eigen::Vector3d seen_squares = products(seen, seen), expected_squares = products(expected, expected);
  const Eigen::Vector3d seen_expected = products(seen, expected);
  const double all = seen_squares.sum() * expected_squares.sum();
  out.correlation = all > 0.0 ? seen_expected.sum() / std::sqrt(all) : 0.0;
  out.seen = seen_squares.sum() / static_cast<double>(seen.size());
  if (shift != 0) return out;
  const Eigen::Vector3d both = products(expected, longer), longer_squares = products(longer, longer);
  const Eigen::Vector3d seen_longer = products(seen, longer);
  const auto strength_in = [&](const auto& axes) {
    return Products{axes(expected_squares), axes(both), axes(longer_squares), axes(seen_expected),
                    axes(seen_longer)}
        .strength();
  };
  out.strength = strength_in([](const Eigen::Vector3d& sums) { return sums.head<2>().sum(); });
  out.yaw_strength = strength_in([](const Eigen::Vector3d& sums) { return sums.z(); });
  return out;
}

// Variance of what agreement() sees when nothing moves, robustly out of third differences of the poses.
double noise_of(const Recording& recording) {
  const auto& poses = recording.poses;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    const auto value = [&](std::size_t i) {
      return axis == 0 ? poses[i].x_m : axis == 1 ? poses[i].y_m : kArm * poses[i].yaw_rad;
    };
    std::vector<double> squares;
    for (std::size_t i = 3; i < poses.size(); ++i) {
      const double d = value(i) - 3.0 * value(i - 1) + 3.0 * value(i - 2) - value(i - 3);
      squares.push_back(d * d);
    }
    const auto middle = squares.begin() + static_cast<std::ptrdiff_t>(squares.size() / 2);
    std::nth_element(squares.begin(), middle, squares.end());
    sum[axis] = *middle / 0.455 / 20.0;  // median of a squared normal; a third difference has 20 variances
  }
  return 6.0 * sum.sum();
}

// What each thruster pushes, and how well that is known.
struct Pushes {
  std::vector<Eigen::Vector3d> mean, deviation;
};

// Least squares; rows of neighbouring instants overlap, which the deviations heed. Empty when no thruster was
// opened.
Pushes pushes_of(const Instant* begin, const Instant* end, std::size_t thrusters) {
  const auto n = static_cast<Eigen::Index>(thrusters);
  const auto rows = static_cast<double>(end - begin);
  const double overlap = 2.0 * kHalf / kStride;
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(2 * n, 2 * n), B = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd a = Eigen::VectorXd::Zero(2 * n), b = Eigen::VectorXd::Zero(n);
  for (const Instant* at = begin; at != end; ++at) {
    Eigen::MatrixXd row(2, 2 * n);
    row << at->turned.row(0), -at->turned.row(1), at->turned.row(1), at->turned.row(0);
    A += row.transpose() * row;
    a += row.transpose() * at->second_difference.head<2>();
    B += at->turned.row(2).transpose() * at->turned.row(2);
    b += at->turned.row(2).transpose() * (at->second_difference.z() / kArm);
  }
  Pushes out;
  if (!(A.trace() > 0.0)) return out;
  // A thruster that was never opened, or only ever with another, stays at a large deviation.
  const double ridge = 1e-9 * rows;
  A += ridge * A.trace() / static_cast<double>(2 * n) * Eigen::MatrixXd::Identity(2 * n, 2 * n);
  B += ridge * B.trace() / static_cast<double>(n) * Eigen::MatrixXd::Identity(n, n);
  const Eigen::LDLT<Eigen::MatrixXd> solved_A(A), solved_B(B);
  const Eigen::VectorXd pushes = solved_A.solve(a), turns = solved_B.solve(b);
  for (Eigen::Index k = 0; k < n; ++k) out.mean.push_back({pushes[k], pushes[n + k], turns[k]});
  Eigen::Vector2d squares = Eigen::Vector2d::Zero();
  for (const Instant* at = begin; at != end; ++at) {
    const Eigen::Vector3d left = at->second_difference - predicted(*at, out.mean);
    squares += Eigen::Vector2d(left.head<2>().squaredNorm() / 2.0, left.z() * left.z() / (kArm * kArm));
  }
  squares *= overlap / rows;
  const Eigen::VectorXd variance_A =
      squares[0] * solved_A.solve(Eigen::MatrixXd::Identity(2 * n, 2 * n)).diagonal();
  const Eigen::VectorXd variance_B = squares[1] * solved_B.solve(Eigen::MatrixXd::Identity(n, n)).diagonal();
  for (Eigen::Index k = 0; k < n; ++k)
    out.deviation.push_back(
        Eigen::Vector3d(variance_A[k], variance_A[n + k], variance_B[k]).cwiseMax(0.0).cwiseSqrt());
  return out;
}

// Stretch by stretch: a thruster that fails on the way leads those astray that fire with it ever after, but
// only where both are taken for one. Stretches that disagree about a push leave it less certain.
void observe(const std::vector<Instant>& all, Response& out) {
  constexpr std::size_t kMostStretches = 4, kLeast = 200;  // instants: 20 s
  const std::size_t thrusters = out.stated.size();
  const std::size_t stretches = std::clamp<std::size_t>(all.size() / kLeast, 1, kMostStretches);
  std::vector<Pushes> seen;
  for (std::size_t s = 0; s < stretches; ++s) {
    Pushes pushes = pushes_of(all.data() + all.size() * s / stretches,
                              all.data() + all.size() * (s + 1) / stretches, thrusters);
    if (!pushes.mean.empty()) seen.push_back(std::move(pushes));
  }
  if (seen.empty()) return;
  for (std::size_t k = 0; k < thrusters; ++k) {
    Eigen::Array3d weights = Eigen::Array3d::Zero(), mean = weights, scatter = weights;
    const auto weight_of = [k](const Pushes& pushes) {
      return pushes.deviation[k].array().max(1e-9).square().inverse().eval();
    };
    for (const Pushes& pushes : seen) weights += weight_of(pushes);
    for (const Pushes& pushes : seen) mean += weight_of(pushes) * pushes.mean[k].array() / weights;
    for (const Pushes& pushes : seen) scatter += weight_of(pushes) * (pushes.mean[k].array() - mean).square();
    if (seen.size() > 1) scatter /= static_cast<double>(seen.size() - 1);
    out.observed.push_back(mean);
    out.deviation.push_back((scatter.max(1.0) / weights).sqrt());
  }
}

Eigen::Vector3d scaled(const Eigen::Vector3d& push) { return {push.x(), push.y(), kArm * push.z()}; }

}  // namespace

Response response(const Recording& recording, const Vehicle& vehicle) {
  Response out;
  for (const Thruster& thruster : vehicle.thrusters) {
    const Eigen::Vector2d force = thruster.force_n * thruster.direction.head<2>();
    const double torque = cross2(thruster.position_m.head<2>().eval(), force);
    out.stated.push_back(
        {force.x() / vehicle.mass_kg, force.y() / vehicle.mass_kg, torque / vehicle.inertia_kg_m2.z()});
  }
  const Sampled sampled = sample(recording, vehicle.thrusters.size());
  const std::vector<Instant> now = instants(sampled);
  if (now.size() < kFewestInstants) return out;
  const Agreement agreed = agreement(sampled, out.stated, 0);
  out.correlation = out.best_correlation = agreed.correlation;
  out.strength = agreed.strength;
  out.yaw_strength = agreed.yaw_strength;
  out.above_noise = agreed.seen / std::max(noise_of(recording), 1e-12);
  const int steps = static_cast<int>(kLargestShift / (kGrid * kStride));
  for (int step = -steps; step <= steps; ++step) {
    const Agreement shifted = agreement(sampled, out.stated, step * kStride);
    if (shifted.instants < kFewestInstants || shifted.correlation <= out.best_correlation) continue;
    out.best_correlation = shifted.correlation;
    out.best_shift_s = step * kGrid * kStride;
  }
  observe(now, out);
  return out;
}

std::string refusal(const Response& response) {
  char text[240];
  const auto unexplained = [](double correlation) { return 1.0 - correlation * std::abs(correlation); };
  if (std::abs(response.best_shift_s) > kUnsuspiciousShift && response.best_correlation > kClearCorrelation &&
      unexplained(response.best_correlation) < kMuchBetter * unexplained(response.correlation)) {
    std::snprintf(text, sizeof(text),
                  "the poses are stamped about %.1f s %s against the commands: the clocks are apart",
                  std::abs(response.best_shift_s), response.best_shift_s > 0.0 ? "late" : "early");
    return text;
  }
  if (response.above_noise > kMoves && response.correlation < kFollows)
    return "the motion does not follow the commands as the vehicle file says: is it the file of this robot, "
           "and are "
           "poses and commands of the same flight?";
  // Friction too makes a robot answer weakly, yet not in proportion.
  const bool weaker = response.strength < kWeakest && response.yaw_strength < kWeakest &&
                      response.correlation > kInProportion;
  const bool stronger = response.correlation > kClearCorrelation &&
                        std::max(response.strength, response.yaw_strength) > kStrongest;
  if (response.above_noise > kMoves && (weaker || stronger)) {
    std::snprintf(text, sizeof(text),
                  "the robot is pushed %.2g and turned %.2g times as strongly as the vehicle file says: is "
                  "it the file of "
                  "this robot?",
                  response.strength, response.yaw_strength);
    return text;
  }
  std::string elsewhere;
  int clear = 0, wrong = 0;
  for (std::size_t k = 0; k < response.observed.size(); ++k) {
    const Eigen::Vector3d seen = scaled(response.observed[k]), said = scaled(response.stated[k]);
    const double deviation = scaled(response.deviation[k]).norm();
    if (!(deviation * kClear < said.norm())) continue;  // the recording says nothing of this one
    ++clear;
    if (seen.norm() < kClear * deviation || seen.dot(said) > kElsewhere * seen.norm() * said.norm()) continue;
    ++wrong;
    elsewhere += (elsewhere.empty() ? "" : ", ") + std::to_string(k + 1);
  }
  if (wrong >= 2 && 4 * wrong >= clear)
    return "thrusters " + elsewhere +
           " push other ways than the vehicle file says: is it the file of this robot, and are its valves "
           "wired so?";
  return "";
}

}  // namespace atmos
