// Formulas of model.yaml's `unmodelled`: + - * / ^ and sin cos tanh exp sqrt abs of named variables and
// coefficients. What is multiplied by a number or coefficient that is 0 is left out, whatever it would be.
#pragma once

#include <cmath>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

namespace atmos {

// A compiled formula. Names are resolved to indices when it is parsed; evaluation allocates nothing for
// formulas up to kMaxDepth deep and is templated on the scalar.
class Expression {
 public:
  static constexpr std::size_t kMaxDepth = 32;

  // The formula "0".
  Expression() : Expression("0", {}, {}) {}
  // `variables`: allowed names; their order is that of the values given to evaluate(). `constants`: further
  // names, which must be new ones. Throws std::invalid_argument with the place and what was expected there.
  Expression(const std::string& text, const std::vector<std::string>& variables,
             const std::map<std::string, double>& constants);

  const std::string& text() const { return text_; }

  template <class S>
  S evaluate(const S* values) const;

 private:
  enum class Op {
    kNumber,
    kVariable,
    kAdd,
    kSubtract,
    kMultiply,
    kDivide,
    kPower,
    kSquare,
    kNegate,
    kSin,
    kCos,
    kTanh,
    kExp,
    kSqrt,
    kAbs
  };
  struct Step {
    Op op;
    double number = 0.0;
    std::size_t variable = 0;
  };
  friend class ExpressionParser;

  std::string text_;
  std::vector<Step> steps_;  // reverse Polish
};

template <class S>
S Expression::evaluate(const S* values) const {
  using std::abs;
  using std::cos;
  using std::exp;
  using std::pow;
  using std::sin;
  using std::sqrt;
  using std::tanh;
  S stack[kMaxDepth];
  std::size_t top = 0;
  for (const Step& step : steps_) {
    switch (step.op) {
      case Op::kNumber:
        stack[top++] = S(step.number);
        break;
      case Op::kVariable:
        stack[top++] = values[step.variable];
        break;
      case Op::kAdd:
        --top;
        stack[top - 1] = stack[top - 1] + stack[top];
        break;
      case Op::kSubtract:
        --top;
        stack[top - 1] = stack[top - 1] - stack[top];
        break;
      case Op::kMultiply:
        --top;
        stack[top - 1] = stack[top - 1] * stack[top];
        break;
      case Op::kDivide:
        --top;
        stack[top - 1] = stack[top - 1] / stack[top];
        break;
      case Op::kPower:
        --top;
        stack[top - 1] = pow(stack[top - 1], stack[top]);
        break;
      case Op::kSquare:
        stack[top - 1] = stack[top - 1] * stack[top - 1];
        break;
      case Op::kNegate:
        stack[top - 1] = -stack[top - 1];
        break;
      case Op::kSin:
        stack[top - 1] = sin(stack[top - 1]);
        break;
      case Op::kCos:
        stack[top - 1] = cos(stack[top - 1]);
        break;
      case Op::kTanh:
        stack[top - 1] = tanh(stack[top - 1]);
        break;
      case Op::kExp:
        stack[top - 1] = exp(stack[top - 1]);
        break;
      case Op::kSqrt:
        stack[top - 1] = sqrt(stack[top - 1]);
        break;
      case Op::kAbs:
        stack[top - 1] = abs(stack[top - 1]);
        break;
    }
  }
  return stack[0];
}

}  // namespace atmos
