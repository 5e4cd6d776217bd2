// What a solver sees of an optimal control problem: min f(z) subject to g(z) = 0 and lower <= z <= upper.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

namespace atmos {

// Positions of the non-zeros of a matrix, in the order in which their values are written.
struct Sparsity {
  std::vector<int> rows;
  std::vector<int> columns;

  void add(int row, int column) {
    rows.push_back(row);
    columns.push_back(column);
  }
  int size() const { return static_cast<int>(rows.size()); }
};

// A primal-dual point. lambda: multipliers of g, with the Lagrangian f + lambda' g - bound_lower' (z - lower)
// - ...
struct Iterate {
  Eigen::VectorXd z;
  Eigen::VectorXd bound_lower;  // multipliers of the bounds, >= 0
  Eigen::VectorXd bound_upper;
  Eigen::VectorXd lambda;
};

// How many bounds shape a plan: inputs at their limit, and states that their soft bounds hold back.
struct ActiveBounds {
  int inputs = 0;
  int states = 0;
};

// Shape of an optimal control problem in stage order: z = [u0 x1 u1 ... u(N-1) xN], constraint rows k:
// F(x_k, u_k) - x_(k+1), Hessian blocks within one (x_k, u_k).
struct StageLayout {
  int stages;  // N
  int states;
  int inputs;

  int variables() const { return stages * (states + inputs); }
  int constraints() const { return stages * states; }
};

// Values may be asked for in any order and at any point; functions fill arrays of the sizes declared. The
// structure never changes during an object's life, so that a solver analyses it once.
class NonlinearProgram {
 public:
  virtual ~NonlinearProgram() = default;

  virtual int variable_count() const = 0;
  virtual int constraint_count() const = 0;
  // None: a general program, which the solver factorises as such.
  virtual std::optional<StageLayout> stage_layout() const { return std::nullopt; }
  // Infinite where there is no bound.
  virtual const Eigen::VectorXd& lower_bounds() const = 0;
  virtual const Eigen::VectorXd& upper_bounds() const = 0;
  virtual const Sparsity& jacobian_sparsity() const = 0;
  // Lower triangle.
  virtual const Sparsity& hessian_sparsity() const = 0;

  virtual double objective(const double* z) const = 0;
  virtual void gradient(const double* z, double* values) const = 0;
  virtual void constraints(const double* z, double* values) const = 0;
  virtual void jacobian(const double* z, double* values) const = 0;
  // Of objective_factor * f + lambda' g.
  virtual void hessian(const double* z, double objective_factor, const double* lambda,
                       double* values) const = 0;
};

}  // namespace atmos
