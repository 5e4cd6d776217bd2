#include "atmos_stl_planner/choice_search.h"

#include <Clp_C_Interface.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "sparse_columns.h"

namespace atmos::stl {

namespace {

constexpr double kBroken = 1e-7;     // a row is broken by more than this
constexpr double kInvolved = 1e-12;  // a row takes part in a proof with more than this
constexpr int kMostProblems = 1500;  // linear problems before the search gives up

// Exactly one option is 1 if the sum of `condition` and `always` is 1; else none is.
struct Group {
  std::vector<int> options;
  std::vector<int> condition;
  bool always = false;
};

// lower <= terms, as soon as one of `condition` is 1.
struct Switched {
  int row;
  double lower;
  std::vector<int> condition;
};

struct Structure {
  std::vector<Group> groups;
  std::vector<Switched> switched;
  std::vector<int> dropped;                       // rows of binaries alone
  std::vector<std::vector<std::size_t>> rows_of;  // per column: indices of `switched`
  std::vector<bool> forbidden;                    // per column
};

std::optional<Structure> structure_of(const MilpModel& model) {
  Structure found;
  found.rows_of.resize(model.columns.size());
  found.forbidden.assign(model.columns.size(), false);
  const auto is_binary = [&model](int column) {
    return model.columns[static_cast<std::size_t>(column)].integer;
  };
  for (std::size_t i = 0; i < model.rows.size(); ++i) {
    const MilpModel::Row& row = model.rows[i];
    std::vector<std::pair<int, double>> binaries;
    for (const auto& term : row.terms) {
      if (is_binary(term.first)) binaries.push_back(term);
    }
    if (binaries.empty()) continue;
    if (binaries.size() < row.terms.size()) {
      Switched one{static_cast<int>(i), row.lower - binaries[0].second, {}};
      if (row.upper < kUnbounded || !(binaries[0].second < 0.0)) return std::nullopt;
      for (const auto& [column, coefficient] : binaries) {
        if (std::abs(coefficient - binaries[0].second) > 1e-9) return std::nullopt;
        one.condition.push_back(column);
        found.rows_of[static_cast<std::size_t>(column)].push_back(found.switched.size());
      }
      found.switched.push_back(one);
      continue;
    }
    found.dropped.push_back(static_cast<int>(i));
    if (row.lower == row.upper && (row.lower == 0.0 || row.lower == 1.0)) {
      Group group;
      group.always = row.lower == 1.0;
      for (const auto& [column, coefficient] : binaries) {
        if (coefficient != 1.0 && coefficient != -1.0) return std::nullopt;
        (coefficient > 0.0 ? group.options : group.condition).push_back(column);
      }
      found.groups.push_back(group);
    } else if (row.upper == 0.0) {
      for (const auto& [column, coefficient] : binaries) {
        if (coefficient != 1.0) return std::nullopt;
        found.forbidden[static_cast<std::size_t>(column)] = true;
      }
    } else {
      return std::nullopt;
    }
  }
  return found;
}

class Search {
 public:
  Search(const MilpModel& model, Structure structure, const std::function<double()>& clock, double limit_s)
      : model_(model),
        structure_(std::move(structure)),
        clock_(clock),
        end_(clock() + limit_s),
        chosen_(model.columns.size(), false),
        active_(structure_.switched.size(), 0),
        activity_(structure_.groups.size(), 0),
        group_of_(model.columns.size(), 0) {
    for (std::size_t g = 0; g < structure_.groups.size(); ++g) {
      for (const int option : structure_.groups[g].options) group_of_[static_cast<std::size_t>(option)] = g;
    }
    const SparseColumns sparse(model);
    clp_ = Clp_newModel();
    Clp_setLogLevel(clp_, 0);
    Clp_loadProblem(clp_, static_cast<int>(model.columns.size()), static_cast<int>(model.rows.size()),
                    sparse.starts.data(), sparse.rows.data(), sparse.values.data(),
                    sparse.column_lower.data(), sparse.column_upper.data(), sparse.cost.data(),
                    sparse.row_lower.data(), sparse.row_upper.data());
    Clp_setPrimalTolerance(clp_, 1e-9);
    for (std::size_t j = 0; j < model.columns.size(); ++j) {
      if (model.columns[j].integer) Clp_columnUpper(clp_)[j] = 0.0;
    }
    for (const int row : structure_.dropped) {
      Clp_rowLower(clp_)[row] = -SparseColumns::kInfinite;
      Clp_rowUpper(clp_)[row] = SparseColumns::kInfinite;
    }
    for (const Switched& row : structure_.switched) Clp_rowLower(clp_)[row.row] = -SparseColumns::kInfinite;
  }
  ~Search() { Clp_deleteModel(clp_); }
  Search(const Search&) = delete;
  Search& operator=(const Search&) = delete;

