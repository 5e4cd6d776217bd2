#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdlib>
#include <set>

#include "atmos_stl_planner/formula.h"

namespace atmos::stl {

namespace {

constexpr std::size_t kMaxLength = 10000;
constexpr int kMaxNesting = 60;

const std::set<std::string>& reserved() {
  static const std::set<std::string> words = {"in",  "x",   "y",     "true",       "false",
                                              "not", "and", "or",    "implies",    "F",
                                              "G",   "U",   "until", "eventually", "always"};
  return words;
}

enum class Kind { kWord, kNumber, kSymbol, kEnd };

struct Token {
  Kind kind = Kind::kEnd;
  std::string text;
  double number = 0.0;
  std::size_t position = 0;
};

std::vector<Token> tokens_of(const std::string& text) {
  std::vector<Token> tokens;
  std::size_t at = 0;
  const auto is = [&text](std::size_t i, auto test) {
    return i < text.size() && test(static_cast<unsigned char>(text[i])) != 0;
  };
  while (at < text.size()) {
    if (is(at, [](int c) { return std::isspace(c); })) {
      ++at;
      continue;
    }
    Token token;
    token.position = at;
    if (is(at, [](int c) { return std::isalpha(c) || c == '_'; })) {
      std::size_t end = at;
      while (is(end, [](int c) { return std::isalnum(c) || c == '_'; })) ++end;
      token.kind = Kind::kWord;
      token.text = text.substr(at, end - at);
      at = end;
    } else if (is(at, [](int c) { return std::isdigit(c) || c == '.'; }) &&
               (text[at] != '.' || is(at + 1, [](int c) { return std::isdigit(c); }))) {
      // strtod would also take hexadecimal numbers, which nobody means.
      std::size_t end = at;
      while (is(end, [](int c) { return std::isdigit(c) || c == '.'; })) ++end;
      if (end < text.size() && (text[end] == 'e' || text[end] == 'E')) {
        std::size_t exponent = end + 1;
        if (exponent < text.size() && (text[exponent] == '+' || text[exponent] == '-')) ++exponent;
        if (is(exponent, [](int c) { return std::isdigit(c); })) {
          end = exponent;
          while (is(end, [](int c) { return std::isdigit(c); })) ++end;
        }
      }
      token.kind = Kind::kNumber;
      token.text = text.substr(at, end - at);
      char* stop = nullptr;
      token.number = std::strtod(token.text.c_str(), &stop);
      if (*stop != '\0' || !std::isfinite(token.number))
        throw FormulaError(at, "\"" + token.text + "\" is not a finite number", "");
      at = end;
    } else {
      static const char* const kPairs[] = {"->", "=>", ">=", "<=", "&&", "||"};
      token.kind = Kind::kSymbol;
      token.text = text.substr(at, 1);
      for (const char* pair : kPairs) {
        if (text.compare(at, 2, pair) == 0) token.text = pair;
      }
      at += token.text.size();
    }
    tokens.push_back(token);
  }
  Token end;
  end.position = text.size();
  tokens.push_back(end);
  return tokens;
}

FormulaPtr make(Formula formula) { return std::make_shared<const Formula>(std::move(formula)); }

FormulaPtr make(Op op, std::vector<FormulaPtr> children) {
  Formula formula;
  formula.op = op;
  formula.children = std::move(children);
  return make(std::move(formula));
}

class Parser {
 public:
  Parser(const std::string& text, const Vocabulary& names) : tokens_(tokens_of(text)), names_(names) {}

  FormulaPtr parse() {
    FormulaPtr formula = implication();
    if (now().kind != Kind::kEnd) fail("\"" + now().text + "\" is not expected here", continuation_hint());
    return formula;
  }

 private:
  const Token& now() const { return tokens_[at_]; }
  const Token& after(std::size_t n) const { return tokens_[std::min(at_ + n, tokens_.size() - 1)]; }
  bool is(const std::string& text) const {
    return (now().kind == Kind::kWord || now().kind == Kind::kSymbol) && now().text == text;
  }
  bool take(const std::string& text) {
    if (!is(text)) return false;
    ++at_;
    return true;
  }
  [[noreturn]] void fail(const std::string& message, const std::string& hint = "") const {
    throw FormulaError(now().position, message, hint);
  }
  std::string found() const { return now().kind == Kind::kEnd ? "the end" : "\"" + now().text + "\""; }
  void expect(const std::string& symbol, const std::string& where) {
    if (!take(symbol)) fail("expected \"" + symbol + "\" " + where + ", found " + found());
  }

