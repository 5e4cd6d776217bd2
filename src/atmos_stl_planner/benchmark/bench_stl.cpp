// Wall times of planning. One JSON row per line; an argument names the prefix of the rows wanted.
#include <algorithm>
#include <cstdio>
#include <functional>
#include <string>
#include <vector>

#include "atmos_model/benchmark_row.h"
#include "atmos_model/steady_clock.h"
#include "atmos_stl_planner/choice_search.h"
#include "atmos_stl_planner/diagnosis.h"
#include "atmos_stl_planner/monitor.h"
#include "atmos_stl_planner/planner.h"

namespace {

using atmos::print_row;
using atmos::steady_seconds;
using namespace atmos::stl;

const std::string kFolder = ATMOS_CONFIG_DIR "/stl/";
std::string prefix;

bool wanted(const std::string& name) {
  return name.compare(0, prefix.size(), prefix) == 0 || prefix.compare(0, name.size(), name) == 0;
}

Plan plan_of(const Specification& spec, const Past* past = nullptr) {
  const auto solver = make_choice_search(make_cbc(), steady_seconds);
  Plan plan = Planner(spec, *solver, steady_seconds).plan(past);
  std::fprintf(stderr, "%s: status %d, robustness %.4f m, first %.3f s, total %.3f s, %s\n",
               spec.name.c_str(), static_cast<int>(plan.status), plan.certificate.robustness_m,
               plan.first_plan_s, plan.total_s, plan.method.c_str());
  return plan;
}

// Rows <name>/first_plan and <name>/<last>.
void planning(const std::string& name, const std::string& last, const Specification& spec, int repeats,
              const Past* past = nullptr) {
  if (!wanted(name)) return;
  std::vector<double> first, total;
  for (int i = 0; i < repeats; ++i) {
    const Plan plan = plan_of(spec, past);
    if (plan.status != PlanStatus::kPlanned) {
      std::fprintf(stderr, "%s: no plan\n", name.c_str());
      std::exit(1);
    }
    first.push_back(1e3 * plan.first_plan_s);
    total.push_back(1e3 * plan.total_s);
  }
  print_row(name + "/first_plan", "ms", first);
  print_row(name + "/" + last, "ms", total);
}

// Robots that change places in a room with four corners: each has its own visits, as in the two-agent
// scenario.
Specification crowd(int robots) {
  static const char* const kStarts[] = {"x_m: 0.5, y_m: -0.75", "x_m: 2.75, y_m: -0.75",
                                        "x_m: 0.5, y_m: 0.75", "x_m: 2.75, y_m: 0.75"};
  static const char* const kVisits[] = {"ABCA", "CDAB", "BADC", "DCBA"};
  std::string text = "name: crowd" + std::to_string(robots) +
                     "\nhorizon_s: 90\nworkspace: {min_m: [0, -1.25], max_m: [3.5, 1.25]}\nregions:\n"
                     "  - {name: A, center_m: [0.5, -0.75], size_m: [0.5, 0.5]}\n"
                     "  - {name: B, center_m: [0.5, 0.75], size_m: [0.5, 0.5]}\n"
                     "  - {name: C, center_m: [2.75, -0.75], size_m: [0.5, 0.5]}\n"
                     "  - {name: D, center_m: [2.75, 0.75], size_m: [0.5, 0.5]}\n"
                     "  - {name: Obs, center_m: [1.625, 0.0], size_m: [0.75, 0.8]}\n"
                     "separation_margin_m: 0.05\nrobots:\n";
  for (int i = 0; i < robots; ++i) {
    text +=
        "  - name: R" + std::to_string(i) + "\n    start: {" + kStarts[i] +
        "}\n    radius_m: 0.2\n    max_velocity_m_s: 0.3\n    max_acceleration_m_s2: 0.05\n    formulas:\n";
    for (int k = 0; k < 4; ++k) {
      const int from = 20 * k;
      text += "      - F[" + std::to_string(from) + "," + std::to_string(from + 10) + "] in(" +
              kVisits[i][k] + ")\n";
    }
    text += "      - G[0,90] not in(Obs)\n";
  }
  return parse_specification(text, "crowd");
}

void replanning() {
  if (!wanted("stl/two_agents/replan")) return;
  const Specification spec = load_specification(kFolder + "two_robots.yaml");
  const Plan plan = plan_of(spec);
  std::vector<double> times;
  std::vector<std::vector<Eigen::Vector2d>> points;
  for (int k = 0; k <= 350; ++k) {
    times.push_back(0.1 * k);
    points.push_back({plan.motion.at(0, times.back()).p_WB + Eigen::Vector2d(0.03, 0.0),
                      plan.motion.at(1, times.back()).p_WB - Eigen::Vector2d(0.0, 0.03)});
  }
  const Past past{polyline(times, points), {plan.motion.at(0, 35.0).v_WB, plan.motion.at(1, 35.0).v_WB}};
  planning("stl/two_agents/replan", "final", spec, 5, &past);
}

void infeasible() {
  if (!wanted("stl/infeasible/conflict")) return;
  Specification spec = load_specification(kFolder + "single.yaml");
  Clause hurried{"F[0,8] atmos.in(D)", parse_formula("F[0,8] in(D)", spec.vocabulary()), 0};
  spec.clauses.push_back(hurried);
  std::vector<double> values;
  for (int i = 0; i < 5; ++i) {
    const double begin = steady_seconds();
    const auto solver = make_choice_search(make_cbc(), steady_seconds);
    const Plan plan = Planner(spec, *solver, steady_seconds).plan();
    const Conflict conflict = Diagnosis(spec, *solver, steady_seconds).conflict(20.0);
    values.push_back(1e3 * (steady_seconds() - begin));
    if (plan.status != PlanStatus::kInfeasible || conflict.parts.empty()) std::exit(1);
    for (const std::string& part : conflict.parts) std::fprintf(stderr, "conflict: %s\n", part.c_str());
  }
  print_row("stl/infeasible/conflict", "ms", values);
}

void monitoring() {
  if (!wanted("stl/monitor/update")) return;
  const Specification spec = load_specification(kFolder + "two_robots.yaml");
  const Plan plan = plan_of(spec);
  Monitor monitor(spec);
  std::vector<double> values;
  for (int k = 0; k <= 9000; ++k) {
    const std::vector<Eigen::Vector2d> p = {plan.motion.at(0, 0.01 * k).p_WB,
                                            plan.motion.at(1, 0.01 * k).p_WB};
    const double begin = steady_seconds();
    monitor.update(0.01 * k, p);
    values.push_back(1e3 * (steady_seconds() - begin));
  }
  print_row("stl/monitor/update", "ms", values);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc > 1) prefix = argv[1];
  planning("stl/single", "plan", load_specification(kFolder + "single.yaml"), 9);
  planning("stl/two_agents", "polished", load_specification(kFolder + "two_robots.yaml"), 5);
  replanning();
  infeasible();
  planning("stl/three_agents", "polished", crowd(3), 2);
  planning("stl/four_agents", "polished", crowd(4), 1);
  monitoring();
  return 0;
}
