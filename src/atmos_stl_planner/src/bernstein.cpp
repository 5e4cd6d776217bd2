#include "atmos_stl_planner/bernstein.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace atmos::stl::bernstein {

namespace {

constexpr double kMinWidth = 1e-10;

double binomial(Eigen::Index n, Eigen::Index k) {
  double result = 1.0;
  const auto top = static_cast<double>(n), size = static_cast<double>(k);
  for (double i = 1.0; i <= size; i += 1.0) result *= (top - size + i) / i;
  return result;
}

// The single root of a polynomial whose ends differ in sign, bracketed to rounding; the end of the bracket on
// the negative side is returned with the other one, so that the caller can stay on the safe side.
std::pair<double, double> single_root(const Coefficients& c) {
  double low = 0.0, high = 1.0, f_low = c[0], f_high = c[c.size() - 1];
  for (int i = 0; i < 100 && high - low > 1e-15; ++i) {
    // A secant step, kept inside the bracket; every third step halves it.
    double mid = i % 3 == 2 ? 0.5 * (low + high) : low - f_low * (high - low) / (f_high - f_low);
    const double guard = 1e-3 * (high - low);
    mid = std::clamp(mid, low + guard, high - guard);
    const double f = value(c, mid);
    if ((f < 0.0) == (f_low < 0.0)) {
      low = mid;
      f_low = f;
    } else {
      high = mid;
      f_high = f;
    }
  }
  return {low, high};
}

void collect(const Coefficients& c, double from, double to, IntervalSet& set) {
  const double smallest = c.minCoeff();
  if (smallest >= 0.0) return set.append(from, to);
  if (c.maxCoeff() < 0.0) return;
  int changes = 0;
  for (Eigen::Index i = 1; i < c.size(); ++i) changes += (c[i] < 0.0) != (c[i - 1] < 0.0) ? 1 : 0;
  if (changes == 1) {
    const auto [low, high] = single_root(c);
    if (c[0] < 0.0) {
      set.append(from + high * (to - from), to);
    } else {
      set.append(from, from + low * (to - from));
    }
    return;
  }
  if (to - from < kMinWidth) return;
  const auto [left, right] = split(c, 0.5);
  const double middle = 0.5 * (from + to);
  collect(left, from, middle, set);
  collect(right, middle, to, set);
}

}  // namespace

double value(const Coefficients& c, double s) {
  Eigen::Index n = c.size();
  if (n == 1) return c[0];
  if (n == 2) return (1.0 - s) * c[0] + s * c[1];
  Coefficients row = c;
  for (; n > 1; --n) {
    for (Eigen::Index i = 0; i + 1 < n; ++i) row[i] = (1.0 - s) * row[i] + s * row[i + 1];
  }
  return row[0];
}

Coefficients derivative(const Coefficients& c) {
  const Eigen::Index n = c.size() - 1;
  if (n == 0) return Coefficients::Zero(1);
  return static_cast<double>(n) * (c.tail(n) - c.head(n));
}

Coefficients elevated(const Coefficients& c, Eigen::Index degree) {
  Coefficients result = c;
  while (result.size() <= degree) {
    const Eigen::Index n = result.size();
    Coefficients next(n + 1);
    next[0] = result[0];
    next[n] = result[n - 1];
    for (Eigen::Index i = 1; i < n; ++i) {
      const double share = static_cast<double>(i) / static_cast<double>(n);
      next[i] = share * result[i - 1] + (1.0 - share) * result[i];
    }
    result = next;
  }
  return result;
}

Coefficients sum(const Coefficients& a, const Coefficients& b) {
  const Eigen::Index degree = std::max(a.size(), b.size()) - 1;
  return elevated(a, degree) + elevated(b, degree);
}

Coefficients product(const Coefficients& a, const Coefficients& b) {
  const Eigen::Index m = a.size() - 1, n = b.size() - 1;
  Coefficients result = Coefficients::Zero(m + n + 1);
  for (Eigen::Index i = 0; i <= m; ++i) {
    for (Eigen::Index j = 0; j <= n; ++j)
      result[i + j] += binomial(m, i) * binomial(n, j) / binomial(m + n, i + j) * a[i] * b[j];
  }
  return result;
}

std::pair<Coefficients, Coefficients> split(const Coefficients& c, double s) {
  const Eigen::Index n = c.size();
  Coefficients left(n), right(n), row = c;
  for (Eigen::Index k = 0; k < n; ++k) {
    left[k] = row[0];
    right[n - 1 - k] = row[n - 1 - k];
    for (Eigen::Index i = 0; i + 1 < n - k; ++i) row[i] = (1.0 - s) * row[i] + s * row[i + 1];
  }
  return {left, right};
}

IntervalSet nonnegative(const Coefficients& c) {
  IntervalSet set;
  collect(c, 0.0, 1.0, set);
  return set;
}

double lower_bound(const Coefficients& c, double tolerance) {
  // Depth-first; `best` is a value that is taken, so that a part whose coefficients all exceed it less the
  // tolerance needs no more looking at.
  double best = std::min(c[0], c[c.size() - 1]);
  std::vector<std::pair<Coefficients, int>> open = {{c, 0}};
  double bound = best;
  while (!open.empty()) {
    auto [part, depth] = std::move(open.back());
    open.pop_back();
    best = std::min({best, part[0], part[part.size() - 1]});
    const double low = part.minCoeff();
    if (low >= best - tolerance || depth > 60) {
      bound = std::min(bound, low);
      continue;
    }
    auto [left, right] = split(part, 0.5);
    open.emplace_back(std::move(left), depth + 1);
    open.emplace_back(std::move(right), depth + 1);
  }
  return std::min(bound, best);
}

double inverse(const Coefficients& c, double target) {
  const Eigen::Index n = c.size();
  if (!(target > c[0])) return 0.0;
  if (!(target < c[n - 1])) return 1.0;
  if (n == 2) return (target - c[0]) / (c[1] - c[0]);
  const auto [low, high] = single_root(c.array() - target);
  return 0.5 * (low + high);
}

}  // namespace atmos::stl::bernstein
