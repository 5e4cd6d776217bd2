// Sets of times: unions of closed intervals, and what temporal operators make of them.
#pragma once

#include <vector>

namespace atmos::stl {

struct Interval {
  double from, to;
};

// Disjoint and ascending; an interval may be a single point.
class IntervalSet {
 public:
  IntervalSet() = default;
  IntervalSet(double from, double to) : parts_{{from, to}} {}

  const std::vector<Interval>& parts() const { return parts_; }
  bool empty() const { return parts_.empty(); }
  bool contains(double t) const;
  // The part that holds t, or nullptr.
  const Interval* part_at(double t) const;

  // Appends an interval that begins at or after the end of the last; touching ones become one.
  void append(double from, double to);

 private:
  std::vector<Interval> parts_;
};

IntervalSet united(const IntervalSet& a, const IntervalSet& b);
IntervalSet intersected(const IntervalSet& a, const IntervalSet& b);
// The closure of what of [from, to] is not in the set.
IntervalSet complement(const IntervalSet& a, double from, double to);
// { t : some tau in [t+a, t+b] is in the set }
IntervalSet eventually(const IntervalSet& set, double a, double b);
// { t : all of [t+a, t+b] is in the set }
IntervalSet always(const IntervalSet& set, double a, double b);
// { t : some tau in [t+a, t+b] is in `goal` and all of [t, tau] is in `hold` }
IntervalSet until(const IntervalSet& hold, const IntervalSet& goal, double a, double b);

// { t in [begin, end] : every tau in [t+a, t+b] is in `duty`, or some time in [t, tau] is in `freed` }
IntervalSet release(const IntervalSet& freed, const IntervalSet& duty, double a, double b, double begin,
                    double end);

}  // namespace atmos::stl