  std::string continuation_hint() const {
    if (is(")")) return "there is no \"(\" that it closes";
    if (is("&") || is("|")) return "write \"and\" or \"or\"";
    if (now().kind != Kind::kWord) return "";
    const std::string near = nearest_name(now().text, {"and", "or", "implies", "U"});
    return near.empty() ? "join two formulas by and, or, implies or U[a,b]"
                        : "did you mean \"" + near + "\"?";
  }

  // Counts the recursion, so that a hostile text ends in an error instead of a full stack.
  struct Nesting {
    explicit Nesting(Parser& owner) : parser(owner) {
      if (++parser.nesting_ > kMaxNesting) parser.fail("the formula is nested too deeply");
    }
    ~Nesting() { --parser.nesting_; }
    Parser& parser;
  };

  FormulaPtr implication() {
    const Nesting nesting(*this);
    FormulaPtr left = disjunction();
    if (!take("implies") && !take("->") && !take("=>")) return left;
    FormulaPtr right = implication();
    return make(Op::kOr, {make(Op::kNot, {left}), right});
  }

  FormulaPtr disjunction() {
    std::vector<FormulaPtr> parts = {conjunction()};
    while (take("or") || take("||")) parts.push_back(conjunction());
    return parts.size() == 1 ? parts[0] : make(Op::kOr, std::move(parts));
  }

  FormulaPtr conjunction() {
    std::vector<FormulaPtr> parts = {until()};
    while (take("and") || take("&&")) parts.push_back(until());
    return parts.size() == 1 ? parts[0] : make(Op::kAnd, std::move(parts));
  }

  FormulaPtr until() {
    FormulaPtr left = unary();
    if (!is("U") && !is("until")) return left;
    ++at_;
    Formula formula;
    formula.op = Op::kUntil;
    window(formula, "U");
    formula.children = {left, unary()};
    return make(std::move(formula));
  }

  FormulaPtr unary() {
    const Nesting nesting(*this);
    if (take("not") || take("!")) return make(Op::kNot, {unary()});
    const bool eventually = is("F") || is("eventually");
    if (eventually || is("G") || is("always")) {
      Formula formula;
      formula.op = eventually ? Op::kEventually : Op::kAlways;
      const std::string name = now().text;
      ++at_;
      window(formula, name);
      formula.children = {unary()};
      return make(std::move(formula));
    }
    return atom();
  }

  void window(Formula& formula, const std::string& name) {
    if (!take("["))
      fail("expected a time window after " + name + ", found " + found(),
           "write " + name + "[0,10], in seconds");
    const std::size_t begin = now().position;
    formula.from_s = time();
    expect(",", "between the ends of the window");
    formula.to_s = time();
    expect("]", "after the window");
    if (formula.from_s > formula.to_s)
      throw FormulaError(begin, "the window ends before it begins", "swap its two numbers");
  }

  double time() {
    if (now().kind != Kind::kNumber)
      fail("expected a time in seconds, found " + found(), is("-") ? "windows lie in the future" : "");
    return tokens_[at_++].number;
  }

  FormulaPtr atom() {
    if (take("(")) {
      FormulaPtr inside = implication();
      expect(")", "to close the parenthesis");
      return inside;
    }
    if (take("true")) return make(Formula{});
    if (take("false")) return make(Op::kNot, {make(Formula{})});
    if (now().kind == Kind::kNumber || is("-") || is("+") || is_coordinate()) return comparison();
    if (now().kind != Kind::kWord) fail("expected a formula, found " + found());
    return membership();
  }

  bool is_coordinate() const {
    if (is("x") || is("y")) return true;
    return now().kind == Kind::kWord && after(1).text == "." &&
           (after(2).text == "x" || after(2).text == "y");
  }

  int robot_here() {
    if (now().kind == Kind::kWord && after(1).kind == Kind::kSymbol && after(1).text == ".") {
      const auto found_at = std::find(names_.robots.begin(), names_.robots.end(), now().text);
      if (found_at == names_.robots.end())
        fail("there is no robot \"" + now().text + "\"", hint(now().text, names_.robots));
      at_ += 2;
      return static_cast<int>(found_at - names_.robots.begin());
    }
    if (names_.default_robot < 0)
      fail("which robot is meant?",
           names_.robots.empty() ? "" : "write " + names_.robots[0] + "." + now().text);
    return names_.default_robot;
  }

