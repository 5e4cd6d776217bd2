#include "atmos_stl_planner/monitor.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "atmos_stl_planner/grid_encoding.h"

namespace atmos::stl {

namespace {

constexpr double kGrid_s = 0.1;
constexpr double kInfinite = std::numeric_limits<double>::infinity();

using Points = std::vector<Eigen::Vector2d>;

struct Range {
  double low, high;
};

bool is_instantaneous(const Formula& f) {
  return (f.children.empty() || f.op == Op::kAnd || f.op == Op::kOr) &&
         std::all_of(f.children.begin(), f.children.end(),
                     [](const FormulaPtr& c) { return is_instantaneous(*c); });
}

// What a formula without temporal operators can be anywhere in the workspace.
Range possible(const Specification& spec, const Formula& f) {
  if (f.children.empty()) return {least_possible(spec, f), most_possible(spec, f)};
  const bool both = f.op == Op::kAnd;
  Range range = both ? Range{kInfinite, kInfinite} : Range{-kInfinite, -kInfinite};
  for (const FormulaPtr& child : f.children) {
    const Range part = possible(spec, *child);
    range.low = both ? std::min(range.low, part.low) : std::max(range.low, part.low);
    range.high = both ? std::min(range.high, part.high) : std::max(range.high, part.high);
  }
  return range;
}

Points between(const Points& a, const Points& b, double share) {
  Points result;
  for (std::size_t i = 0; i < a.size(); ++i) result.push_back((1.0 - share) * a[i] + share * b[i]);
  return result;
}

// Clauses of one operator over predicates: the best or the worst so far, and what the rest of the window can
// bring.
class Flat {
 public:
  Flat(const Specification& spec, const Formula& formula) : spec_(spec), formula_(formula) {
    windowed_ = formula.op == Op::kEventually || formula.op == Op::kAlways;
    best_ = formula.op == Op::kEventually;
    inner_ = windowed_ ? formula.children[0].get() : &formula;
    from_ = windowed_ ? formula.from_s : 0.0;
    to_ = windowed_ ? formula.to_s : 0.0;
    range_ = possible(spec, *inner_);
    so_far_ = best_ ? -kInfinite : kInfinite;
  }

  // The motion from one sample to the next; times the first sample stands for are before it.
  void advance(double t0, const Points& p0, double t1, const Points& p1) {
    const double begin = std::max(t0, from_), end = std::min(t1, to_);
    if (begin > end || t1 < from_) return;
    const auto look = [&](double t) {
      const double share = t1 > t0 ? (t - t0) / (t1 - t0) : 1.0;
      const double value = instantaneous(spec_, *inner_, t, between(p0, p1, share));
      so_far_ = best_ ? std::max(so_far_, value) : std::min(so_far_, value);
    };
    look(begin);
    if (end > begin) look(end);
  }

  Range range(double now) const {
    if (now >= to_) return {so_far_, so_far_};
    if (best_) return {std::max(so_far_, range_.low), std::max(so_far_, range_.high)};
    return {std::min(so_far_, range_.low), std::min(so_far_, range_.high)};
  }

 private:
  const Specification& spec_;
  const Formula& formula_;
  const Formula* inner_;
  bool windowed_, best_;
  double from_, to_;
  Range range_;
  double so_far_;
};

// Any other clause: the definition on a grid, times not reached yet with what is possible.
class Nested {
 public:
  Nested(const Specification& spec, const Formula& formula) : spec_(spec), formula_(formula) {
    count_ = static_cast<std::size_t>(std::llround(spec.horizon_s / kGrid_s)) + 1;
    range_ = signal(formula)[0];
  }

  void advance(double t0, const Points& p0, double t1, const Points& p1) {
    bool grown = false;
    while (seen_.size() < count_) {
      const double t = static_cast<double>(seen_.size()) * kGrid_s;
      if (t > t1 + 1e-9) break;
      seen_.push_back(between(p0, p1, t1 > t0 ? std::clamp((t - t0) / (t1 - t0), 0.0, 1.0) : 1.0));
      grown = true;
    }
    if (grown) range_ = signal(formula_)[0];
  }

