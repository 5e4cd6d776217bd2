// Formulas of model.yaml's `unmodelled`: + - * / ^ and sin cos tanh exp sqrt abs of named variables and
// coefficients. What is multiplied by a number or coefficient that is 0 is left out, whatever it would be.
#pragma once

#include <cmath>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

namespace atmos {

// Formulas compiled together: a part that occurs several times is evaluated once. Names are resolved to
// indices when they are parsed; evaluation allocates nothing up to kUsual parts and is templated on the
// scalar.
class Formulas {
 public:
  static constexpr std::size_t kMaxDepth = 32;  // of parentheses and powers
  static constexpr std::size_t kUsual = 256;

  Formulas() = default;
  // `variables`: allowed names; their order is that of the values given to evaluate(). `constants`: further
  // names, which must be new ones. Throws std::invalid_argument with the formula, the place and what was
  // expected there.
  Formulas(const std::vector<std::string>& formulas, const std::vector<std::string>& variables,
           const std::map<std::string, double>& constants);

  // One result per formula.
  template <class S>
  void evaluate(const S* values, S* results) const;

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
  // A number, a variable, or what an operation makes of earlier parts.
  struct Part {
    Op op;
    std::size_t left = 0, right = 0;  // parts; of a variable its index
    double number = 0.0;

    bool operator==(const Part& other) const {
      return op == other.op && left == other.left && right == other.right && number == other.number;
    }
  };
  friend class FormulaParser;

  std::vector<Part> parts_;
  std::vector<std::size_t> results_;
};

template <class S>
void Formulas::evaluate(const S* values, S* results) const {
  using std::abs;
  using std::cos;
  using std::exp;
  using std::pow;
  using std::sin;
  using std::sqrt;
  using std::tanh;
  S usual[kUsual];
  std::vector<S> many;
  S* v = usual;
  if (parts_.size() > kUsual) {
    many.resize(parts_.size());
    v = many.data();
  }
  for (std::size_t k = 0; k < parts_.size(); ++k) {
    const Part& part = parts_[k];
    switch (part.op) {
      case Op::kNumber:
        v[k] = S(part.number);
        break;
      case Op::kVariable:
        v[k] = values[part.left];
        break;
      case Op::kAdd:
        v[k] = v[part.left] + v[part.right];
        break;
      case Op::kSubtract:
        v[k] = v[part.left] - v[part.right];
        break;
      case Op::kMultiply:
        v[k] = v[part.left] * v[part.right];
        break;
      case Op::kDivide:
        v[k] = v[part.left] / v[part.right];
        break;
      case Op::kPower:
        v[k] = pow(v[part.left], v[part.right]);
        break;
      case Op::kSquare:
        v[k] = v[part.left] * v[part.left];
        break;
      case Op::kNegate:
        v[k] = -v[part.left];
        break;
      case Op::kSin:
        v[k] = sin(v[part.left]);
        break;
      case Op::kCos:
        v[k] = cos(v[part.left]);
        break;
      case Op::kTanh:
        v[k] = tanh(v[part.left]);
        break;
      case Op::kExp:
        v[k] = exp(v[part.left]);
        break;
      case Op::kSqrt:
        v[k] = sqrt(v[part.left]);
        break;
      case Op::kAbs:
        v[k] = abs(v[part.left]);
        break;
    }
  }
  for (std::size_t r = 0; r < results_.size(); ++r) results[r] = v[results_[r]];
}

}  // namespace atmos
