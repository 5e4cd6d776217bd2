#include "atmos_sim2real/experiment.h"

#include <algorithm>
#include <cmath>
#include <sstream>

namespace atmos {

namespace {

Box at_least_a_metre(Box box) {
  const auto widen = [](double& low, double& high) {
    const double missing = std::max(0.0, 1.0 - (high - low));
    low -= 0.5 * missing;
    high += 0.5 * missing;
  };
  widen(box.x0, box.x1);
  widen(box.y0, box.y1);
  return box;
}

// A list of places, `pause_s` apart.
Manoeuvre sequence(const std::string& description, const std::vector<Eigen::Vector3d>& places,
                   double pause_s) {
  Manoeuvre manoeuvre{description, {}, pause_s * static_cast<double>(places.size())};
  for (const Eigen::Vector3d& place : places) {
    const double time = pause_s * static_cast<double>(manoeuvre.setpoints.size());
    manoeuvre.setpoints.push_back({time, place.x(), place.y(), place.z()});
  }
  manoeuvre.description += ", " + std::to_string(std::lround(manoeuvre.duration_s)) + " s";
  return manoeuvre;
}

}  // namespace

std::vector<Manoeuvre> manoeuvres(const Box& visited) {
  const Box box = at_least_a_metre(visited);
  const double cx = 0.5 * (box.x0 + box.x1), cy = 0.5 * (box.y0 + box.y1);
  const double reach = 0.5 * std::min(box.x1 - box.x0, box.y1 - box.y0);

  std::vector<Eigen::Vector3d> lattice, growing, turns, axes, rest;
  const int lines = static_cast<int>(std::ceil((box.y1 - box.y0) / 0.5)) + 1;
  for (int line = 0; line < lines; ++line) {
    const double y = box.y0 + (box.y1 - box.y0) * line / (lines - 1);
    const bool there = line % 2 == 0;
    for (const double share : {0.0, 0.5, 1.0})
      lattice.emplace_back(box.x0 + (box.x1 - box.x0) * (there ? share : 1.0 - share), y, 0.0);
  }
  for (const double length : {0.1, 0.3, 1.0}) {
    for (const double angle : {0.0, M_PI_2}) {
      for (const double side : {-1.0, 1.0})
        growing.emplace_back(cx + side * length * reach * std::cos(angle),
                             cy + side * length * reach * std::sin(angle), 0.0);
    }
  }
  for (const double side : {-0.7, 0.7}) {
    for (const double yaw : {0.0, 45.0, 180.0, 90.0, -90.0, 0.0})
      turns.emplace_back(cx + side * reach, cy + side * reach, yaw);
  }
  for (const double yaw : {0.0, 90.0, 180.0, -90.0}) {
    axes.emplace_back(cx, cy, yaw);
    axes.emplace_back(cx + 0.7 * reach, cy, yaw);
    axes.emplace_back(cx, cy, yaw);
    axes.emplace_back(cx, cy + 0.7 * reach, yaw);
  }
  for (const double side : {-0.7, 0.0, 0.7}) {
    for (int repeat = 0; repeat < 4; ++repeat) rest.emplace_back(cx + side * reach, cy + side * reach, 0.0);
  }
  return {sequence("lines 0.5 m apart over the floor", lattice, 8.0),
          sequence("steps of growing length along x and y", growing, 10.0),
          sequence("turns on the spot at two places", turns, 10.0),
          sequence("steps along one axis at a time at four headings", axes, 8.0),
          sequence("hold at three places", rest, 15.0)};
}

std::string setpoint_file(const Manoeuvre& manoeuvre) {
  std::ostringstream out;
  out << "# " << manoeuvre.description << "\nsetpoints:\n";
  out.precision(6);
  for (const Setpoint& s : manoeuvre.setpoints)
    out << "  - {time_s: " << s.time_s << ", x_m: " << s.x_m << ", y_m: " << s.y_m
        << ", yaw_deg: " << s.yaw_deg << "}\n";
  return out.str();
}

double separation(const Problem& problem, const Fit& claimed, const Tried& rival) {
  smooth_all(problem, claimed.effects, claimed.noise, 4.0);
  const double truth = evaluate(problem, claimed.effects, {}, claimed.noise).log_likelihood;
  const std::size_t own = rival.fit.effects.size() - 1;
  std::vector<FreeParameter> free;
  for (const FreeParameter& parameter : rival.fit.free) {
    if (parameter.effect == own) free.push_back(parameter);
  }
  constexpr int kSteps = 6;
  return truth -
         refine(problem, evaluate(problem, rival.fit.effects, free, claimed.noise), kSteps).log_likelihood;
}

}  // namespace atmos
