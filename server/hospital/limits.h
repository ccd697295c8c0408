// The times of the hospital that no option sets.
#pragma once

#include <chrono>

namespace isomesh::hospital::limits {

// Retry-After of an order that is rejected because too many are open: one takes minutes.
inline constexpr std::chrono::seconds kRetryOrderAfter{30};

}  // namespace isomesh::hospital::limits
