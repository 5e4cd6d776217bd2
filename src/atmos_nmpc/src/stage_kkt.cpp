#include "atmos_nmpc/stage_kkt.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "vectorised.h"

namespace atmos {

namespace {

// Leading dimensions are whole vectors, padded with zeros.
int rounded_up(int count) { return (count + kWidth - 1) / kWidth * kWidth; }

// C += A B, column-major; rows and columns are multiples of kWidth.
ATMOS_VECTORISED void add_product(int rows, int columns, int inner, const double* A, int lda, const double* B,
                                  int ldb, double* C, int ldc) {
  for (int j = 0; j < columns; j += 4) {
    const double* b = B + j * ldb;
    int i = 0;
    for (; i + 2 * kWidth <= rows; i += 2 * kWidth) {
      double* c = C + j * ldc + i;
      Vector s[4][2];
      for (int q = 0; q < 4; ++q) {
        s[q][0] = *reinterpret_cast<const Vector*>(c + q * ldc);
        s[q][1] = *reinterpret_cast<const Vector*>(c + q * ldc + kWidth);
      }
      for (int k = 0; k < inner; ++k) {
        const Vector a0 = *reinterpret_cast<const Vector*>(A + k * lda + i);
        const Vector a1 = *reinterpret_cast<const Vector*>(A + k * lda + i + kWidth);
        for (int q = 0; q < 4; ++q) {
          s[q][0] += a0 * b[q * ldb + k];
          s[q][1] += a1 * b[q * ldb + k];
        }
      }
      for (int q = 0; q < 4; ++q) {
        *reinterpret_cast<Vector*>(c + q * ldc) = s[q][0];
        *reinterpret_cast<Vector*>(c + q * ldc + kWidth) = s[q][1];
      }
    }
    for (; i < rows; i += kWidth) {
      double* c = C + j * ldc + i;
      Vector s[4];
      for (int q = 0; q < 4; ++q) s[q] = *reinterpret_cast<const Vector*>(c + q * ldc);
      for (int k = 0; k < inner; ++k) {
        const Vector a = *reinterpret_cast<const Vector*>(A + k * lda + i);
        for (int q = 0; q < 4; ++q) s[q] += a * b[q * ldb + k];
      }
      for (int q = 0; q < 4; ++q) *reinterpret_cast<Vector*>(c + q * ldc) = s[q];
    }
  }
}

// y += A x; rows is a multiple of kWidth.
ATMOS_VECTORISED void add_matrix_vector(int rows, int columns, const double* A, int lda, const double* x,
                                        double* y) {
  for (int i = 0; i < rows; i += kWidth) {
    Vector s = *reinterpret_cast<const Vector*>(y + i);
    for (int k = 0; k < columns; ++k) s += *reinterpret_cast<const Vector*>(A + k * lda + i) * x[k];
    *reinterpret_cast<Vector*>(y + i) = s;
  }
}

// Cholesky elimination of the first `inputs` columns of the symmetric H (lower triangle): these columns
// become those of the factor, the rest the Schur complement.
ATMOS_VECTORISED bool eliminate(int inputs, int both, int rows, double* H) {
  for (int c = 0; c < inputs; ++c) {
    double* column = H + c * rows;
    if (!(column[c] > 0.0) || !std::isfinite(column[c])) return false;
    const double scale = 1.0 / std::sqrt(column[c]);
    for (int i = c; i < rows; ++i) column[i] *= scale;
    for (int j = c + 1; j < both; ++j) {
      const double factor = column[j];
      double* target = H + j * rows;
      for (int i = j / kWidth * kWidth; i < rows; ++i) target[i] -= factor * column[i];
    }
  }
  return true;
}

}  // namespace

StageKkt::StageKkt(const StageLayout& layout)
    : layout_(layout),
      states_(layout.states),
      inputs_(layout.inputs),
      both_(states_ + inputs_),
      state_rows_(rounded_up(states_)),
      both_rows_(rounded_up(both_)),
      hessian_entries_(both_rows_ * both_rows_),
      dynamics_entries_(state_rows_ * both_rows_),
      stage_entries_(hessian_entries_ + dynamics_entries_),
      coupling_at_((layout.stages + 1) * stage_entries_),
      dual_at_(coupling_at_ + layout.constraints()) {
  const int N = layout.stages;
  entries_ = Eigen::VectorXd::Zero(dual_at_ + layout.constraints());
  dynamics_transposed_ = Eigen::VectorXd::Zero(N * both_rows_ * states_);
  cost_to_go_ = Eigen::VectorXd::Zero(N * state_rows_ * states_);
  dual_filter_ = Eigen::VectorXd::Zero(N * state_rows_ * states_);
  eliminated_ = Eigen::VectorXd::Zero(N * both_rows_ * inputs_);
  product_ = Eigen::VectorXd::Zero(dynamics_entries_);
  pivot_ = Eigen::VectorXd::Zero(hessian_entries_);
  slope_ = Eigen::VectorXd::Zero((N + 1) * state_rows_);
  dual_ = Eigen::VectorXd::Zero(N * state_rows_);
  both_vector_ = Eigen::VectorXd::Zero(both_rows_);
  state_vector_ = Eigen::VectorXd::Zero(state_rows_);
  step_ = Eigen::VectorXd::Zero(state_rows_);
}

std::optional<int> StageKkt::slot(int row, int column) const {
  const int variables = layout_.variables();
  const int low = std::min(row, column), high = std::max(row, column);
  if (low < 0 || high >= size()) return std::nullopt;
  // Stage of a variable and its place in (u_k, x_k).
  const auto place = [this](int z) {
    const int k = (z + states_) / both_, at = (z + states_) % both_;
    return std::pair(k, at < states_ ? inputs_ + at : at - states_);
  };
  if (low >= variables) return low == high ? std::optional(dual_at_ + low - variables) : std::nullopt;
  const auto [k, at] = place(low);
  if (high < variables) {
    const auto [other_k, other] = place(high);
    if (k != other_k) return std::nullopt;
    return k * stage_entries_ + std::min(at, other) * both_rows_ + std::max(at, other);
  }
  const int stage = (high - variables) / states_, r = (high - variables) % states_;
  if (k == stage) return k * stage_entries_ + hessian_entries_ + at * state_rows_ + r;
  if (k == stage + 1 && at == inputs_ + r) return coupling_at_ + high - variables;
  return std::nullopt;
}

// With E, the dual block of the rows of `stage`, and F = (I + P E)^-1: keeps F and puts F P in place of the
// cost to go P, which is what the rows let through of it. By way of the symmetric I + S P S, S^2 = E: in
// Ipopt's restoration E spans many orders of magnitude, and P - P S (..)^-1 S P would cancel.
bool StageKkt::regularise(int stage) {
  using Matrix = Eigen::MatrixXd;
  const auto matrix_at = [this, stage](Eigen::VectorXd& all) {
    return Eigen::Map<Matrix, 0, Eigen::OuterStride<>>(all.data() + stage * state_rows_ * states_, states_,
                                                       states_, Eigen::OuterStride<>(state_rows_));
  };
  auto P = matrix_at(cost_to_go_), F = matrix_at(dual_filter_);
  const auto minus_E = entries_.segment(dual_at_ + stage * states_, states_);
  if (!(minus_E.array() <= 0.0).all()) return false;
  const Eigen::VectorXd S = (-minus_E).cwiseSqrt();
  const Matrix inner = Matrix::Identity(states_, states_) + S.asDiagonal() * P * S.asDiagonal();
  const Eigen::LLT<Matrix> factor(inner);
  if (factor.info() != Eigen::Success) return false;
  const Matrix X = factor.solve(Matrix(S.asDiagonal()));
  const Matrix P_S_X = P * S.asDiagonal() * X;
  for (int i = 0; i < states_; ++i) {
    if (S[i] > 0.0) {
      F.row(i) = X.row(i) / S[i];
    } else {
      F.row(i) = Matrix::Identity(states_, states_).row(i) - P_S_X.row(i);
    }
  }
  const Matrix through = F * P;
  P = 0.5 * (through + through.transpose());
  return true;
}

bool StageKkt::factorise() {
  const int N = layout_.stages;
  if ((entries_.segment(coupling_at_, layout_.constraints()).array() != -1.0).any()) return false;
  has_dual_block_ = (entries_.segment(dual_at_, layout_.constraints()).array() != 0.0).any();
  const double* H = block(N);
  for (int k = N - 1; k >= 0; --k) {
    // H holds the lower triangle over (u, x) of stage k + 1; its x block is the cost to go.
    double* P = cost_to_go_.data() + k * state_rows_ * states_;
    for (int c = 0; c < states_; ++c) {
      for (int r = c; r < states_; ++r)
        P[c * state_rows_ + r] = P[r * state_rows_ + c] = H[(inputs_ + c) * both_rows_ + inputs_ + r];
    }
    if (has_dual_block_ && !regularise(k)) return false;

    const double* G = dynamics(k);
    double* Gt = dynamics_transposed_.data() + k * both_rows_ * states_;
    for (int c = 0; c < both_; ++c) {
      for (int r = 0; r < states_; ++r) Gt[r * both_rows_ + c] = G[c * state_rows_ + r];
    }
    product_.setZero();
    add_product(state_rows_, both_rows_, states_, P, state_rows_, G, state_rows_, product_.data(),
                state_rows_);
    std::copy_n(block(k), hessian_entries_, pivot_.data());
    add_product(both_rows_, both_rows_, states_, Gt, both_rows_, product_.data(), state_rows_, pivot_.data(),
                both_rows_);
    if (!eliminate(inputs_, both_, both_rows_, pivot_.data())) return false;
    std::copy_n(pivot_.data(), both_rows_ * inputs_, eliminated_.data() + k * both_rows_ * inputs_);
    H = pivot_.data();
  }
  return true;
}

void StageKkt::solve(double* rhs) {
  const int N = layout_.stages;
  const double* r_c = rhs + layout_.variables();
  // slope_ of stage k: p with lambda_(k-1) = P_k x_k - p; dual_ of stage k: the same of lambda_k, seen
  // through E.
  std::copy_n(rhs + (N - 1) * both_ + inputs_, states_, slope_.data() + N * state_rows_);
  for (int k = N - 1; k >= 0; --k) {
    const double* P = cost_to_go_.data() + k * state_rows_ * states_;
    const double* Gt = dynamics_transposed_.data() + k * both_rows_ * states_;
    const double* L = eliminated_.data() + k * both_rows_ * inputs_;
    double* p = slope_.data() + (k + 1) * state_rows_;
    double* seen = dual_.data() + k * state_rows_;
    if (has_dual_block_) {
      std::fill_n(seen, state_rows_, 0.0);
      add_matrix_vector(state_rows_, states_, dual_filter_.data() + k * state_rows_ * states_, state_rows_, p,
                        seen);
    } else {
      std::copy_n(p, state_rows_, seen);
    }
    std::copy_n(seen, state_rows_, state_vector_.data());
    add_matrix_vector(state_rows_, states_, P, state_rows_, r_c + k * states_, state_vector_.data());

    double* v = both_vector_.data();
    std::copy_n(rhs + k * both_, inputs_, v);
    if (k > 0) {
      std::copy_n(rhs + k * both_ - states_, states_, v + inputs_);
    } else {
      std::fill_n(v + inputs_, states_, 0.0);
    }
    std::fill(v + both_, v + both_rows_, 0.0);
    add_matrix_vector(both_rows_, states_, Gt, both_rows_, state_vector_.data(), v);
    for (int c = 0; c < inputs_; ++c) {
      v[c] /= L[c * both_rows_ + c];
      for (int i = c + 1; i < both_; ++i) v[i] -= L[c * both_rows_ + i] * v[c];
    }
    std::copy_n(v, inputs_, rhs + k * both_);
    std::copy_n(v + inputs_, states_, slope_.data() + k * state_rows_);
  }

  step_.setZero();  // x_k; x_0 is no unknown
  for (int k = 0; k < N; ++k) {
    const double* P = cost_to_go_.data() + k * state_rows_ * states_;
    const double* L = eliminated_.data() + k * both_rows_ * inputs_;
    double* v = both_vector_.data();
    std::copy_n(step_.data(), states_, v + inputs_);
    for (int c = inputs_ - 1; c >= 0; --c) {
      double sum = rhs[k * both_ + c];
      for (int i = c + 1; i < both_; ++i) sum -= L[c * both_rows_ + i] * v[i];
      v[c] = sum / L[c * both_rows_ + c];
    }
    std::copy_n(v, inputs_, rhs + k * both_);
    if (k > 0) std::copy_n(v + inputs_, states_, rhs + k * both_ - states_);

    double* r = rhs + layout_.variables() + k * states_;
    for (int i = 0; i < states_; ++i) step_[i] = -r[i];
    add_matrix_vector(state_rows_, both_, dynamics(k), state_rows_, v, step_.data());
    double* lambda = state_vector_.data();
    for (int i = 0; i < states_; ++i) lambda[i] = -dual_[k * state_rows_ + i];
    add_matrix_vector(state_rows_, states_, P, state_rows_, step_.data(), lambda);
    std::copy_n(lambda, states_, r);
    if (has_dual_block_) {  // x_(k+1) = F' (y + E p), which is y - E lambda
      const double* F = dual_filter_.data() + k * state_rows_ * states_;
      const double* p = slope_.data() + (k + 1) * state_rows_;
      for (int i = 0; i < states_; ++i) step_[i] -= entries_[dual_at_ + k * states_ + i] * p[i];
      for (int i = 0; i < states_; ++i) {
        lambda[i] = 0.0;
        for (int j = 0; j < states_; ++j) lambda[i] += F[i * state_rows_ + j] * step_[j];
      }
      std::copy_n(lambda, states_, step_.data());
    }
  }
  std::copy_n(step_.data(), states_, rhs + (N - 1) * both_ + inputs_);
}

}  // namespace atmos
