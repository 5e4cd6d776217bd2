// The KKT system of an optimal control problem in stage order, factorised stage by stage (Riccati recursion):
//
//   [ H  J' ] [ dz     ]   [ r_z ]
//   [ J  -E ] [ lambda ] = [ r_c ]      with J's row block k: A_k x_k + B_k u_k - x_(k+1), E >= 0 diagonal.
//
// Backwards from the last stage, (x_(k+1), lambda_k) and then u_k are eliminated; with E = 0 that is
// P_k = Q + A'PA - (S + B'PA)' (R + B'PB)^-1 (S + B'PA). Work grows with N (n + m)^3 and not with fill-in.
// (Rao, Wright, Rawlings: Application of interior-point methods to model predictive control, JOTA 1998.)
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "atmos_nmpc/nonlinear_program.h"

namespace atmos {

class StageKkt {
 public:
  explicit StageKkt(const StageLayout& layout);

  const StageLayout& layout() const { return layout_; }
  // Number of unknowns: variables and then multipliers, numbered as in the system above.
  int size() const { return layout_.variables() + layout_.constraints(); }

  // Where the entry (row, column), from either triangle, is held in entries(); none when the stage structure
  // has no such entry.
  std::optional<int> slot(int row, int column) const;
  // Entries of H and J, and -E; set_zero() and then add to what slot() says.
  double* entries() { return entries_.data(); }
  void set_zero() { entries_.setZero(); }

  // False: the inertia is not (variables, constraints, 0), that is, some pivot block of the elimination is
  // not positive definite, or x_(k+1) does not stand with factor -1 in the rows of stage k. No solve then.
  bool factorise();

  // Overwrites the right-hand side [r_z; r_c] with the solution. Allocates nothing.
  void solve(double* rhs);

 private:
  double* block(int stage) { return entries_.data() + stage * stage_entries_; }
  double* dynamics(int stage) { return block(stage) + hessian_entries_; }
  bool regularise(int stage);

  StageLayout layout_;
  int states_, inputs_, both_;  // n, m, n + m
  int state_rows_, both_rows_;  // the same, rounded up to whole vectors
  int hessian_entries_, dynamics_entries_, stage_entries_;
  int coupling_at_, dual_at_;  // of the factors of x_(k+1) and of -E in entries_
  Eigen::VectorXd entries_;
  Eigen::VectorXd dynamics_transposed_;  // per stage, [B A]'
  Eigen::VectorXd cost_to_go_;           // per stage k, P of x_(k+1), as seen through E
  Eigen::VectorXd dual_filter_;          // per stage k, (I + P E)^-1; only with a dual block
  Eigen::VectorXd eliminated_;           // per stage, first m columns of the Cholesky factor of (u_k, x_k)
  Eigen::VectorXd product_, pivot_;      // scratch
  Eigen::VectorXd slope_, dual_, both_vector_, state_vector_, step_;
  bool has_dual_block_ = false;
};

}  // namespace atmos
