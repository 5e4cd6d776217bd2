#include "atmos_model/formulas.h"

#include <algorithm>
#include <cctype>
#include <cstdlib>

namespace atmos {

// Recursive descent: sum := product {(+|-) product}, product := unary {(*|/) unary}, unary := {-} power,
// power := atom [^ unary], atom := number | name | function ( sum ) | ( sum ). Each returns the part that
// has its value.
class FormulaParser {
 public:
  FormulaParser(const std::string& text, const std::vector<std::string>& variables,
                const std::map<std::string, double>& constants, std::vector<Formulas::Part>& parts)
      : text_(text), variables_(variables), constants_(constants), parts_(parts) {}

  std::size_t parse() {
    for (const auto& [name, value] : constants_) check_name(name);
    const std::size_t value = sum();
    skip_space();
    if (at_ != text_.size()) fail("an operator or the end");
    return value;
  }

  // Drops the parts of what was left out: of a law of many terms often all but one are at 0.
  static void keep_needed(std::vector<Formulas::Part>& parts, std::vector<std::size_t>& results) {
    std::vector<char> needed(parts.size(), 0);
    for (const std::size_t result : results) needed[result] = 1;
    // What takes fewer than two parts names the first, which is a number or a variable.
    for (std::size_t k = parts.size(); k-- > 0;) {
      if (needed[k] != 0 && parts[k].op != Op::kVariable) needed[parts[k].left] = needed[parts[k].right] = 1;
    }
    std::vector<std::size_t> moved(parts.size(), 0);
    std::size_t kept = 0;
    for (std::size_t k = 0; k < parts.size(); ++k) {
      if (needed[k] == 0) continue;
      Formulas::Part part = parts[k];
      if (part.op != Op::kVariable) {
        part.left = moved[part.left];
        part.right = moved[part.right];
      }
      moved[k] = kept;
      parts[kept++] = part;
    }
    parts.resize(kept);
    for (std::size_t& result : results) result = moved[result];
  }

 private:
  using Op = Formulas::Op;

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

  void enter() {
    if (++nesting_ > Formulas::kMaxDepth) fail("a formula less deeply nested");
  }

  // The same part is made once.
  std::size_t part(const Formulas::Part& wanted) {
    const auto known = std::find(parts_.begin(), parts_.end(), wanted);
    const auto index = static_cast<std::size_t>(known - parts_.begin());
    if (known == parts_.end()) parts_.push_back(wanted);
    return index;
  }

  std::size_t number(double value) { return part({Op::kNumber, 0, 0, value}); }

  bool is_number(std::size_t index, double value) const {
    return parts_[index].op == Op::kNumber && parts_[index].number == value;
  }

  std::size_t binary(Op op, std::size_t left, std::size_t right) {
    if (op == Op::kMultiply && (is_number(left, 0.0) || is_number(right, 0.0))) return number(0.0);
    if ((op == Op::kAdd || op == Op::kSubtract) && is_number(right, 0.0)) return left;
    if (op == Op::kAdd && is_number(left, 0.0)) return right;
    // Squares are what most powers are, and pow() is slow.
    if (op == Op::kPower && is_number(right, 2.0)) return part({Op::kSquare, left});
    return part({op, left, right});
  }

  std::size_t sum() {
    enter();
    std::size_t value = product();
    for (;;) {
      const Op op = take('+') ? Op::kAdd : Op::kSubtract;
      if (op == Op::kSubtract && !take('-')) break;
      value = binary(op, value, product());
    }
    --nesting_;
    return value;
  }

  std::size_t product() {
    std::size_t value = unary();
    for (;;) {
      const Op op = take('*') ? Op::kMultiply : Op::kDivide;
      if (op == Op::kDivide && !take('/')) return value;
      value = binary(op, value, unary());
    }
  }

  std::size_t unary() {
    bool negative = false;
    for (;;) {
      if (take('-')) {
        negative = !negative;
      } else if (!take('+')) {
        break;
      }
    }
    std::size_t value = atom();
    if (take('^')) {
      enter();
      value = binary(Op::kPower, value, unary());
      --nesting_;
    }
    return negative ? part({Op::kNegate, value}) : value;
  }

  std::size_t atom() {
    skip_space();
    if (take('(')) {
      const std::size_t value = sum();
      if (!take(')')) fail("\")\"");
      return value;
    }
    if (at_ >= text_.size()) fail("a number, a name or \"(\"");
    const char first = text_[at_];
    if (std::isdigit(static_cast<unsigned char>(first)) || first == '.') {
      char* end = nullptr;
      const double value = std::strtod(text_.c_str() + at_, &end);
      const auto length = static_cast<std::size_t>(end - (text_.c_str() + at_));
      if (length == 0 || !std::isfinite(value)) fail("a finite number");
      at_ += length;
      return number(value);
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
      const std::size_t value = sum();
      if (!take(')')) fail("\")\"");
      return part({function->second, value});
    }
    const auto constant = constants_.find(name);
    const auto variable = std::find(variables_.begin(), variables_.end(), name);
    if (constant == constants_.end() && variable == variables_.end())
      fail("a known name instead of \"" + name + "\"");
    at_ = end;
    if (constant != constants_.end()) return number(constant->second);
    return part({Op::kVariable, static_cast<std::size_t>(variable - variables_.begin())});
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
  std::vector<Formulas::Part>& parts_;
  std::size_t at_ = 0;
  std::size_t nesting_ = 0;
};

Formulas::Formulas(const std::vector<std::string>& formulas, const std::vector<std::string>& variables,
                   const std::map<std::string, double>& constants) {
  for (const std::string& text : formulas)
    results_.push_back(FormulaParser(text, variables, constants, parts_).parse());
  FormulaParser::keep_needed(parts_, results_);
}

}  // namespace atmos
