#include "atmos_nmpc/solver.h"

#include <IpIpoptApplication.hpp>
#include <IpRegOptions.hpp>
#include <IpSolveStatistics.hpp>
#include <IpTNLP.hpp>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <stdexcept>
#include <utility>

#include "riccati_linear_solver.h"

namespace atmos {

namespace {

using Ipopt::Index;
using Ipopt::Number;

// Ipopt takes anything beyond this as no bound.
constexpr double kIpoptInfinity = 2e19;

// Defaults of the controller; the configuration's options come after them. mu_init suits warm starts, and
// lies below tol: from a barrier parameter as large as tol the last iteration would only be spent on lowering
// it; constant derivatives of the terminal stage are not told apart, so that no *_constant option is set.
const std::map<std::string, std::string>& default_options() {
  static const std::map<std::string, std::string> options = {
      {"print_level", "0"},
      {"sb", "yes"},
      {"tol", "1e-4"},
      {"mu_init", "5e-5"},
      {"nlp_scaling_method", "none"},
      {"fast_step_computation", "yes"},
      {"warm_start_init_point", "yes"},
      {"warm_start_bound_push", "1e-6"},
      {"warm_start_bound_frac", "1e-6"},
      {"warm_start_mult_bound_push", "1e-6"},
      {"linear_solver", "mumps"},
      {"mumps_permuting_scaling", "0"},
      {"mumps_scaling", "0"},
  };
  return options;
}

bool parse_number(const std::string& text, double& value) {
  char* end = nullptr;
  value = std::strtod(text.c_str(), &end);
  return !text.empty() && *end == '\0';
}

// Sets one option by the type Ipopt registered for it; returns the broken rule.
std::string set_option(Ipopt::IpoptApplication& app, const std::string& name, const std::string& value) {
  const Ipopt::SmartPtr<const Ipopt::RegisteredOption> option = app.RegOptions()->GetOption(name);
  if (!Ipopt::IsValid(option)) return "is not an option of Ipopt";
  double number = 0.0;
  switch (option->Type()) {
    case Ipopt::OT_Number:
      if (!parse_number(value, number) || !option->IsValidNumberSetting(number))
        return "must be a number in Ipopt's range for it, is " + value;
      app.Options()->SetNumericValue(name, number);
      return "";
    case Ipopt::OT_Integer:
      if (!parse_number(value, number) || number != std::floor(number) || std::abs(number) > 1e9 ||
          !option->IsValidIntegerSetting(static_cast<Index>(number)))
        return "must be an integer in Ipopt's range for it, is " + value;
      app.Options()->SetIntegerValue(name, static_cast<Index>(number));
      return "";
    default:
      if (!option->IsValidStringSetting(value)) return "must be one of Ipopt's settings for it, is " + value;
      app.Options()->SetStringValue(name, value);
      return "";
  }
}

// Options that ask for another factorisation, or that scale the rows out of the form StageKkt takes.
bool leaves_riccati(const std::map<std::string, std::string>& options) {
  const auto scaling = options.find("nlp_scaling_method");
  return options.count("linear_solver") == 0 && (scaling == options.end() || scaling->second == "none");
}

SolverStatus status_of(Ipopt::ApplicationReturnStatus status) {
  switch (status) {
    case Ipopt::Solve_Succeeded:
    case Ipopt::Feasible_Point_Found:
      return SolverStatus::kSolved;
    case Ipopt::Solved_To_Acceptable_Level:
      return SolverStatus::kAcceptable;
    case Ipopt::Maximum_Iterations_Exceeded:
      return SolverStatus::kIterationLimit;
    case Ipopt::User_Requested_Stop:  // only our own time limit asks for it
    case Ipopt::Maximum_CpuTime_Exceeded:
      return SolverStatus::kTimeLimit;
    case Ipopt::Infeasible_Problem_Detected:
      return SolverStatus::kInfeasible;
    case Ipopt::Diverging_Iterates:
      return SolverStatus::kDiverged;
    case Ipopt::Invalid_Number_Detected:
      return SolverStatus::kInvalidNumber;
    default:
      return SolverStatus::kError;
  }
}

// Copies between Ipopt's arrays and the problem; functions that throw end the solve with an error status.
class Adapter : public Ipopt::TNLP {
 public:
  explicit Adapter(const NonlinearProgram& problem) : problem_(problem) {}

