#include "atmos_stl_planner/interval_set.h"

#include <algorithm>

namespace atmos::stl {

const Interval* IntervalSet::part_at(double t) const {
  const auto after = std::upper_bound(parts_.begin(), parts_.end(), t,
                                      [](double time, const Interval& part) { return time < part.from; });
  if (after == parts_.begin()) return nullptr;
  const Interval& part = *(after - 1);
  return t <= part.to ? &part : nullptr;
}

bool IntervalSet::contains(double t) const { return part_at(t) != nullptr; }

void IntervalSet::append(double from, double to) {
  if (!parts_.empty() && from <= parts_.back().to) {
    parts_.back().to = std::max(parts_.back().to, to);
  } else {
    parts_.push_back({from, to});
  }
}

namespace {

IntervalSet normalised(std::vector<Interval> parts) {
  std::sort(parts.begin(), parts.end(), [](const Interval& a, const Interval& b) { return a.from < b.from; });
  IntervalSet result;
  for (const Interval& part : parts) result.append(part.from, part.to);
  return result;
}

}  // namespace

IntervalSet united(const IntervalSet& a, const IntervalSet& b) {
  std::vector<Interval> all = a.parts();
  all.insert(all.end(), b.parts().begin(), b.parts().end());
  return normalised(std::move(all));
}

IntervalSet intersected(const IntervalSet& a, const IntervalSet& b) {
  IntervalSet result;
  std::size_t i = 0, j = 0;
  while (i < a.parts().size() && j < b.parts().size()) {
    const Interval &left = a.parts()[i], &right = b.parts()[j];
    const double from = std::max(left.from, right.from), to = std::min(left.to, right.to);
    if (from <= to) result.append(from, to);
    (left.to < right.to ? i : j) += 1;
  }
  return result;
}

IntervalSet complement(const IntervalSet& a, double from, double to) {
  IntervalSet result;
  double begin = from;
  bool open = false;  // whether `begin` lies behind a part
  for (const Interval& part : a.parts()) {
    if (part.to < from || part.from > to) continue;
    if (part.from > begin || (!open && part.from > from)) result.append(begin, part.from);
    begin = part.to;
    open = true;
  }
  if (begin < to || !open) result.append(begin, to);
  return result;
}

IntervalSet eventually(const IntervalSet& set, double a, double b) {
  std::vector<Interval> parts;
  for (const Interval& part : set.parts()) parts.push_back({part.from - b, part.to - a});
  return normalised(std::move(parts));
}

IntervalSet always(const IntervalSet& set, double a, double b) {
  std::vector<Interval> parts;
  for (const Interval& part : set.parts()) {
    if (part.from - a <= part.to - b) parts.push_back({part.from - a, part.to - b});
  }
  return normalised(std::move(parts));
}

IntervalSet until(const IntervalSet& hold, const IntervalSet& goal, double a, double b) {
  std::vector<Interval> parts;
  for (const Interval& held : hold.parts()) {
    for (const Interval& reached : goal.parts()) {
      const double from = std::max(held.from, reached.from), to = std::min(held.to, reached.to);
      if (from > to) continue;
      const double begin = std::max(held.from, from - b), end = std::min(held.to, to - a);
      if (begin <= end) parts.push_back({begin, end});
    }
  }
  return normalised(std::move(parts));
}

IntervalSet release(const IntervalSet& freed, const IntervalSet& duty, double a, double b, double begin,
                    double end) {
  std::vector<Interval> parts = freed.parts();
  const auto add = [&parts](double from, double to) {
    if (from <= to) parts.push_back({from, to});
  };
  const IntervalSet gaps = complement(freed, begin, end);
  for (const Interval& gap : gaps.parts()) {
    const bool ends = freed.contains(gap.to);
    if (ends) add(std::max(gap.from, gap.to - a), gap.to);  // freed before the duty begins
    for (const Interval& kept : duty.parts()) {
      const double from = std::max(gap.from, kept.from - a);
      add(from, std::min(gap.to, kept.to - b));
      if (ends && gap.to <= kept.to) add(from, gap.to);  // the duty is kept until freed
    }
  }
  return normalised(std::move(parts));
}

}  // namespace atmos::stl