  static std::string hint(const std::string& word, const std::vector<std::string>& candidates) {
    const std::string near = nearest_name(word, candidates);
    if (!near.empty()) return "did you mean \"" + near + "\"?";
    std::string all;
    for (const std::string& candidate : candidates) all += (all.empty() ? "" : ", ") + candidate;
    return all.empty() ? "the file has none" : "the file has " + all;
  }

  FormulaPtr membership() {
    const bool qualified = after(1).kind == Kind::kSymbol && after(1).text == ".";
    if (!qualified && !is("in")) {
      const bool region =
          std::find(names_.regions.begin(), names_.regions.end(), now().text) != names_.regions.end();
      if (region) fail("a region alone is no formula", "write in(" + now().text + ")");
      std::vector<std::string> words(reserved().begin(), reserved().end());
      fail("\"" + now().text + "\" is not a formula", hint(now().text, words));
    }
    Formula formula;
    formula.op = Op::kIn;
    formula.robot = robot_here();
    if (!take("in")) fail("expected in(REGION), x or y after the robot's name, found " + found());
    expect("(", "after in");
    const auto region = std::find(names_.regions.begin(), names_.regions.end(), now().text);
    if (now().kind != Kind::kWord) fail("expected the name of a region, found " + found());
    if (region == names_.regions.end())
      fail("there is no region \"" + now().text + "\"", hint(now().text, names_.regions));
    formula.region = static_cast<int>(region - names_.regions.begin());
    ++at_;
    expect(")", "after the region");
    return make(std::move(formula));
  }

  // sum (">=" | "<=") sum, brought to the form terms + constant >= 0.
  FormulaPtr comparison() {
    Formula formula;
    formula.op = Op::kLinear;
    sum(formula, 1.0);
    double side = 0.0;
    if (take(">=")) {
      side = 1.0;
    } else if (take("<=")) {
      side = -1.0;
    } else {
      fail("expected >= or <=, found " + found(),
           is("<") || is(">") || is("=") ? "robustness does not tell < from <=: write <= or >=" : "");
    }
    for (LinearTerm& term : formula.terms) term.coefficient *= side;
    formula.constant *= side;
    sum(formula, -side);
    std::vector<LinearTerm> merged;
    for (const LinearTerm& term : formula.terms) {
      const auto same = std::find_if(merged.begin(), merged.end(), [&term](const LinearTerm& other) {
        return other.robot == term.robot && other.axis == term.axis;
      });
      if (same == merged.end()) {
        merged.push_back(term);
      } else {
        same->coefficient += term.coefficient;
      }
    }
    formula.terms = merged;
    return make(std::move(formula));
  }

  void sum(Formula& formula, double factor) {
    double sign = 1.0;
    if (take("-")) {
      sign = -1.0;
    } else {
      take("+");
    }
    product(formula, sign * factor);
    while (is("+") || is("-")) {
      sign = is("-") ? -1.0 : 1.0;
      ++at_;
      product(formula, sign * factor);
    }
  }

  void product(Formula& formula, double factor) {
    if (take("-")) factor = -factor;
    if (now().kind == Kind::kNumber) {
      factor *= tokens_[at_++].number;
      if (!take("*")) {
        formula.constant += factor;
        return;
      }
    }
    if (!is_coordinate()) fail("expected a number, x or y, found " + found());
    LinearTerm term;
    term.robot = robot_here();
    term.axis = is("x") ? 0 : 1;
    term.coefficient = factor;
    ++at_;
    formula.terms.push_back(term);
  }

  std::vector<Token> tokens_;
  const Vocabulary& names_;
  std::size_t at_ = 0;
  int nesting_ = 0;
};

}  // namespace

bool is_reserved(const std::string& word) { return reserved().count(word) != 0; }

FormulaPtr parse_formula(const std::string& text, const Vocabulary& names) {
  if (text.size() > kMaxLength) throw FormulaError(kMaxLength, "the formula is too long", "");
  return Parser(text, names).parse();
}

}  // namespace atmos::stl
