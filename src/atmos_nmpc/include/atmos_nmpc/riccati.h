// Discrete-time algebraic Riccati equation and the terminal weight made of it.
#pragma once

#include <Eigen/Core>

namespace atmos {

// Solves P = A'PA - A'PB (R + B'PB)^-1 B'PA + Q by structure-preserving doubling. A: n x n, B: n x m, Q: n x
// n positive semidefinite, R: m x m positive definite. Throws std::invalid_argument when (A, B) cannot be
// stabilised or the weights leave a mode unobserved on the unit circle, i.e. when the doubling does not
// converge.
Eigen::MatrixXd solve_dare(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B, const Eigen::MatrixXd& Q,
                           const Eigen::MatrixXd& R);

}  // namespace atmos
