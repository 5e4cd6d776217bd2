// Watches whether a plan that is being flown still fulfils its specification, and says from where to plan
// anew.
#pragma once

#include <optional>
#include <vector>

#include "atmos_stl_planner/grid_encoding.h"
#include "atmos_stl_planner/motion.h"
#include "atmos_stl_planner/specification.h"

namespace atmos::stl {

// Records what is flown, every 0.1 s. All times count from the start of the plan.
class Supervisor {
 public:
  Supervisor(const Specification& specification, Motion plan);

  // Centres of all robots; what is not finite or not later than the sample before is ignored.
  void fly(double time_s, const std::vector<Eigen::Vector2d>& p_WB);

  // Robustness if the robots return to the plan within two seconds and follow it from there, m; nothing
  // before the second sample and after the end.
  std::optional<double> predicted_m() const;

  // What will have been flown at `time_s`, not before the last sample: robots move along the plan beside
  // which they are now. Nothing before the second sample.
  std::optional<Past> past_at(double time_s) const;

  void follow(Motion plan) { plan_ = std::move(plan); }
  const Motion& plan() const { return plan_; }
  double last_s() const { return times_.empty() ? 0.0 : times_.back(); }

 private:
  Specification spec_;
  Motion plan_;
  std::vector<double> times_;
  std::vector<std::vector<Eigen::Vector2d>> points_;
};

}  // namespace atmos::stl
