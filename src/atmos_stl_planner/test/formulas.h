// Random formulas for property tests.
#pragma once

#include <rapidcheck.h>

#include "atmos_stl_planner/formula.h"

namespace atmos::stl {

// From low to high - 1. rapidcheck starts with small sizes, which make ranges narrow; here all of it is
// wanted at once.
inline int draw(int low, int high) { return *rc::gen::resize(rc::kNominalSize, rc::gen::inRange(low, high)); }

inline FormulaPtr made(Formula formula) { return std::make_shared<const Formula>(std::move(formula)); }

// A formula over `robots` x `regions` names that looks at most `ahead_s` ahead. Window ends are multiples of
// `step_s`.
inline FormulaPtr random_formula(int robots, int regions, int depth, double ahead_s, double step_s) {
  Formula formula;
  const int choice = depth == 0 ? draw(0, 4) : draw(0, 12);
  const auto child = [&](double ahead) { return random_formula(robots, regions, depth - 1, ahead, step_s); };
  if (choice < 3) {
    formula.op = Op::kIn;
    formula.robot = draw(0, robots);
    formula.region = draw(0, regions);
  } else if (choice == 3) {
    formula.op = Op::kLinear;
    formula.terms = {{draw(0, robots), draw(0, 2), 0.5 * draw(-2, 3)}};
    formula.constant = 0.25 * draw(-8, 9);
  } else if (choice == 4) {
    formula.op = Op::kNot;
    formula.children = {child(ahead_s)};
  } else if (choice < 7) {
    formula.op = choice == 5 ? Op::kAnd : Op::kOr;
    formula.children = {child(ahead_s), child(ahead_s)};
  } else {
    const int steps = static_cast<int>(ahead_s / step_s);
    const int from = draw(0, steps + 1), to = draw(from, steps + 1);
    formula.from_s = from * step_s;
    formula.to_s = to * step_s;
    formula.op = choice < 9 ? Op::kEventually : choice < 11 ? Op::kAlways : Op::kUntil;
    const double left = ahead_s - formula.to_s;
    formula.children = {child(left)};
    if (formula.op == Op::kUntil) formula.children.push_back(child(left));
  }
  return made(std::move(formula));
}

}  // namespace atmos::stl
