#include "atmos_nmpc/rigid_body_derivatives.h"

#include "vectorised.h"

namespace atmos::rigid_body {

namespace {

constexpr int kVectors = kColumns / kWidth;
constexpr int kStages = 4;

// kColumns doubles, element by element.
struct Row {
  Vector v[kVectors];
};

ATMOS_INLINED void clear(Row& row) {
  for (Vector& v : row.v) v = Vector{};
}
ATMOS_INLINED void load(const double* from, Row& row) {
  for (int i = 0; i < kVectors; ++i) row.v[i] = *reinterpret_cast<const Vector*>(from + i * kWidth);
}
ATMOS_INLINED void store(const Row& row, double* to) {
  for (int i = 0; i < kVectors; ++i) *reinterpret_cast<Vector*>(to + i * kWidth) = row.v[i];
}
ATMOS_INLINED void add(Row& row, double factor, const Row& other) {
  for (int i = 0; i < kVectors; ++i) row.v[i] += factor * other.v[i];
}
// The sum of factor[c] rows[c].
template <int kCount>
ATMOS_INLINED void combine(const double (&factor)[kCount], const Row (&rows)[kCount], Row& result) {
  for (int i = 0; i < kVectors; ++i) {
    Vector sum = factor[0] * rows[0].v[i];
    for (int c = 1; c < kCount; ++c) sum += factor[c] * rows[c].v[i];
    result.v[i] = sum;
  }
}
template <int kCount>
ATMOS_INLINED void add_combined(const double (&factor)[kCount], const Row (&rows)[kCount], Row& result) {
  for (int i = 0; i < kVectors; ++i) {
    for (int c = 0; c < kCount; ++c) result.v[i] += factor[c] * rows[c].v[i];
  }
}

ATMOS_INLINED double dot(const double* a, const double* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
ATMOS_INLINED void cross(const double* a, const double* b, double* c) {
  c[0] = a[1] * b[2] - a[2] * b[1];
  c[1] = a[2] * b[0] - a[0] * b[2];
  c[2] = a[0] * b[1] - a[1] * b[0];
}

// Runge-Kutta: x+ = x + sum of slope_weight(i) k_i; stage i starts at s + point_weight(i) k_(i-1); position
// gains position_weight(i) a_i.
ATMOS_INLINED double slope_weight(int i, double h) { return h / 6.0 * (i == 0 || i == 3 ? 1.0 : 2.0); }
ATMOS_INLINED double point_weight(int i, double h) { return i == 3 ? h : 0.5 * h; }
ATMOS_INLINED double position_weight(int i, double h) { return i == 3 ? 0.0 : h * h / 6.0; }

// q' = 1/2 q * (0, w) by q and by w, and w' by w.
struct SlopeJacobian {
  double q[4][4], w[4][3], euler[3][3];
};
ATMOS_INLINED void slope_jacobian(const Coefficients& step, const double* q, const double* w,
                                  SlopeJacobian& J) {
  const double a = 0.5 * w[0], b = 0.5 * w[1], c = 0.5 * w[2];
  const double of_q[4][4] = {{0, -a, -b, -c}, {a, 0, c, -b}, {b, -c, 0, a}, {c, b, -a, 0}};
  const double r = 0.5 * q[0], x = 0.5 * q[1], y = 0.5 * q[2], z = 0.5 * q[3];
  const double of_w[4][3] = {{-x, -y, -z}, {r, -z, y}, {z, r, -x}, {-y, x, r}};
  const double* e = step.euler;
  const double of_euler[3][3] = {
      {0, -e[0] * w[2], -e[0] * w[1]}, {-e[1] * w[2], 0, -e[1] * w[0]}, {-e[2] * w[1], -e[2] * w[0], 0}};
  __builtin_memcpy(J.q, of_q, sizeof(of_q));
  __builtin_memcpy(J.w, of_w, sizeof(of_w));
  __builtin_memcpy(J.euler, of_euler, sizeof(of_euler));
}

// One stage of the step: its point, the point's sensitivity to (q, w, u), and the slopes' Jacobian there.
struct Stage {
  double q[4], w[3];
  Row Q[4], W[3];
  SlopeJacobian J;
};

// Fills `stages`. `visit(stage, i, slope)` sees the sensitivities of (q', w') at every stage.
template <class Visit>
ATMOS_INLINED void run(const Coefficients& step, const Start& start, Stage (&stages)[kStages],
                       const Visit& visit) {
  Row slope[7], L[3];
  for (int r = 0; r < 3; ++r) load(step.L[r], L[r]);
  double rate[7] = {};
  for (int i = 0; i < kStages; ++i) {
    Stage& stage = stages[i];
    const double weight = i == 0 ? 0.0 : point_weight(i, step.step_s);
    for (int r = 0; r < 7; ++r) {
      Row& row = r < 4 ? stage.Q[r] : stage.W[r - 4];
      clear(row);
      row.v[r / kWidth][r % kWidth] = 1.0;
      if (i > 0) add(row, weight, slope[r]);
    }
    for (int r = 0; r < 4; ++r) stage.q[r] = start.q[r] + weight * rate[r];
    for (int r = 0; r < 3; ++r) stage.w[r] = start.w[r] + weight * rate[4 + r];
    slope_jacobian(step, stage.q, stage.w, stage.J);
    // Bilinear: the slope is the Jacobian by q times q.
    for (int r = 0; r < 4; ++r)
      rate[r] = stage.J.q[r][0] * stage.q[0] + stage.J.q[r][1] * stage.q[1] + stage.J.q[r][2] * stage.q[2] +
                stage.J.q[r][3] * stage.q[3];
    rate[4] = start.torque[0] - step.euler[0] * stage.w[1] * stage.w[2];
    rate[5] = start.torque[1] - step.euler[1] * stage.w[2] * stage.w[0];
    rate[6] = start.torque[2] - step.euler[2] * stage.w[0] * stage.w[1];
    for (int r = 0; r < 4; ++r) {
      combine(stage.J.q[r], stage.Q, slope[r]);
      add_combined(stage.J.w[r], stage.W, slope[r]);
    }
    for (int r = 0; r < 3; ++r) {
      combine(stage.J.euler[r], stage.W, slope[4 + r]);
      add(slope[4 + r], 1.0, L[r]);
    }
    visit(stage, i, slope);
  }
}

// R(q), as rotate() has it, and d (R(q) f) / dq, one row per component of the result.
ATMOS_INLINED void rotation(const double* q, const double* f, double (*R)[3], double (*by_q)[4]) {
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  const double of_q[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
                             {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
                             {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}};
  __builtin_memcpy(R, of_q, sizeof(of_q));
  const double* v = q + 1;
  double v_f[3];
  cross(v, f, v_f);
  const double along = dot(v, f);
  for (int r = 0; r < 3; ++r) {
    by_q[r][0] = 2 * v_f[r];
    for (int j = 0; j < 3; ++j)
      by_q[r][1 + j] = 2 * (v[r] * f[j] - 2 * f[r] * v[j]) + (r == j ? 2 * along : 0.0);
  }
  // 2 w (e_j x f)
  by_q[0][2] += 2 * w * f[2], by_q[0][3] -= 2 * w * f[1];
  by_q[1][1] -= 2 * w * f[2], by_q[1][3] += 2 * w * f[0];
  by_q[2][1] += 2 * w * f[1], by_q[2][2] -= 2 * w * f[0];
}

// Symmetric B with alpha' R(q) f = alpha' f + 1/2 q' B q.
ATMOS_INLINED void rotation_form(const double* alpha, const double* f, double (&B)[4][4]) {
  double S[3][3];
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) S[r][c] = 2 * alpha[r] * f[c];
  }
  const double x = S[2][1] - S[1][2], y = S[0][2] - S[2][0], z = S[1][0] - S[0][1];
  const double xy = S[0][1] + S[1][0], xz = S[0][2] + S[2][0], yz = S[1][2] + S[2][1];
  const double form[4][4] = {{0, x, y, z},
                             {x, -2 * (S[1][1] + S[2][2]), xy, xz},
                             {y, xy, -2 * (S[0][0] + S[2][2]), yz},
                             {z, xz, yz, -2 * (S[0][0] + S[1][1])}};
  __builtin_memcpy(B, form, sizeof(form));
}

}  // namespace

ATMOS_VECTORISED void jacobian(const Coefficients& step, const Start& start, double (*J)[kColumns]) {
  const double h = step.step_s;
  Row D[3], sum[13];
  for (int r = 0; r < 3; ++r) load(step.D[r], D[r]);
  for (Row& row : sum) clear(row);
  for (int r = 0; r < 7; ++r) sum[6 + r].v[r / kWidth][r % kWidth] = 1.0;
  Stage stages[kStages];
  run(
      step, start,
      stages, [&](const Stage& stage, int i, const Row(&slope)[7]) __attribute__((always_inline)) {
        double R[3][3], by_q[3][4];
        rotation(stage.q, start.force, R, by_q);
        for (int r = 0; r < 3; ++r) {
          Row acceleration;
          combine(by_q[r], stage.Q, acceleration);
          add_combined(R[r], D, acceleration);
          add(sum[r], position_weight(i, h), acceleration);
          add(sum[3 + r], slope_weight(i, h), acceleration);
        }
        for (int r = 0; r < 7; ++r) add(sum[6 + r], slope_weight(i, h), slope[r]);
      });
  for (int r = 0; r < 13; ++r) store(sum[r], J[r]);
}

ATMOS_VECTORISED void hessian(const Coefficients& step, const Start& start, const double* lambda,
                              double (*H)[kColumns]) {
  const double h = step.step_s;
  Row D[3];
  for (int r = 0; r < 3; ++r) load(step.D[r], D[r]);
  Stage stages[kStages];
  run(step, start, stages, [](const Stage&, int, const Row(&)[7]) __attribute__((always_inline)){});

  // H = A + A', A = the sum over the stages of Q' weighted_q + W' weighted_w.
  Row weighted[kStages][7];
  double sigma[7] = {};  // adjoint of the next stage's point
  for (int i = kStages - 1; i >= 0; --i) {
    const Stage& stage = stages[i];
    // Weight of this stage's slopes k and a in lambda' x+, through the end point and through later stages.
    double kappa[7], alpha[3];
    const double later = i + 1 < kStages ? point_weight(i + 1, h) : 0.0;
    for (int r = 0; r < 7; ++r) kappa[r] = slope_weight(i, h) * lambda[6 + r] + later * sigma[r];
    for (int r = 0; r < 3; ++r)
      alpha[r] = slope_weight(i, h) * lambda[3 + r] + position_weight(i, h) * lambda[r];

    double M_qq[4][4];
    rotation_form(alpha, start.force, M_qq);
    const double* k = kappa;
    const double cross_form[4][3] = {{0.5 * k[1], 0.5 * k[2], 0.5 * k[3]},
                                     {-0.5 * k[0], 0.5 * k[3], -0.5 * k[2]},
                                     {-0.5 * k[3], -0.5 * k[0], 0.5 * k[1]},
                                     {0.5 * k[2], -0.5 * k[1], -0.5 * k[0]}};
    // d2 (alpha' R(q) f) / dq df.
    double by_force[4][3];
    const double* v = stage.q + 1;
    cross(alpha, v, by_force[0]);
    const double along = dot(alpha, v);
    for (int j = 0; j < 3; ++j) {
      by_force[0][j] *= 2;
      for (int c = 0; c < 3; ++c)
        by_force[1 + j][c] = 2 * (alpha[j] * v[c] - 2 * v[j] * alpha[c]) + (j == c ? 2 * along : 0.0);
    }
    const double w2 = 2 * stage.q[0];
    by_force[1][1] += w2 * alpha[2], by_force[1][2] -= w2 * alpha[1];
    by_force[2][0] -= w2 * alpha[2], by_force[2][2] += w2 * alpha[0];
    by_force[3][0] += w2 * alpha[1], by_force[3][1] -= w2 * alpha[0];
    for (int r = 0; r < 4; ++r) {
      const double half[4] = {0.5 * M_qq[r][0], 0.5 * M_qq[r][1], 0.5 * M_qq[r][2], 0.5 * M_qq[r][3]};
      combine(half, stage.Q, weighted[i][r]);
      add_combined(cross_form[r], stage.W, weighted[i][r]);
      add_combined(by_force[r], D, weighted[i][r]);
    }
    const double c[3] = {-0.5 * k[4] * step.euler[0], -0.5 * k[5] * step.euler[1],
                         -0.5 * k[6] * step.euler[2]};
    const double euler_form[3][3] = {{0, c[2], c[1]}, {c[2], 0, c[0]}, {c[1], c[0], 0}};
    for (int r = 0; r < 3; ++r) combine(euler_form[r], stage.W, weighted[i][4 + r]);

    for (int j = 0; j < 4; ++j) {
      sigma[j] = 0.0;
      for (int r = 0; r < 4; ++r) sigma[j] += stage.J.q[r][j] * kappa[r] + M_qq[j][r] * stage.q[r];
    }
    for (int j = 0; j < 3; ++j) {
      sigma[4 + j] = 0.0;
      for (int r = 0; r < 4; ++r) sigma[4 + j] += stage.J.w[r][j] * kappa[r];
      for (int r = 0; r < 3; ++r) sigma[4 + j] += stage.J.euler[r][j] * kappa[4 + r];
    }
  }

  double A[kColumns][kColumns];
  for (int row = 0; row < kColumns; ++row) {
    Row sum;
    clear(sum);
    const int vector = row / kWidth, at = row % kWidth;
    for (int i = 0; i < kStages; ++i) {
      for (int r = 0; r < 4; ++r) add(sum, stages[i].Q[r].v[vector][at], weighted[i][r]);
      for (int r = 0; r < 3; ++r) add(sum, stages[i].W[r].v[vector][at], weighted[i][4 + r]);
    }
    store(sum, A[row]);
  }
  for (int row = 0; row < kColumns; ++row) {
    for (int column = 0; column < kColumns; ++column) H[row][column] = A[row][column] + A[column][row];
  }
}

}  // namespace atmos::rigid_body