  Range range(double) const { return range_; }

 private:
  std::vector<Range> signal(const Formula& f) const {
    std::vector<Range> result(count_, Range{-kInfinite, kInfinite});
    if (f.children.empty()) {
      const Range unknown = possible(spec_, f);
      for (std::size_t k = 0; k < count_; ++k) {
        if (k < seen_.size()) {
          const double value = instantaneous(spec_, f, static_cast<double>(k) * kGrid_s, seen_[k]);
          result[k] = {value, value};
        } else {
          result[k] = unknown;
        }
      }
      return result;
    }
    std::vector<std::vector<Range>> parts;
    for (const FormulaPtr& child : f.children) parts.push_back(signal(*child));
    const auto from = static_cast<std::size_t>(std::llround(f.from_s / kGrid_s));
    const auto to = static_cast<std::size_t>(std::llround(f.to_s / kGrid_s));
    // Only times from which the window ends within the horizon are ever asked for.
    for (std::size_t k = 0; k + to < count_; ++k) {
      result[k] = {at(f, parts, k, from, to, &Range::low), at(f, parts, k, from, to, &Range::high)};
    }
    return result;
  }

  static double at(const Formula& f, const std::vector<std::vector<Range>>& parts, std::size_t k,
                   std::size_t from, std::size_t to, double Range::*side) {
    const bool least = f.op == Op::kAnd || f.op == Op::kAlways || f.op == Op::kRelease;
    double value = least ? kInfinite : -kInfinite;
    if (f.op == Op::kAnd || f.op == Op::kOr) {
      for (const auto& part : parts)
        value = least ? std::min(value, part[k].*side) : std::max(value, part[k].*side);
      return value;
    }
    if (f.op == Op::kAlways || f.op == Op::kEventually) {
      for (std::size_t u = k + from; u <= k + to; ++u)
        value = least ? std::min(value, parts[0][u].*side) : std::max(value, parts[0][u].*side);
      return value;
    }
    double held = least ? -kInfinite : kInfinite;
    for (std::size_t u = k; u <= k + to; ++u) {
      held = least ? std::max(held, parts[0][u].*side) : std::min(held, parts[0][u].*side);
      if (u < k + from) continue;
      const double both = least ? std::max(held, parts[1][u].*side) : std::min(held, parts[1][u].*side);
      value = least ? std::min(value, both) : std::max(value, both);
    }
    return value;
  }

  const Specification& spec_;
  const Formula& formula_;
  std::size_t count_;
  std::vector<Points> seen_;
  Range range_;
};

}  // namespace

double instantaneous(const Specification& spec, const Formula& f, double time_s, const Points& p) {
  switch (f.op) {
    case Op::kTrue:
      return f.negated ? -kInfinite : kInfinite;
    case Op::kIn: {
      const Region& region = spec.regions[static_cast<std::size_t>(f.region)];
      const Eigen::Vector2d at = p[static_cast<std::size_t>(f.robot)] - region.displacement(time_s);
      const double inside = (region.polytope.offsets - region.polytope.normals * at).minCoeff();
      return f.negated ? -inside : inside;
    }
    case Op::kLinear: {
      double value = f.constant;
      for (const LinearTerm& term : f.terms)
        value += term.coefficient * p[static_cast<std::size_t>(term.robot)][term.axis];
      return f.negated ? -value : value;
    }
    default: {
      const bool both = f.op == Op::kAnd;
      double value = both ? kInfinite : -kInfinite;
      for (const FormulaPtr& child : f.children) {
        const double part = instantaneous(spec, *child, time_s, p);
        value = both ? std::min(value, part) : std::max(value, part);
      }
      return value;
    }
  }
}

double demand_now(const Specification& spec, double time_s, const Points& p) {
  double least = kInfinite;
  for (const Clause& clause : spec.clauses) {
    const FormulaPtr formula = normal_form(clause.formula);
    const bool asked = formula->op == Op::kAlways && time_s >= formula->from_s && time_s <= formula->to_s;
    if (asked && is_instantaneous(*formula->children[0]))
      least = std::min(least, instantaneous(spec, *formula->children[0], time_s, p));
  }
  return least;
}

struct Monitor::Impl {
  explicit Impl(const Specification& specification) : spec(specification) {
    for (const Clause& clause : spec.clauses) formulas.push_back(normal_form(clause.formula));
    for (const FormulaPtr& formula : formulas) {
      const bool windowed = formula->op == Op::kEventually || formula->op == Op::kAlways;
      const bool flat = is_instantaneous(windowed ? *formula->children[0] : *formula);
      kinds.push_back(flat);
      if (flat) {
        flats.emplace_back(spec, *formula);
        states.push_back(state(flats.back().range(-1.0)));
      } else {
        nested.emplace_back(spec, *formula);
        states.push_back(state(nested.back().range(-1.0)));
      }
    }
  }