  // kFeasible, kInfeasible, kLimit (of time) or kFailed (no headway).
  MilpResult run() {
    Conflict conflict;
    const MilpStatus status = descend(conflict);
    MilpResult result{status, {}};
    if (status == MilpStatus::kFeasible) result.x = x_;
    return result;
  }

 private:
  bool holds(const std::vector<int>& condition, const std::vector<bool>& chosen) const {
    return std::any_of(condition.begin(), condition.end(),
                       [&chosen](int column) { return chosen[static_cast<std::size_t>(column)]; });
  }

  // By how much the rows that an option switches on are broken at x_.
  double broken_by(int option) const {
    double most = 0.0;
    for (const std::size_t index : structure_.rows_of[static_cast<std::size_t>(option)]) {
      const Switched& row = structure_.switched[index];
      double value = 0.0;
      for (const auto& [column, coefficient] : model_.rows[static_cast<std::size_t>(row.row)].terms) {
        if (!model_.columns[static_cast<std::size_t>(column)].integer)
          value += coefficient * x_[static_cast<std::size_t>(column)];
      }
      most = std::max(most, row.lower - value);
    }
    return most;
  }

  struct Branch {
    std::vector<std::pair<double, int>> options;  // by how much they are broken
    std::vector<int> condition;                   // of the group
  };

  // The group to decide next, or nothing: then x_ with its binaries is a solution.
  std::optional<Branch> next_branch() {
    std::vector<bool> trial = chosen_;
    std::optional<Branch> worst;
    std::pair<int, double> worst_rank{-1, 0.0};
    // A group's condition may be an option of a later or earlier group: repeat until nothing new comes true.
    std::vector<bool> settled(structure_.groups.size(), false);
    for (bool changed = true; changed && !worst;) {
      changed = false;
      for (std::size_t g = 0; g < structure_.groups.size(); ++g) {
        const Group& group = structure_.groups[g];
        if (settled[g] || !(group.always || holds(group.condition, trial))) continue;
        settled[g] = true;
        changed = true;
        if (holds(group.options, chosen_)) continue;
        Branch branch{{}, group.condition};
        for (const int option : group.options) {
          if (!structure_.forbidden[static_cast<std::size_t>(option)])
            branch.options.emplace_back(broken_by(option), option);
        }
        std::stable_sort(branch.options.begin(), branch.options.end(),
                         [](const auto& a, const auto& b) { return a.first < b.first; });
        const double least = branch.options.empty() ? kUnbounded : branch.options.front().first;
        // A group under an option that is only tried is decided by trying that option for good.
        const bool decided = group.always || holds(group.condition, chosen_);
        const std::pair<int, double> rank{activity_[g], least};
        if (least > kBroken) {
          if (rank <= worst_rank) continue;
          if (!decided) branch = parent_of(group, trial);
          worst = branch;
          worst_rank = rank;
        } else if (!branch.options.empty()) {
          trial[static_cast<std::size_t>(branch.options.front().second)] = true;
        }
      }
    }
    if (!worst) {
      for (std::size_t j = 0; j < trial.size(); ++j) {
        if (model_.columns[j].integer) x_[j] = trial[j] ? 1.0 : 0.0;
      }
    }
    return worst;
  }

