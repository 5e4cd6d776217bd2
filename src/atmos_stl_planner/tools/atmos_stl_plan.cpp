// Plans a specification and prints the certificate; without a plan, why there is none and what would help.
// Exit code 0: certified plan; 1: none; 2: bad specification or arguments.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <fstream>

#include "atmos_model/steady_clock.h"
#include "atmos_model/strict_yaml.h"
#include "atmos_stl_planner/choice_search.h"
#include "atmos_stl_planner/diagnosis.h"
#include "atmos_stl_planner/planner.h"
#include "atmos_stl_planner/trajectory_samples.h"

namespace {

using namespace atmos::stl;
using atmos::steady_seconds;

void print(const Specification& spec, const Plan& plan) {
  std::printf("%s: certified, robustness %.6f m of at most %.6f m (%s)\n", spec.name.c_str(),
              plan.certificate.robustness_m, plan.bound_m, plan.method.c_str());
  std::printf("first certified plan after %.3f s, final after %.3f s; segments of at most %.3g s\n",
              plan.first_plan_s, plan.total_s, plan.segment_s);
  std::printf("peak velocity %.1f %%, peak acceleration %.1f %% of the limits\n",
              100.0 * plan.certificate.peak_velocity_share, 100.0 * plan.certificate.peak_acceleration_share);
  if (spec.robots.size() > 1)
    std::printf("least distance of two bodies beyond the margin: %.4f m\n", plan.certificate.separation_m);
  if (!spec.obstacles.empty())
    std::printf("least distance of a body to an obstacle: %.4f m\n", plan.certificate.obstacle_m);
  if (spec.planner.time_robustness) std::printf("time robustness: %.3f s\n", plan.time_robustness_s);
  std::printf("%-44s %12s %10s %8s %8s\n", "clause", "robustness m", "decided s", "late s", "early s");
  for (std::size_t i = 0; i < spec.clauses.size(); ++i) {
    const ClauseCertificate& clause = plan.certificate.clauses[i];
    std::printf("%-44s %12.6f %10.3f %8.2f %8.2f\n", spec.clauses[i].text.c_str(), clause.robustness_m,
                clause.time_s, clause.lateness_s, clause.earliness_s);
  }
}

bool write(const Specification& spec, const Plan& plan, const std::string& path, double period_s) {
  std::ofstream out(path);
  out << "robot,time_s,x_m,y_m,yaw_rad,vx_m_s,vy_m_s,ax_m_s2,ay_m_s2\n";
  for (std::size_t robot = 0; robot < spec.robots.size(); ++robot) {
    for (const TrajectorySample& at : samples(spec, plan.motion, robot, period_s)) {
      char line[240];
      std::snprintf(line, sizeof line, "%s,%.6f,%.9f,%.9f,%.9f,%.9f,%.9f,%.9f,%.9f\n",
                    spec.robots[robot].name.c_str(), at.time_s, at.state.p_WB.x(), at.state.p_WB.y(),
                    at.yaw_rad, at.state.v_WB.x(), at.state.v_WB.y(), at.state.a_WB.x(), at.state.a_WB.y());
      out << line;
    }
  }
  out.flush();
  return out.good();
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Plans a signal temporal logic specification (docs/stl_planner.md) and certifies the plan.");
  std::string path, csv;
  double period_s = 0.1, limit_s = 0.0, diagnosis_s = 20.0;
  app.add_option("specification", path, "specification file")->required();
  app.add_option("--out", csv, "CSV file for the points of the plan");
  app.add_option("--period", period_s, "s, between points")->check(CLI::PositiveNumber);
  app.add_option("--time-limit", limit_s, "s, wall time, in place of the file's")->check(CLI::PositiveNumber);
  app.add_option("--diagnosis-limit", diagnosis_s, "s, wall time for saying why there is no plan")
      ->check(CLI::PositiveNumber);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    Specification spec = load_specification(path);
    if (limit_s > 0.0) spec.planner.time_limit_s = limit_s;
    const auto solver = make_choice_search(make_cbc(), steady_seconds);
    const Plan plan = Planner(spec, *solver, steady_seconds).plan();
    if (plan.status == PlanStatus::kPlanned) {
      print(spec, plan);
      if (csv.empty() || write(spec, plan, csv, period_s)) return 0;
      std::fprintf(stderr, "%s: cannot be written\n", csv.c_str());
      return 2;
    }
    if (plan.status != PlanStatus::kInfeasible) {
      std::fprintf(stderr, "%s: no certified plan %s\n", path.c_str(),
                   plan.status == PlanStatus::kTimeLimit ? "within the time limit" : "was found");
      if (!plan.method.empty()) std::fprintf(stderr, "%s\n", plan.method.c_str());
      return 1;
    }
    Diagnosis diagnosis(spec, *solver, steady_seconds);
    const Conflict conflict = diagnosis.conflict(diagnosis_s);
    std::fprintf(stderr,
                 "%s: no plan with robustness of at least %.3f m exists on the time grids asked for\n",
                 path.c_str(), spec.planner.min_robustness_m);
    std::fprintf(stderr, "%s", explanation(conflict, diagnosis.relaxations(conflict, diagnosis_s)).c_str());
    return 1;
  } catch (const atmos::ConfigError& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
