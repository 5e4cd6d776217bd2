// Signal temporal logic over the planar positions of several robots: syntax, text and normal form.
#pragma once

#include <cstddef>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace atmos::stl {

enum class Op {
  kTrue,
  kIn,      // robot's centre in a region
  kLinear,  // sum of coefficient * coordinate + constant >= 0
  kNot,
  kAnd,
  kOr,
  kEventually,  // F[a,b] child
  kAlways,      // G[a,b] child
  kUntil,       // children[0] U[a,b] children[1]; the first one holds up to and including the witness
  kRelease,     // dual of kUntil: not (not children[0] U[a,b] not children[1])
};

// One summand of a linear predicate: coefficient times a coordinate (0: x, 1: y) of a robot's centre, m.
struct LinearTerm {
  int robot = 0;
  int axis = 0;
  double coefficient = 0.0;
};

struct Formula;
using FormulaPtr = std::shared_ptr<const Formula>;

// A node of an immutable tree. `negated` is used by kTrue, kIn and kLinear in negation normal form.
struct Formula {
  Op op = Op::kTrue;
  bool negated = false;
  double from_s = 0.0, to_s = 0.0;  // window of a temporal operator, relative to the time of evaluation
  int robot = 0, region = 0;        // kIn: indices into the names given to the parser
  std::vector<LinearTerm> terms;    // kLinear
  double constant = 0.0;
  std::vector<FormulaPtr> children;
};

// Names that formulas may use, and how they are read.
struct Vocabulary {
  std::vector<std::string> robots;
  std::vector<std::string> regions;
  // The robot meant by `in(A)`, `x` and `y` without a robot's name; -1: a name is required.
  int default_robot = -1;
};

// What is wrong with a formula's text: `position` counts characters from 0, `suggestion` may be empty.
class FormulaError : public std::runtime_error {
 public:
  FormulaError(std::size_t at, const std::string& message, std::string hint)
      : std::runtime_error(message), position(at), suggestion(std::move(hint)) {}
  std::size_t position;
  std::string suggestion;
};

// Reads a formula: `in(A)`, `R1.in(A)`, `x + 0.5 * R2.y >= 1`, `true`, `false`, `not`, `and`, `or`, `implies`
// (`->`), `F[0,10] p`, `G[0,10] p`, `p U[0,10] q`, parentheses. Unary and temporal operators bind tightest,
// then U, and, or, implies. Throws FormulaError.
FormulaPtr parse_formula(const std::string& text, const Vocabulary& names);

// A text that parses to the same tree, if the formula was parsed and not brought to normal form.
std::string to_text(const Formula& formula, const Vocabulary& names);

// Negation normal form: negation only in `negated`; kNot does not occur.
FormulaPtr normal_form(const FormulaPtr& formula, bool negate = false);

// How far into the future of its evaluation the formula looks, s.
double horizon(const Formula& formula);

// The conjuncts of a formula whose outermost operators are `and`.
std::vector<FormulaPtr> conjuncts(const FormulaPtr& formula);

// The candidate that `word` is most likely a misspelling of; empty if none is near.
std::string nearest_name(const std::string& word, const std::vector<std::string>& candidates);

// Words of the language, which nothing may be named after.
bool is_reserved(const std::string& word);

}  // namespace atmos::stl
