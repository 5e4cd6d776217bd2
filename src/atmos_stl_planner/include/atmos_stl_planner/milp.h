// Mixed-integer linear problems and the one interface through which they are solved.
#pragma once

#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace atmos::stl {

inline constexpr double kUnbounded = std::numeric_limits<double>::infinity();

// constant + sum of coefficient * column
struct LinearExpression {
  std::vector<std::pair<int, double>> terms;
  double constant = 0.0;

  bool is_constant() const { return terms.empty(); }
  LinearExpression& add(const LinearExpression& other, double factor = 1.0);
};

struct MilpModel {
  struct Column {
    double lower, upper, cost;
    bool integer;
  };
  struct Row {
    double lower, upper;
    std::vector<std::pair<int, double>> terms;  // each column at most once
  };
  std::vector<Column> columns;
  std::vector<Row> rows;

  int add_column(double lower, double upper, double cost = 0.0, bool integer = false);
  int add_binary() { return add_column(0.0, 1.0, 0.0, true); }
  // lower <= expression <= upper; terms of the same column are summed.
  void add_row(double lower, const LinearExpression& expression, double upper);
};

// The model with its integers fixed at those of x, and so continuous. x may be shorter than the model:
// columns beyond it stay as they are.
MilpModel with_integers_fixed(const MilpModel& model, const std::vector<double>& x);

enum class MilpStatus {
  kOptimal,     // of the model as it stands, within the solver's tolerances
  kFeasible,    // a limit came first, with this solution
  kInfeasible,  // proven
  kLimit,       // a limit came first, without a solution
  kFailed,      // numerical trouble
};

struct MilpResult {
  MilpStatus status = MilpStatus::kFailed;
  std::vector<double> x;  // of kOptimal and kFeasible; integers are exact

  bool has_solution() const { return status == MilpStatus::kOptimal || status == MilpStatus::kFeasible; }
};

// Minimises. Deterministic unless the limit ends it. Objective values are never taken from a solver's word:
// CBC 2.10 reports wrong ones after preprocessing.
class MilpSolver {
 public:
  virtual ~MilpSolver() = default;
  virtual MilpResult solve(const MilpModel& model, double limit_s) = 0;
};

// CBC, in this process, on one thread; CLP where no column is integer.
std::unique_ptr<MilpSolver> make_cbc();

}  // namespace atmos::stl
