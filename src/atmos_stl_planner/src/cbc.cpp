#include <Cbc_C_Interface.h>
#include <Clp_C_Interface.h>

#include <cmath>
#include <cstdio>

#include "atmos_stl_planner/milp.h"
#include "sparse_columns.h"

namespace atmos::stl {

namespace {

constexpr double kIntegrality = 1e-5;
constexpr double kFeasibility = 1e-6;
constexpr double kRepairLimit_s = 60.0;

bool satisfies(const MilpModel& model, const std::vector<double>& x) {
  for (const MilpModel::Row& row : model.rows) {
    double sum = 0.0, size = 1.0;
    for (const auto& [column, value] : row.terms) {
      sum += value * x[static_cast<std::size_t>(column)];
      size = std::max(size, std::abs(value));
    }
    if (!(sum >= row.lower - kFeasibility * size && sum <= row.upper + kFeasibility * size)) return false;
  }
  return true;
}

MilpResult solve_lp(const MilpModel& model, double limit_s) {
  const SparseColumns sparse(model);
  Clp_Simplex* clp = Clp_newModel();
  Clp_setLogLevel(clp, 0);
  Clp_loadProblem(clp, static_cast<int>(model.columns.size()), static_cast<int>(model.rows.size()),
                  sparse.starts.data(), sparse.rows.data(), sparse.values.data(), sparse.column_lower.data(),
                  sparse.column_upper.data(), sparse.cost.data(), sparse.row_lower.data(),
                  sparse.row_upper.data());
  Clp_setMaximumSeconds(clp, limit_s);
  Clp_setPrimalTolerance(clp, 1e-9);
  Clp_dual(clp, 0);
  MilpResult result;
  const int status = Clp_status(clp);
  result.status = status == 0   ? MilpStatus::kOptimal
                  : status == 1 ? MilpStatus::kInfeasible
                  : status == 3 ? MilpStatus::kLimit
                                : MilpStatus::kFailed;
  if (status == 0) {
    const double* x = Clp_primalColumnSolution(clp);
    result.x.assign(x, x + model.columns.size());
  }
  Clp_deleteModel(clp);
  return result;
}

class Cbc : public MilpSolver {
 public:
  MilpResult solve(const MilpModel& model, double limit_s) override {
    if (!(limit_s > 0.0)) return {MilpStatus::kLimit, {}};
    bool integer = false;
    for (const MilpModel::Column& column : model.columns) integer = integer || column.integer;
    return integer ? solve_integer(model, limit_s) : solve_lp(model, limit_s);
  }

 private:
  static MilpResult solve_integer(const MilpModel& model, double limit_s) {
    const SparseColumns sparse(model);
    Cbc_Model* cbc = Cbc_newModel();
    Cbc_loadProblem(cbc, static_cast<int>(model.columns.size()), static_cast<int>(model.rows.size()),
                    sparse.starts.data(), sparse.rows.data(), sparse.values.data(),
                    sparse.column_lower.data(), sparse.column_upper.data(), sparse.cost.data(),
                    sparse.row_lower.data(), sparse.row_upper.data());
    for (std::size_t j = 0; j < model.columns.size(); ++j) {
      if (model.columns[j].integer) Cbc_setInteger(cbc, static_cast<int>(j));
    }
    char seconds[32];
    std::snprintf(seconds, sizeof seconds, "%.3f", limit_s);
    Cbc_setParameter(cbc, "log", "0");
    Cbc_setParameter(cbc, "preprocess", "off");
    Cbc_setParameter(cbc, "timeMode", "elapsed");
    Cbc_setParameter(cbc, "sec", seconds);
    Cbc_setParameter(cbc, "integerTolerance", "1e-7");
    Cbc_solve(cbc);

    MilpResult result;
    const bool complete = Cbc_isProvenOptimal(cbc) != 0;
    // Whatever else it says, a point counts as a solution only after a look at it.
    if (complete || Cbc_bestSolution(cbc) != nullptr) {
      const double* x = complete ? Cbc_getColSolution(cbc) : Cbc_bestSolution(cbc);
      result.x.assign(x, x + model.columns.size());
    }
    const bool infeasible = Cbc_isProvenInfeasible(cbc) != 0;
    const bool abandoned = Cbc_isAbandoned(cbc) != 0;
    Cbc_deleteModel(cbc);
    if (!result.x.empty() && settle(model, result.x)) {
      result.status = complete ? MilpStatus::kOptimal : MilpStatus::kFeasible;
      return result;
    }
    result.x.clear();
    result.status = complete || abandoned ? MilpStatus::kFailed
                    : infeasible          ? MilpStatus::kInfeasible
                                          : MilpStatus::kLimit;
    return result;
  }

  // Makes the integers exact and the rest fit them.
  static bool settle(const MilpModel& model, std::vector<double>& x) {
    bool exact = true;
    for (std::size_t j = 0; j < model.columns.size(); ++j) {
      if (!model.columns[j].integer) continue;
      const double rounded = std::round(x[j]);
      if (std::abs(x[j] - rounded) > kIntegrality) return false;
      exact = exact && x[j] == rounded;
      x[j] = rounded;
    }
    if (exact && satisfies(model, x)) return true;
    const MilpResult repaired = solve_lp(with_integers_fixed(model, x), kRepairLimit_s);
    if (repaired.status != MilpStatus::kOptimal) return false;
    x = repaired.x;
    return true;
  }
};

}  // namespace

std::unique_ptr<MilpSolver> make_cbc() { return std::make_unique<Cbc>(); }

}  // namespace atmos::stl