  Iterate* iterate = nullptr;
  std::function<bool()> out_of_time;
  double objective = 0.0;
  int iterations = 0;

  bool get_nlp_info(Index& n, Index& m, Index& nnz_jacobian, Index& nnz_hessian,
                    IndexStyleEnum& style) override {
    n = problem_.variable_count();
    m = problem_.constraint_count();
    nnz_jacobian = problem_.jacobian_sparsity().size();
    nnz_hessian = problem_.hessian_sparsity().size();
    style = C_STYLE;
    return true;
  }

  bool get_bounds_info(Index n, Number* lower, Number* upper, Index m, Number* g_lower,
                       Number* g_upper) override {
    for (Index i = 0; i < n; ++i) {
      lower[i] = std::max(problem_.lower_bounds()[i], -kIpoptInfinity);
      upper[i] = std::min(problem_.upper_bounds()[i], kIpoptInfinity);
    }
    std::fill(g_lower, g_lower + m, 0.0);
    std::fill(g_upper, g_upper + m, 0.0);
    return true;
  }

  bool get_starting_point(Index n, bool init_z, Number* z, bool init_bounds, Number* bound_lower,
                          Number* bound_upper, Index m, bool init_lambda, Number* lambda) override {
    if (init_z) std::copy_n(iterate->z.data(), n, z);
    if (init_bounds) {
      std::copy_n(iterate->bound_lower.data(), n, bound_lower);
      std::copy_n(iterate->bound_upper.data(), n, bound_upper);
    }
    if (init_lambda) std::copy_n(iterate->lambda.data(), m, lambda);
    return true;
  }

  bool eval_f(Index, const Number* z, bool, Number& value) override {
    value = problem_.objective(z);
    return true;
  }
  bool eval_grad_f(Index, const Number* z, bool, Number* values) override {
    problem_.gradient(z, values);
    return true;
  }
  bool eval_g(Index, const Number* z, bool, Index, Number* values) override {
    problem_.constraints(z, values);
    return true;
  }
  bool eval_jac_g(Index, const Number* z, bool, Index, Index, Index* rows, Index* columns,
                  Number* values) override {
    if (values == nullptr) {
      declare(problem_.jacobian_sparsity(), rows, columns);
    } else {
      problem_.jacobian(z, values);
    }
    return true;
  }
  bool eval_h(Index, const Number* z, bool, Number factor, Index, const Number* lambda, bool, Index,
              Index* rows, Index* columns, Number* values) override {
    if (values == nullptr) {
      declare(problem_.hessian_sparsity(), rows, columns);
    } else {
      problem_.hessian(z, factor, lambda, values);
    }
    return true;
  }

  bool intermediate_callback(Ipopt::AlgorithmMode, Index iteration, Number, Number, Number, Number, Number,
                             Number, Number, Number, Index, const Ipopt::IpoptData*,
                             Ipopt::IpoptCalculatedQuantities*) override {
    iterations = iteration;
    return !out_of_time();
  }

  void finalize_solution(Ipopt::SolverReturn, Index n, const Number* z, const Number* bound_lower,
                         const Number* bound_upper, Index m, const Number*, const Number* lambda,
                         Number value, const Ipopt::IpoptData*, Ipopt::IpoptCalculatedQuantities*) override {
    objective = value;
    std::copy_n(z, n, iterate->z.data());
    std::copy_n(bound_lower, n, iterate->bound_lower.data());
    std::copy_n(bound_upper, n, iterate->bound_upper.data());
    std::copy_n(lambda, m, iterate->lambda.data());
  }

 private:
  static void declare(const Sparsity& sparsity, Index* rows, Index* columns) {
    std::copy(sparsity.rows.begin(), sparsity.rows.end(), rows);
    std::copy(sparsity.columns.begin(), sparsity.columns.end(), columns);
  }

