#include "atmos_stl_planner/formula.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "formulas.h"

namespace atmos::stl {
namespace {

const Vocabulary kNames{{"R1", "R2"}, {"A", "B", "Obs"}, -1};
const Vocabulary kOne{{"R1"}, {"A", "B", "Obs"}, 0};

bool same(const Formula& a, const Formula& b) {
  if (a.op != b.op || a.negated != b.negated || a.from_s != b.from_s || a.to_s != b.to_s ||
      a.robot != b.robot || a.region != b.region || a.constant != b.constant ||
      a.terms.size() != b.terms.size() || a.children.size() != b.children.size())
    return false;
  for (std::size_t i = 0; i < a.terms.size(); ++i) {
    if (a.terms[i].robot != b.terms[i].robot || a.terms[i].axis != b.terms[i].axis ||
        a.terms[i].coefficient != b.terms[i].coefficient)
      return false;
  }
  for (std::size_t i = 0; i < a.children.size(); ++i) {
    if (!same(*a.children[i], *b.children[i])) return false;
  }
  return true;
}

std::string read(const std::string& text, const Vocabulary& names = kOne) {
  return to_text(*parse_formula(text, names), names);
}

struct Failure {
  std::size_t position = 999;
  std::string message, suggestion;
};
Failure failure(const std::string& text, const Vocabulary& names = kOne) {
  try {
    parse_formula(text, names);
  } catch (const FormulaError& error) {
    return {error.position, error.what(), error.suggestion};
  }
  return {};
}

TEST(Formula, ReadsTheLanguage) {
  EXPECT_EQ(read("F[0,10] in(A) and G[0,90] not in(Obs)"), "(F[0,10] R1.in(A) and G[0,90] not R1.in(Obs))");
  EXPECT_EQ(read("in(A) U[1,2.5] in(B)"), "(R1.in(A) U[1,2.5] R1.in(B))");
  EXPECT_EQ(read("in(A) -> in(B) or in(Obs) and true"),
            "(not R1.in(A) or (R1.in(B) or (R1.in(Obs) and true)))");
  EXPECT_EQ(read("G[0,30] F[0,5] (in(A) or in(B))"), "G[0,30] F[0,5] (R1.in(A) or R1.in(B))");
  EXPECT_EQ(read("always[0,3] !in(A) && eventually[0,1] in(B)"), "(G[0,3] not R1.in(A) and F[0,1] R1.in(B))");
  EXPECT_EQ(read("R2.x - R1.x >= 0.5", kNames), "(1 * R2.x + -1 * R1.x >= 0.5)");
  EXPECT_EQ(read("2 * x + 1 <= y"), "(-2 * R1.x + 1 * R1.y >= 1)");
}

TEST(Formula, SaysWhereItIsWrongAndWhatMayBeMeant) {
  Failure f = failure("F[0,10] in(Ob)");
  EXPECT_EQ(f.position, 11u);
  EXPECT_EQ(f.suggestion, "did you mean \"Obs\"?");
  f = failure("F in(A)");
  EXPECT_EQ(f.position, 2u);
  EXPECT_NE(f.suggestion.find("F[0,10]"), std::string::npos);
  f = failure("in(A) adn in(B)");
  EXPECT_EQ(f.position, 6u);
  EXPECT_EQ(f.suggestion, "did you mean \"and\"?");
  f = failure("F[10,0] in(A)");
  EXPECT_EQ(f.position, 2u);
  f = failure("in(A)", kNames);
  EXPECT_EQ(f.suggestion, "write R1.in");
  f = failure("R3.in(A)", kNames);
  EXPECT_EQ(f.position, 0u);
  EXPECT_FALSE(f.suggestion.empty());
  f = failure("A");
  EXPECT_EQ(f.suggestion, "write in(A)");
  for (const char* text :
       {"", "(", "in(A", "in()", "F[0,] in(A)", "F[-1,2] in(A)", "F[0,1e999] in(A)", "in(A))", "x > 1",
        "x >=", "1.2.3 >= x", "not", "in(A) U in(B)", "in(A) U[0,1]", "@", "F[0,1]", "0x1 >= x"})
    EXPECT_NE(failure(text).position, 999u) << text;
}

TEST(Formula, DeepNestingIsAnErrorAndNoCrash) {
  EXPECT_NE(failure(std::string(9000, '(')).message.find("deeply"), std::string::npos);
  std::string nots;
  for (int i = 0; i < 2000; ++i) nots += "not ";
  EXPECT_NE(failure(nots + "in(A)").message.find("deeply"), std::string::npos);
  EXPECT_NE(failure(std::string(20000, '(')).message.find("long"), std::string::npos);
}

TEST(Formula, HorizonAddsUpAlongNesting) {
  EXPECT_EQ(horizon(*parse_formula("G[0,30] F[2,5] in(A) and F[0,40] in(B)", kOne)), 40.0);
  EXPECT_EQ(horizon(*parse_formula("in(A) U[1,2] G[0,3] in(B)", kOne)), 5.0);
}

TEST(Formula, NormalFormPushesNegationDown) {
  const FormulaPtr f = parse_formula("not (F[0,1] in(A) and (in(A) U[0,2] in(B)))", kOne);
  const FormulaPtr n = normal_form(f);
  ASSERT_EQ(n->op, Op::kOr);
  EXPECT_EQ(n->children[0]->op, Op::kAlways);
  EXPECT_TRUE(n->children[0]->children[0]->negated);
  EXPECT_EQ(n->children[1]->op, Op::kRelease);
  EXPECT_EQ(conjuncts(parse_formula("in(A) and (in(B) and in(A))", kOne)).size(), 3u);
}

RC_GTEST_PROP(Formula, TextAndTreeAreTheSame, ()) {
  const FormulaPtr formula = random_formula(2, 3, 4, 20.0, 0.5);
  RC_ASSERT(same(*parse_formula(to_text(*formula, kNames), kNames), *formula));
}

RC_GTEST_PROP(Formula, AnyTextIsReadOrRefused, ()) {
  const auto words = *rc::gen::container<std::vector<std::string>>(
      rc::gen::element<std::string>("F", "[", "0", ",", "10", "]", "in", "(", "A", ")", "and", "not", "U",
                                    ".", "R1", "x", ">=", "-", "*", "1e9", "->", "or", "@", "\xff", " "));
  std::string text;
  for (const std::string& word : words) text += word + (*rc::gen::arbitrary<bool>() ? " " : "");
  try {
    parse_formula(text, kNames);
  } catch (const FormulaError& error) {
    RC_ASSERT(error.position <= text.size());
  }
}

}  // namespace
}  // namespace atmos::stl
