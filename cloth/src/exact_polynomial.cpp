#include "exact_polynomial.hpp"

#include <algorithm>

namespace tauguard::cloth {
namespace {

const Dyadic one(1.0);

Dyadic magnitude(const Dyadic& x) { return x.sign() < 0 ? -x : x; }

// The remainder |lead(b)|^n a - quotient b, of lower degree than b. The multiplier is positive, so
// that signs are kept. `quotient`, if not null, receives the quotient with the same multiplier.
Polynomial remainder(Polynomial a, const Polynomial& b, Polynomial* quotient = nullptr) {
  const Dyadic lead = magnitude(b.back());
  if (quotient) quotient->assign(a.size() < b.size() ? 0 : a.size() - b.size() + 1, Dyadic());
  while (a.size() >= b.size()) {
    const std::size_t shift = a.size() - b.size();
    const Dyadic top = b.back().sign() < 0 ? -a.back() : a.back();
    for (auto& c : a) c *= lead;
    for (std::size_t i = 0; i < b.size(); ++i) a[shift + i] -= top * b[i];
    if (quotient) {
      for (auto& c : *quotient) c *= lead;
      (*quotient)[shift] = top;
    }
    a.pop_back();
    a = trimmed(std::move(a));
  }
  return a;
}

// The signed remainder sequence that starts with a, b.
std::vector<Polynomial> sequence(Polynomial a, Polynomial b) {
  std::vector<Polynomial> all{std::move(a)};
  while (!b.empty()) {
    Polynomial next = remainder(all.back(), b);
    for (auto& c : next) c = -c;
    all.push_back(std::move(b));
    b = std::move(next);
  }
  return all;
}

int variations(const std::vector<Polynomial>& sequence, const Dyadic& x) {
  int count = 0, last = 0;
  for (const auto& p : sequence) {
    const int s = value(p, x).sign();
    if (s == 0) continue;
    count += last != 0 && s != last;
    last = s;
  }
  return count;
}

// Divides p by its common factors with its derivative. The result has the same roots, all simple.
Polynomial square_free(const Polynomial& p) {
  const auto all = sequence(p, derivative(p));
  if (all.back().size() == 1) return p;
  Polynomial quotient;
  remainder(p, all.back(), &quotient);
  return quotient;
}

// p / (t - x) for a root x.
Polynomial deflated(const Polynomial& p, const Dyadic& x) {
  Polynomial q(p.size() - 1);
  Dyadic carry;
  for (std::size_t i = p.size() - 1; i > 0; --i) q[i - 1] = carry = p[i] + carry * x;
  return q;
}

// Sign variations of the Bernstein coefficients on [0, 1]: 0 means no root in between, 1 means one.
int variations_between_ends(const Polynomial& p) {
  // For degree n they are, up to positive factors, the coefficients of sum p_i t^i (1 + t)^(n - i).
  Polynomial sum, power{one};
  for (std::size_t i = p.size(); i-- > 0;) {
    Polynomial term(i, Dyadic());
    for (const auto& c : power) term.push_back(p[i] * c);
    sum = sum + trimmed(std::move(term));
    power = power * Polynomial{one, one};
  }
  int count = 0, last = 0;
  for (const auto& c : sum) {
    if (c.sign() == 0) continue;
    count += last != 0 && c.sign() != last;
    last = c.sign();
  }
  return count;
}

// Cuts the interval at `middle` if it is inside. True if `middle` is the root.
bool narrow(Root& root, const Dyadic& middle, int below) {
  if (!(root.lo < middle && middle < root.hi)) return false;
  const int s = value(root.of, middle).sign();
  if (s == 0) {
    root = {middle, middle, {}};
    return true;
  }
  (s == below ? root.lo : root.hi) = middle;
  return false;
}

// The root in double precision, by bisection on coefficients scaled to about 1.
double estimate(const Root& root) {
  std::int64_t top = 0;
  bool any = false;
  for (const auto& c : root.of)
    if (!c.is_zero()) top = any ? std::max(top, c.floor_log2()) : c.floor_log2(), any = true;
  std::vector<double> c;
  for (const auto& exact : root.of) c.push_back(exact.scaled(-top).to_double());
  double lo = root.lo.to_double(), hi = root.hi.to_double();
  const auto f = [&c](double t) {
    double sum = 0;
    for (std::size_t i = c.size(); i-- > 0;) sum = sum * t + c[i];
    return sum;
  };
  for (const bool below = f(lo) > 0; hi - lo > 0x1p-52;) {
    const double middle = 0.5 * (lo + hi);
    ((f(middle) > 0) == below ? lo : hi) = middle;
  }
  return lo;
}

// Narrows the interval to 2^-60 by bisection, around an estimate in doubles first.
void refine(Root& root) {
  const int below = value(root.of, root.lo).sign();
  const double guess = estimate(root);
  for (double off : {-0x1p-51, 0x1p-51, -0x1p-44, 0x1p-44})
    if (guess + off > 0 && narrow(root, Dyadic(guess + off), below)) return;
  while (!(root.hi - root.lo < one.scaled(-60)))
    if (narrow(root, (root.lo + root.hi).scaled(-1), below)) return;
  narrow(root, Dyadic(root.hi.to_double()), below);  // a root that is a double is exact
}

// Intervals with one root of p each. p must have only simple roots, and none at 0 or 1. If a
// midpoint is a root, it is returned in `found`, and the intervals are not valid.
std::vector<Root> isolate(const Polynomial& p, Dyadic& found) {
  const auto sturm = sequence(p, derivative(p));
  struct Part {
    Dyadic lo, hi;
    int at_lo, at_hi;
  };
  std::vector<Part> open{{Dyadic(), one, variations(sturm, Dyadic()), variations(sturm, one)}};
  std::vector<Root> roots;
  while (!open.empty()) {
    const Part part = open.back();
    open.pop_back();
    const int count = part.at_lo - part.at_hi;
    if (count == 1) roots.push_back({part.lo, part.hi, p});
    if (count < 2) continue;
    const Dyadic middle = (part.lo + part.hi).scaled(-1);
    if (value(p, middle).is_zero()) {
      found = middle;
      return {};
    }
    const int at = variations(sturm, middle);
    open.push_back({middle, part.hi, at, part.at_hi});
    open.push_back({part.lo, middle, part.at_lo, at});
  }
  return roots;
}

}  // namespace

Polynomial trimmed(Polynomial p) {
  while (!p.empty() && p.back().is_zero()) p.pop_back();
  return p;
}

Polynomial operator+(const Polynomial& a, const Polynomial& b) {
  Polynomial sum = a.size() < b.size() ? b : a;
  const Polynomial& other = a.size() < b.size() ? a : b;
  for (std::size_t i = 0; i < other.size(); ++i) sum[i] += other[i];
  return trimmed(std::move(sum));
}

Polynomial operator-(const Polynomial& a, const Polynomial& b) {
  Polynomial negative = b;
  for (auto& c : negative) c = -c;
  return a + negative;
}

Polynomial operator*(const Polynomial& a, const Polynomial& b) {
  if (a.empty() || b.empty()) return {};
  Polynomial product(a.size() + b.size() - 1);
  for (std::size_t i = 0; i < a.size(); ++i)
    for (std::size_t j = 0; j < b.size(); ++j) product[i + j] += a[i] * b[j];
  return product;
}

Polynomial derivative(const Polynomial& p) {
  Polynomial d;
  for (std::size_t i = 1; i < p.size(); ++i)
    d.push_back(Dyadic::from_int(static_cast<std::int64_t>(i)) * p[i]);
  return d;
}

Dyadic value(const Polynomial& p, const Dyadic& x) {
  Dyadic sum;
  for (std::size_t i = p.size(); i-- > 0;) sum = sum * x + p[i];
  return sum;
}

std::vector<Root> roots_of(const Polynomial& p) {
  std::vector<Root> roots;
  Polynomial rest = p;
  const auto take = [&](const Dyadic& x) {
    roots.push_back({x, x, {}});
    while (rest.size() > 1 && value(rest, x).is_zero()) rest = deflated(rest, x);
  };
  for (const Dyadic& end : {Dyadic(), one})
    if (value(rest, end).is_zero()) take(end);
  const int variations = variations_between_ends(rest);
  if (variations == 1) roots.push_back({Dyadic(), one, rest});
  if (variations > 1) {
    // Sturm's theorem counts distinct roots. A midpoint that is a root is divided out.
    rest = square_free(rest);
    for (bool open = rest.size() > 1; open;) {
      Dyadic found;
      const auto isolated = isolate(rest, found);
      roots.insert(roots.end(), isolated.begin(), isolated.end());
      open = !found.is_zero();
      if (open) take(found);
    }
  }
  for (auto& root : roots)
    if (!root.exact()) refine(root);
  std::sort(roots.begin(), roots.end(), [](const Root& a, const Root& b) { return a.lo < b.lo; });
  return roots;
}

int sign_at(const Root& root, const Polynomial& g) {
  if (g.empty()) return 0;
  const int at_lo = value(g, root.lo).sign();
  if (root.exact()) return at_lo;
  // If the degree of g is at most 2, g keeps its sign if it has the same sign at both ends and at
  // the control point between them.
  if (g.size() <= 3) {
    const Dyadic control =
        value(g, root.lo).scaled(1) + (root.hi - root.lo) * value(derivative(g), root.lo);
    if (at_lo != 0 && control.sign() == at_lo && value(g, root.hi).sign() == at_lo) return at_lo;
  }
  const auto tarski = sequence(root.of, remainder(derivative(root.of) * g, root.of));
  return variations(tarski, root.lo) - variations(tarski, root.hi);
}

}  // namespace tauguard::cloth
