#include "atmos_model/expression.h"

#include <algorithm>
#include <cctype>
#include <cstdlib>

namespace atmos {

// Recursive descent: sum := product {(+|-) product}, product := unary {(*|/) unary}, unary := {-} power,
// power := atom [^ unary], atom := number | name | function ( sum ) | ( sum ).
class ExpressionParser {
 public:
  ExpressionParser(const std::string& text, const std::vector<std::string>& variables,
                   const std::map<std::string, double>& constants, std::vector<Expression::Step>& steps)
      : text_(text), variables_(variables), constants_(constants), steps_(steps) {}

  void parse() {
    for (const auto& [name, value] : constants_) check_name(name);
    sum();
    skip_space();
    if (at_ != text_.size()) fail("an operator or the end");
  }

 private:
  using Op = Expression::Op;

  [[noreturn]] void fail(const std::string& expected) const {
    throw std::invalid_argument("\"" + text_ + "\": at position " + std::to_string(at_ + 1) + " " + expected +
                                " was expected");
  }

  void skip_space() {
    while (at_ < text_.size() && std::isspace(static_cast<unsigned char>(text_[at_]))) ++at_;
  }

  bool take(char wanted) {
    skip_space();
    if (at_ >= text_.size() || text_[at_] != wanted) return false;
    ++at_;
    return true;
  }

  // `pushes`: the step leaves one more value on the stack than it takes.
  void emit(Expression::Step step, bool pushes = false) {
    if (pushes && ++depth_ > Expression::kMaxDepth) fail("a formula less deeply nested");
    steps_.push_back(step);
  }
  // `left`, `right`: where the steps of the operands begin.
  void emit_binary(Op op, std::size_t left, std::size_t right) {
    --depth_;
    const bool nothing_left = is_zero(left, right), nothing_right = is_zero(right, steps_.size());
    if (op == Op::kMultiply && (nothing_left || nothing_right)) {
      steps_.resize(left);
      emit({Op::kNumber, 0.0});
    } else if ((op == Op::kAdd || op == Op::kSubtract) && nothing_right) {
      steps_.resize(right);
    } else if (op == Op::kAdd && nothing_left) {
      steps_.erase(steps_.begin() + static_cast<long>(left), steps_.begin() + static_cast<long>(right));
    } else {
      emit({op});
    }
  }

  bool is_zero(std::size_t begin, std::size_t end) const {
    return end == begin + 1 && steps_[begin].op == Op::kNumber && steps_[begin].number == 0.0;
  }

  // Squares are what most powers are, and pow() is slow.
  void emit_power(std::size_t left, std::size_t right) {
    const Expression::Step exponent = steps_.back();
    if (exponent.op != Op::kNumber || exponent.number != 2.0) return emit_binary(Op::kPower, left, right);
    --depth_;
    steps_.back() = {Op::kSquare};
  }

  void sum() {
    if (++nesting_ > Expression::kMaxDepth) fail("a formula less deeply nested");
    const std::size_t left = steps_.size();
    product();
    for (;;) {
      const Op op = take('+') ? Op::kAdd : Op::kSubtract;
      if (op == Op::kSubtract && !take('-')) break;
      const std::size_t right = steps_.size();
      product();
      emit_binary(op, left, right);
    }
    --nesting_;
  }

  void product() {
    const std::size_t left = steps_.size();
    unary();
    for (;;) {
      const Op op = take('*') ? Op::kMultiply : Op::kDivide;
      if (op == Op::kDivide && !take('/')) return;
      const std::size_t right = steps_.size();
      unary();
      emit_binary(op, left, right);
    }
  }

  void unary() {
    bool negative = false;
    for (;;) {
      if (take('-')) {
        negative = !negative;
      } else if (!take('+')) {
        break;
      }
    }
    const std::size_t left = steps_.size();
    atom();
    if (take('^')) {
      if (++nesting_ > Expression::kMaxDepth) fail("a formula less deeply nested");
      const std::size_t right = steps_.size();
      unary();
      --nesting_;
      emit_power(left, right);
    }
    if (negative) emit({Op::kNegate});
  }

  void atom() {
    skip_space();
    if (take('(')) {
      sum();
      if (!take(')')) fail("\")\"");
      return;
    }
    if (at_ >= text_.size()) fail("a number, a name or \"(\"");
    const char first = text_[at_];
    if (std::isdigit(static_cast<unsigned char>(first)) || first == '.') {
      char* end = nullptr;
      const double number = std::strtod(text_.c_str() + at_, &end);
      const auto length = static_cast<std::size_t>(end - (text_.c_str() + at_));
      if (length == 0 || !std::isfinite(number)) fail("a finite number");
      at_ += length;
      emit({Op::kNumber, number}, true);
      return;
    }
    if (!std::isalpha(static_cast<unsigned char>(first))) fail("a number, a name or \"(\"");
    std::size_t end = at_;
    while (end < text_.size() && (std::isalnum(static_cast<unsigned char>(text_[end])) || text_[end] == '_'))
      ++end;
    const std::string name = text_.substr(at_, end - at_);
    const auto function = functions().find(name);
    if (function != functions().end()) {
      at_ = end;
      if (!take('(')) fail("\"(\" after " + name);
      sum();
      if (!take(')')) fail("\")\"");
      emit({function->second});
      return;
    }
    const auto constant = constants_.find(name);
    const auto variable = std::find(variables_.begin(), variables_.end(), name);
    if (constant == constants_.end() && variable == variables_.end())
      fail("a known name instead of \"" + name + "\"");
    at_ = end;
    if (constant != constants_.end()) {
      emit({Op::kNumber, constant->second}, true);
    } else {
      emit({Op::kVariable, 0.0, static_cast<std::size_t>(variable - variables_.begin())}, true);
    }
  }

  static const std::map<std::string, Op>& functions() {
    static const std::map<std::string, Op> all = {{"sin", Op::kSin}, {"cos", Op::kCos},   {"tanh", Op::kTanh},
                                                  {"exp", Op::kExp}, {"sqrt", Op::kSqrt}, {"abs", Op::kAbs}};
    return all;
  }

  // A constant must not hide a variable or a function, and must be a name at all.
  void check_name(const std::string& name) const {
    const bool taken = functions().count(name) != 0 ||
                       std::find(variables_.begin(), variables_.end(), name) != variables_.end();
    const bool well_formed =
        !name.empty() && std::isalpha(static_cast<unsigned char>(name[0])) &&
        std::all_of(name.begin(), name.end(), [](unsigned char c) { return std::isalnum(c) || c == '_'; });
    if (taken) throw std::invalid_argument("\"" + name + "\" is a variable or function already");
    if (!well_formed) throw std::invalid_argument("\"" + name + "\" is not a name of letters, digits and _");
  }

  const std::string& text_;
  const std::vector<std::string>& variables_;
  const std::map<std::string, double>& constants_;
  std::vector<Expression::Step>& steps_;
  std::size_t at_ = 0;
  std::size_t depth_ = 0;
  std::size_t nesting_ = 0;
};

Expression::Expression(const std::string& text, const std::vector<std::string>& variables,
                       const std::map<std::string, double>& constants)
    : text_(text) {
  ExpressionParser(text_, variables, constants, steps_).parse();
}

}  // namespace atmos