  static ClauseState state(Range range) { return {range.low, range.high, Verdict::kOpen}; }

  void advance(double t0, const Points& p0, double t1, const Points& p1) {
    std::size_t flat = 0, other = 0;
    for (std::size_t i = 0; i < states.size(); ++i) {
      Range range{};
      if (kinds[i]) {
        flats[flat].advance(t0, p0, t1, p1);
        range = flats[flat++].range(t1);
      } else {
        nested[other].advance(t0, p0, t1, p1);
        range = nested[other++].range(t1);
      }
      ClauseState& to = states[i];
      to.low_m = range.low;
      to.high_m = range.high;
      if (to.verdict == Verdict::kOpen && range.low >= 0.0) to.verdict = Verdict::kSatisfied;
      if (to.verdict == Verdict::kOpen && range.high < 0.0) to.verdict = Verdict::kViolated;
    }
  }

  const Specification spec;
  std::vector<FormulaPtr> formulas;
  std::vector<bool> kinds;  // flat or nested, in the order of the clauses
  std::vector<Flat> flats;
  std::vector<Nested> nested;
  std::vector<ClauseState> states;
  double last_s = -kInfinite;
  Points last;
  unsigned long long rejected = 0;
};

Monitor::Monitor(const Specification& specification) : impl_(new Impl(specification)) {}
Monitor::~Monitor() = default;

void Monitor::update(double time_s, const Points& p_WB) {
  bool good = std::isfinite(time_s) && p_WB.size() == impl_->spec.robots.size() && time_s > impl_->last_s;
  for (const Eigen::Vector2d& p : p_WB) good = good && p.allFinite();
  if (!good) {
    ++impl_->rejected;
    return;
  }
  const bool first = impl_->last.empty();
  const double since = first ? std::min(0.0, time_s) : impl_->last_s;
  impl_->advance(since, first ? p_WB : impl_->last, time_s, p_WB);
  impl_->last_s = time_s;
  impl_->last = p_WB;
}

const std::vector<ClauseState>& Monitor::clauses() const { return impl_->states; }
unsigned long long Monitor::rejected() const { return impl_->rejected; }

double Monitor::low_m() const {
  double least = kInfinite;
  for (const ClauseState& clause : impl_->states) least = std::min(least, clause.low_m);
  return least;
}

double Monitor::high_m() const {
  double least = kInfinite;
  for (const ClauseState& clause : impl_->states) least = std::min(least, clause.high_m);
  return least;
}

Verdict Monitor::verdict() const {
  bool all = true;
  for (const ClauseState& clause : impl_->states) {
    if (clause.verdict == Verdict::kViolated) return Verdict::kViolated;
    all = all && clause.verdict == Verdict::kSatisfied;
  }
  return all ? Verdict::kSatisfied : Verdict::kOpen;
}

}  // namespace atmos::stl
