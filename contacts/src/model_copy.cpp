#include "model_copy.hpp"

namespace tauguard::contacts {

// Lets the copy's array at the offset `at` point to a copy of its values.
template <class T>
void ModelCopy::replace(std::size_t at, std::size_t count, std::vector<T>* values) {
  const T* from = array<T>(at);
  values->assign(from, from + count);
  T* const to = values->data();
  std::memcpy(struct_.data() + at, &to, sizeof to);
}

void ModelCopy::take() {
  if (bound_) return e_.copy_model(bound_, e_.model);
  const char* from = static_cast<const char*>(e_.model);
  struct_.assign(from, from + e_.model_size);
  const std::size_t counts[3] = {static_cast<std::size_t>(e_.npair),
                                 static_cast<std::size_t>(e_.ngeom),
                                 static_cast<std::size_t>(e_.nflex)};
  for (int kind = 0; kind < 3; ++kind) {
    const std::size_t n = counts[kind], frictions = kind ? 3 : 5;
    replace(e_.at_margin[kind], n, &values_[kind][0]);
    replace(e_.at_solref[kind], 2 * n, &values_[kind][1]);
    replace(e_.at_solimp[kind], 5 * n, &values_[kind][2]);
    replace(e_.at_friction[kind], frictions * n, &values_[kind][3]);
    if (kind) replace(e_.at_priority[kind], n, &priorities_[kind]);
  }
}

}  // namespace tauguard::contacts
