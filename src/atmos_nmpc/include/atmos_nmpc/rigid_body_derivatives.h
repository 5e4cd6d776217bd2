// First and second derivatives of RigidBodyStep, compiled for the machine's vector units. Rows are kColumns
// doubles long whatever the number of inputs: (q, w, u, zeros).
#pragma once

namespace atmos::rigid_body {

constexpr int kColumns = 12;
constexpr int kMostInputs = kColumns - 7;

// What one step is made of: D / m and I^-1 L in the columns of u, zeros before and after; euler[i] times the
// product of the other two rates is component i of (w x I w) / I; the step [s].
struct Coefficients {
  double D[3][kColumns] = {};
  double L[3][kColumns] = {};
  double euler[3] = {};
  double step_s = 0.0;
};

// Where it starts, and its accelerations: D u / m in the body and I^-1 L u + d_w.
struct Start {
  double q[4], w[3];
  double force[3], torque[3];
};

// d x+ / d (q, w, u), 13 rows.
void jacobian(const Coefficients& step, const Start& start, double (*J)[kColumns]);
// Hessian of lambda' x+ with respect to (q, w, u), kColumns rows, both triangles; lambda: 13.
void hessian(const Coefficients& step, const Start& start, const double* lambda, double (*H)[kColumns]);

}  // namespace atmos::rigid_body
