#include "atmos_stl_planner/formula.h"

#include <algorithm>
#include <cstdio>

namespace atmos::stl {

namespace {

std::string number_text(double value) {
  char buffer[40];
  std::snprintf(buffer, sizeof buffer, "%.17g", value);
  char shorter[40];
  std::snprintf(shorter, sizeof shorter, "%.12g", value);
  return std::strtod(shorter, nullptr) == value ? shorter : buffer;
}

std::string window_text(const Formula& formula) {
  return "[" + number_text(formula.from_s) + "," + number_text(formula.to_s) + "]";
}

std::string linear_text(const Formula& formula, const Vocabulary& names) {
  std::string text;
  for (const LinearTerm& term : formula.terms) {
    if (!text.empty()) text += " + ";
    text += number_text(term.coefficient) + " * " + names.robots[static_cast<std::size_t>(term.robot)] +
            (term.axis == 0 ? ".x" : ".y");
  }
  return "(" + (text.empty() ? "0" : text) + " >= " + number_text(-formula.constant) + ")";
}

std::string joined(const Formula& formula, const Vocabulary& names, const std::string& word) {
  std::string text;
  for (const FormulaPtr& child : formula.children) {
    if (!text.empty()) text += " " + word + " ";
    text += to_text(*child, names);
  }
  return "(" + text + ")";
}

std::string positive_text(const Formula& formula, const Vocabulary& names) {
  switch (formula.op) {
    case Op::kTrue:
      return "true";
    case Op::kIn:
      return names.robots[static_cast<std::size_t>(formula.robot)] + ".in(" +
             names.regions[static_cast<std::size_t>(formula.region)] + ")";
    case Op::kLinear:
      return linear_text(formula, names);
    case Op::kNot:
      return "not " + to_text(*formula.children[0], names);
    case Op::kAnd:
      return joined(formula, names, "and");
    case Op::kOr:
      return joined(formula, names, "or");
    case Op::kEventually:
      return "F" + window_text(formula) + " " + to_text(*formula.children[0], names);
    case Op::kAlways:
      return "G" + window_text(formula) + " " + to_text(*formula.children[0], names);
    case Op::kUntil:
      return joined(formula, names, "U" + window_text(formula));
    case Op::kRelease:
      return "not (not " + to_text(*formula.children[0], names) + " U" + window_text(formula) + " not " +
             to_text(*formula.children[1], names) + ")";
  }
  return {};
}

Op dual(Op op) {
  switch (op) {
    case Op::kAnd:
      return Op::kOr;
    case Op::kOr:
      return Op::kAnd;
    case Op::kEventually:
      return Op::kAlways;
    case Op::kAlways:
      return Op::kEventually;
    case Op::kUntil:
      return Op::kRelease;
    case Op::kRelease:
      return Op::kUntil;
    default:
      return op;
  }
}

// Insertions, deletions, replacements and swaps of neighbours that make b of a.
std::size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) {
    for (std::size_t j = 0; j <= b.size(); ++j) {
      if (i == 0 || j == 0) {
        d[i][j] = i + j;
        continue;
      }
      d[i][j] =
          std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + (a[i - 1] == b[j - 1] ? 0u : 1u)});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  }
  return d[a.size()][b.size()];
}

}  // namespace

std::string to_text(const Formula& formula, const Vocabulary& names) {
  return (formula.negated ? "not " : "") + positive_text(formula, names);
}

FormulaPtr normal_form(const FormulaPtr& formula, bool negate) {
  if (formula->op == Op::kNot) return normal_form(formula->children[0], !negate);
  auto result = std::make_shared<Formula>(*formula);
  if (formula->children.empty()) {
    result->negated = formula->negated != negate;
    return result;
  }
  if (negate) result->op = dual(formula->op);
  for (FormulaPtr& child : result->children) child = normal_form(child, negate);
  return result;
}

double horizon(const Formula& formula) {
  double latest = 0.0;
  for (const FormulaPtr& child : formula.children) latest = std::max(latest, horizon(*child));
  return formula.to_s + latest;
}

std::vector<FormulaPtr> conjuncts(const FormulaPtr& formula) {
  if (formula->op != Op::kAnd) return {formula};
  std::vector<FormulaPtr> result;
  for (const FormulaPtr& child : formula->children) {
    for (FormulaPtr& part : conjuncts(child)) result.push_back(std::move(part));
  }
  return result;
}

std::string nearest_name(const std::string& word, const std::vector<std::string>& candidates) {
  std::string best;
  std::size_t best_distance = std::max<std::size_t>(1, word.size() / 2) + 1;
  for (const std::string& candidate : candidates) {
    const std::size_t distance = edit_distance(word, candidate);
    if (distance < best_distance && distance < std::max(word.size(), candidate.size())) {
      best = candidate;
      best_distance = distance;
    }
  }
  return best;
}

}  // namespace atmos::stl