  const NonlinearProgram& problem_;
};

}  // namespace

const char* name_of(SolverStatus status) {
  switch (status) {
    case SolverStatus::kSolved:
      return "solved";
    case SolverStatus::kAcceptable:
      return "acceptable";
    case SolverStatus::kIterationLimit:
      return "iteration_limit";
    case SolverStatus::kTimeLimit:
      return "time_limit";
    case SolverStatus::kInfeasible:
      return "infeasible";
    case SolverStatus::kDiverged:
      return "diverged";
    case SolverStatus::kInvalidNumber:
      return "invalid_number";
    case SolverStatus::kError:
      return "error";
    case SolverStatus::kNotRun:
      return "not_run";
  }
  return "unknown";
}

std::string ipopt_option_fault(const std::string& name, const std::string& value) {
  const Ipopt::SmartPtr<Ipopt::IpoptApplication> app = new Ipopt::IpoptApplication(false);
  return set_option(*app, name, value);
}

bool riccati_available() { return riccati_seam_available(); }

struct OptimalControlSolver::Impl {
  Ipopt::SmartPtr<Ipopt::IpoptApplication> app;
  Ipopt::SmartPtr<Adapter> adapter;
  Stopwatch stopwatch;
  std::optional<double> time_limit_s;
  std::unique_ptr<RiccatiLinearSolver> riccati;  // none: Ipopt's own linear solver
  bool structure_known = false;

  SolverStatus optimize() {
    const RiccatiInUse use(riccati.get());
    if (structure_known) return status_of(app->ReOptimizeTNLP(Ipopt::GetRawPtr(adapter)));
    const SolverStatus status = status_of(app->OptimizeTNLP(Ipopt::GetRawPtr(adapter)));
    structure_known = is_success(status);
    if (structure_known) app->Options()->SetStringValue("warm_start_same_structure", "yes");
    return status;
  }
};

OptimalControlSolver::OptimalControlSolver(const NonlinearProgram& problem, const SolverOptions& options,
                                           Stopwatch stopwatch)
    : impl_(std::make_unique<Impl>()) {
  impl_->app = new Ipopt::IpoptApplication(false);
  impl_->adapter = new Adapter(problem);
  impl_->stopwatch = std::move(stopwatch);
  impl_->time_limit_s = options.time_limit_s;
  for (const auto& [name, value] : default_options()) set_option(*impl_->app, name, value);
  set_option(*impl_->app, "max_iter", std::to_string(options.max_iterations));
  const std::optional<StageLayout> layout = problem.stage_layout();
  if (layout && riccati_available() && leaves_riccati(options.ipopt)) {
    install_riccati_seam();
    impl_->riccati = std::make_unique<RiccatiLinearSolver>(*layout);
    set_option(*impl_->app, "linear_solver", "ma27");
    set_option(*impl_->app, "linear_system_scaling", "none");
  }
  for (const auto& [name, value] : options.ipopt) {
    const std::string fault = set_option(*impl_->app, name, value);
    if (!fault.empty()) throw std::invalid_argument("Ipopt option " + name + ": " + fault);
  }
  if (impl_->app->Initialize("") != Ipopt::Solve_Succeeded)
    throw std::invalid_argument("Ipopt refuses its options");
}

OptimalControlSolver::~OptimalControlSolver() = default;

bool OptimalControlSolver::uses_riccati() const { return impl_->riccati != nullptr; }

SolveResult OptimalControlSolver::solve(Iterate& iterate) noexcept {
  SolveResult result;
  double start = 0.0;
  try {
    start = impl_->stopwatch();
    Adapter& adapter = *impl_->adapter;
    adapter.iterate = &iterate;
    adapter.iterations = 0;
    adapter.objective = 0.0;
    adapter.out_of_time = [this, start] {
      return impl_->time_limit_s && impl_->stopwatch() - start > *impl_->time_limit_s;
    };
    result.status = impl_->optimize();
    result.iterations = adapter.iterations;
    result.objective = adapter.objective;
    result.solve_time_s = impl_->stopwatch() - start;
  } catch (...) {
    result.status = SolverStatus::kError;
  }
  if (is_success(result.status) && !iterate.z.allFinite()) result.status = SolverStatus::kInvalidNumber;
  return result;
}

}  // namespace atmos