  // The undecided group above a broken one.
  Branch parent_of(const Group& child, const std::vector<bool>& trial) const {
    const Group* at = &child;
    for (;;) {
      const Group* above = nullptr;
      for (const Group& group : structure_.groups) {
        for (const int option : group.options) {
          const bool is_condition =
              std::find(at->condition.begin(), at->condition.end(), option) != at->condition.end();
          if (is_condition && trial[static_cast<std::size_t>(option)]) above = &group;
        }
      }
      if (above == nullptr) return {{}, at->condition};
      at = above;
      if (at->always || holds(at->condition, chosen_)) break;
    }
    Branch branch{{}, at->condition};
    for (const int option : at->options) {
      if (!structure_.forbidden[static_cast<std::size_t>(option)])
        branch.options.emplace_back(broken_by(option), option);
    }
    std::stable_sort(branch.options.begin(), branch.options.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    return branch;
  }

  void set(int option, bool on) {
    chosen_[static_cast<std::size_t>(option)] = on;
    for (const std::size_t index : structure_.rows_of[static_cast<std::size_t>(option)]) {
      active_[index] += on ? 1 : -1;
      const Switched& row = structure_.switched[index];
      Clp_rowLower(clp_)[row.row] = active_[index] > 0 ? row.lower : -SparseColumns::kInfinite;
    }
  }

  // Choices that cannot hold together; filled when descend() finds no solution.
  using Conflict = std::set<int>;

  // Choices whose rows carry the proof that the linear problem has no solution; all of them if there is no
  // proof.
  Conflict conflict_of_problem() {
    Conflict conflict;
    double* ray = Clp_infeasibilityRay(clp_);
    for (std::size_t j = 0; j < chosen_.size(); ++j) {
      if (!chosen_[j]) continue;
      const std::vector<std::size_t>& rows = structure_.rows_of[j];
      const bool involved = ray == nullptr || std::any_of(rows.begin(), rows.end(), [&](std::size_t index) {
                              return std::abs(ray[structure_.switched[index].row]) > kInvolved;
                            });
      if (involved) conflict.insert(static_cast<int>(j));
    }
    if (ray != nullptr) Clp_freeRay(clp_, ray);
    return conflict;
  }

  MilpStatus descend(Conflict& conflict) {
    if (++problems_ > kMostProblems) return MilpStatus::kFailed;
    const double left = end_ - clock_();
    if (left <= 0.0) return MilpStatus::kLimit;
    Clp_setMaximumSeconds(clp_, left);
    Clp_dual(clp_, 0);
    const int status = Clp_status(clp_);
    if (status == 1) {
      conflict = conflict_of_problem();
      for (const int column : conflict) ++activity_[group_of_[static_cast<std::size_t>(column)]];
      return MilpStatus::kInfeasible;
    }
    if (status != 0) return status == 3 ? MilpStatus::kLimit : MilpStatus::kFailed;
    const double* x = Clp_primalColumnSolution(clp_);
    x_.assign(x, x + model_.columns.size());
    const std::optional<Branch> branch = next_branch();
    if (!branch) return MilpStatus::kFeasible;
    conflict.clear();
    for (const auto& [broken, option] : branch->options) {
      Conflict below;
      set(option, true);
      const MilpStatus status_below = descend(below);
      if (status_below != MilpStatus::kInfeasible) return status_below;
      set(option, false);
      // A dead end that does not depend on this choice is one for every other option too.
      if (below.erase(option) == 0) {
        conflict = below;
        return MilpStatus::kInfeasible;
      }
      conflict.insert(below.begin(), below.end());
    }
    for (const int column : branch->condition) {
      if (chosen_[static_cast<std::size_t>(column)]) conflict.insert(column);
    }
    return MilpStatus::kInfeasible;
  }

  const MilpModel& model_;
  Structure structure_;
  const std::function<double()>& clock_;
  double end_;
  Clp_Simplex* clp_ = nullptr;
  std::vector<bool> chosen_;
  std::vector<int> active_;
  std::vector<int> activity_;          // per group: dead ends it took part in; such groups are decided first
  std::vector<std::size_t> group_of_;  // per column
  std::vector<double> x_;
  int problems_ = 0;
};

class ChoiceSearch : public MilpSolver {
 public:
  ChoiceSearch(std::unique_ptr<MilpSolver> fallback, std::function<double()> clock)
      : fallback_(std::move(fallback)), clock_(std::move(clock)) {}

  MilpResult solve(const MilpModel& model, double limit_s) override {
    const double begin = clock_();
    std::optional<Structure> structure = structure_of(model);
    if (!structure || structure->groups.empty()) return fallback_->solve(model, limit_s);
    const MilpResult result = Search(model, std::move(*structure), clock_, limit_s).run();
    if (result.status != MilpStatus::kFailed) return result;
    return fallback_->solve(model, limit_s - (clock_() - begin));
  }

 private:
  std::unique_ptr<MilpSolver> fallback_;
  std::function<double()> clock_;
};

}  // namespace

std::unique_ptr<MilpSolver> make_choice_search(std::unique_ptr<MilpSolver> fallback,
                                               std::function<double()> clock) {
  return std::make_unique<ChoiceSearch>(std::move(fallback), std::move(clock));
}

}  // namespace atmos::stl
