#include "atmos_model/expression.h"

#include <algorithm>
#include <cctype>
#include <cstdlib>

namespace atmos {

// Recursive descent: sum := product {(+|-) product}, product := unary {(*|/) unary}, unary := {-} power,
// power := atom [^ unary], atom := number | name | function ( sum ) | ( sum ).
class ExpressionParser {
 public:
  ExpressionParser(const std::string& text, const std::vector<std::string>& names,
                   std::vector<Expression::Step>& steps)
      : text_(text), names_(names), steps_(steps) {}

  void parse() {
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
  void emit_binary(Op op) {
    --depth_;
    emit({op});
  }

  void sum() {
    if (++nesting_ > Expression::kMaxDepth) fail("a formula less deeply nested");
    product();
    for (;;) {
      if (take('+')) {
        product();
        emit_binary(Op::kAdd);
      } else if (take('-')) {
        product();
        emit_binary(Op::kSubtract);
      } else {
        break;
      }
    }
    --nesting_;
  }

  void product() {
    unary();
    for (;;) {
      if (take('*')) {
        unary();
        emit_binary(Op::kMultiply);
      } else if (take('/')) {
        unary();
        emit_binary(Op::kDivide);
      } else {
        return;
      }
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
    atom();
    if (take('^')) {
      if (++nesting_ > Expression::kMaxDepth) fail("a formula less deeply nested");
      unary();
      --nesting_;
      emit_binary(Op::kPower);
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
    static const std::vector<std::pair<std::string, Op>> functions = {{"sin", Op::kSin},   {"cos", Op::kCos},
                                                                      {"tanh", Op::kTanh}, {"exp", Op::kExp},
                                                                      {"sqrt", Op::kSqrt}, {"abs", Op::kAbs}};
    const auto function =
        std::find_if(functions.begin(), functions.end(), [&](const auto& f) { return f.first == name; });
    if (function != functions.end()) {
      at_ = end;
      if (!take('(')) fail("\"(\" after " + name);
      sum();
      if (!take(')')) fail("\")\"");
      emit({function->second});
      return;
    }
    const auto variable = std::find(names_.begin(), names_.end(), name);
    if (variable == names_.end()) fail("a known name instead of \"" + name + "\"");
    at_ = end;
    emit({Op::kVariable, 0.0, static_cast<std::size_t>(variable - names_.begin())}, true);
  }

  const std::string& text_;
  const std::vector<std::string>& names_;
  std::vector<Expression::Step>& steps_;
  std::size_t at_ = 0;
  std::size_t depth_ = 0;
  std::size_t nesting_ = 0;
};

Expression::Expression(const std::string& text, const std::vector<std::string>& names) : text_(text) {
  ExpressionParser(text_, names, steps_).parse();
}

}  // namespace atmos
