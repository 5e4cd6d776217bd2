// Ipopt behind a boundary that never throws: one application for life, warm starts, and a complete status.
//
// Debian's sequential MUMPS has global state: only one solve at a time may run in a process.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "atmos_nmpc/nonlinear_program.h"

namespace atmos {

// Numbers as in atmos_msgs/NmpcStatus.
enum class SolverStatus {
  kSolved = 0,
  kAcceptable = 1,  // stopped at Ipopt's acceptable tolerance
  kIterationLimit = 2,
  kTimeLimit = 3,
  kInfeasible = 4,  // converged to a point of locally least infeasibility
  kDiverged = 5,
  kInvalidNumber = 6,  // a function or derivative is not finite
  kError = 7,          // anything else: failed restoration, exceptions, out of memory
  kNotRun = 8
};

inline bool is_success(SolverStatus status) {
  return status == SolverStatus::kSolved || status == SolverStatus::kAcceptable;
}
// "solved", "iteration_limit", ...
const char* name_of(SolverStatus status);

// A steady clock in seconds; the core reads none by itself.
using Stopwatch = std::function<double()>;

struct SolverOptions {
  int max_iterations = 40;
  std::optional<double> time_limit_s;        // on the stopwatch, checked at every iteration
  std::map<std::string, std::string> ipopt;  // passed through to Ipopt as they are
};

// The rule that Ipopt's option `name` = `value` breaks (unknown, wrong type, out of range); empty if none.
std::string ipopt_option_fault(const std::string& name, const std::string& value);

struct SolveResult {
  SolverStatus status = SolverStatus::kNotRun;
  int iterations = 0;
  double objective = 0.0;
  double solve_time_s = 0.0;
};

// False: this build's Ipopt takes no linear solver from outside, and MUMPS does the work, several times
// slower (docs/nmpc_solver.md).
bool riccati_available();

class OptimalControlSolver {
 public:
  // A problem with a stage layout is factorised by StageKkt, unless the options name a linear_solver of
  // Ipopt's. `problem` must outlive the solver. Throws std::invalid_argument naming an option that Ipopt does
  // not take.
  OptimalControlSolver(const NonlinearProgram& problem, const SolverOptions& options, Stopwatch stopwatch);
  ~OptimalControlSolver();

  bool uses_riccati() const;

  // Starts from `iterate` and leaves the solution there; on failure what it leaves is Ipopt's last point.
  SolveResult solve(Iterate& iterate) noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace atmos
