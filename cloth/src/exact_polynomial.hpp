// Polynomials with dyadic coefficients, and the sign of one polynomial at a root of another, by
// Sturm's theorem and its generalisation by Tarski (Basu, Pollack & Roy, "Algorithms in Real
// Algebraic Geometry", chapter 2). Nothing is rounded. A sign of zero is found algebraically,
// without bisection down to the distance between two roots.
#pragma once

#include <vector>

#include "tauguard/geometry/dyadic.hpp"

namespace tauguard::cloth {

using geometry::Dyadic;

// Coefficients in ascending powers. The last one is not zero; the zero polynomial is empty.
using Polynomial = std::vector<Dyadic>;

Polynomial trimmed(Polynomial p);
Polynomial operator+(const Polynomial& a, const Polynomial& b);
Polynomial operator-(const Polynomial& a, const Polynomial& b);
Polynomial operator*(const Polynomial& a, const Polynomial& b);
Polynomial derivative(const Polynomial& p);
Dyadic value(const Polynomial& p, const Dyadic& x);

// A root in [0, 1]. If lo == hi, it is lo. Otherwise it is the only root of `of` in (lo, hi); it is
// simple, and `of` is not zero at either end.
struct Root {
  Dyadic lo, hi;
  Polynomial of;
  bool exact() const { return of.empty(); }
  // A double that is the root or at most 2^-60 before it.
  double floor() const { return lo.to_double(); }
};

// Every root of p in [0, 1], ascending, within 2^-60. p must not be the zero polynomial.
std::vector<Root> roots_of(const Polynomial& p);

// The sign of g at a root.
int sign_at(const Root& root, const Polynomial& g);

}  // namespace tauguard::cloth
