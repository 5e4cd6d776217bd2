#include "atmos_nmpc/riccati.h"

#include <Eigen/LU>
#include <stdexcept>

namespace atmos {

Eigen::MatrixXd solve_dare(const Eigen::MatrixXd& A, const Eigen::MatrixXd& B, const Eigen::MatrixXd& Q,
                           const Eigen::MatrixXd& R) {
  // Each round doubles the horizon of the finite problem, so that 60 rounds cover any that converges.
  constexpr int kRounds = 60;
  const Eigen::MatrixXd unit = Eigen::MatrixXd::Identity(A.rows(), A.cols());
  Eigen::MatrixXd F = A;
  Eigen::MatrixXd G = B * R.inverse() * B.transpose();
  Eigen::MatrixXd H = Q;
  for (int round = 0; round < kRounds; ++round) {
    const Eigen::PartialPivLU<Eigen::MatrixXd> W(unit + G * H);
    const Eigen::MatrixXd W_F = W.solve(F);
    const Eigen::MatrixXd W_G = W.solve(G);
    const Eigen::MatrixXd gain = F.transpose() * H * W_F;
    G += F * W_G * F.transpose();
    F = F * W_F;
    H += gain;
    H = 0.5 * (H + H.transpose()).eval();
    if (!H.allFinite()) break;
    // Largest coefficients, which do not overflow before the matrices do, as a norm's squares would.
    if (gain.cwiseAbs().maxCoeff() <= 1e-14 * H.cwiseAbs().maxCoeff()) return H;
  }
  throw std::invalid_argument("the Riccati equation has no stabilising solution for these weights");
}

}  // namespace atmos
